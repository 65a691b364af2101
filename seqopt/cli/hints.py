"""What the program says to whoever starts, or mistypes a word."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from seqopt.errors import did_you_mean

EXAMPLES = """Three examples:

  seqopt compare arch25
      all methods and formulations on the arch of Bruun et al., side by side
  seqopt optimize arch25 --schedule free --aim minmax --out best
      the best build by three robots; best/report.html shows it step by step
  seqopt optimize arch:span=2,rise=0.8 --formulation overlap_dp --out mine
      where to hold an arch of your own

seqopt --help names all commands, seqopt COMMAND --help what each can do.
"""
WRONG_CHOICE = re.compile(r"invalid choice: '(.*?)' \(choose from (.*)\)")
UNKNOWN = re.compile(r"unrecognized arguments: (--?[^ =]+)")
MISSING = "the following arguments are required"


def nearest(message: str, options: Iterable[str]) -> str:
    """Return a hint at the word that was probably meant, or nothing.

    ``message``: of the parser; ``options``: that its commands have.

    Examples
    --------
    >>> nearest("unrecognized arguments: --formulaton=beam", ["--formulation", "--out"])
    ' (did you mean --formulation?)'
    >>> nearest("invalid choice: 'optimise' (choose from 'optimize', 'scene')", [])
    ' (did you mean optimize?)'
    """
    if found := WRONG_CHOICE.search(message):
        return did_you_mean(found[1], [word.strip(" '") for word in found[2].split(",")])
    found = UNKNOWN.search(message)
    if found is None:
        return ""
    known = {option.lstrip("-"): option for option in options}
    if found[1] in known.values():
        return " (options stand after the command)"
    hint = did_you_mean(found[1].lstrip("-"), known)
    return hint.replace("mean ", "mean --") if hint else ""


def first_wrong(message: str, given: Sequence[str], options: Sequence[str]) -> str:
    """Return a message about a missing argument, or one about a mistyped option that explains it.

    ``message``: of the parser; ``given``: the words that it was given; ``options``: that it has.

    Examples
    --------
    >>> given = ["arch25", "--ot", "best"]
    >>> first_wrong("the following arguments are required: --out", given, ["--out"])
    'unrecognized arguments: --ot'
    """
    if not message.startswith(MISSING) or message.endswith("COMMAND"):
        return message
    for word in given:
        name = word.partition("=")[0]
        if name.startswith("--") and not any(option.startswith(name) for option in options):
            return f"unrecognized arguments: {word}"
    return message
