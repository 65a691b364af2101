"""Commands run as a user runs them, warnings being errors."""

from seqopt._cli.main import main


def beside_models(err):
    """Return standard error without what was enough, which every run says."""
    said = ("enough: ", "taken: ", "left out: ", "proof: ", "grips: ")
    return "".join(line for line in err.splitlines(keepends=True) if not line.startswith(said))


def command(capsys, *words):
    """Return exit status, standard output and standard error of one command of seqopt."""
    try:
        status = main([str(word) for word in words])
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    return status, out, err
