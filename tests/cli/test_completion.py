"""Completion by the shells themselves: what the Tab key would offer."""

from __future__ import annotations

import shutil
import subprocess
from contextlib import redirect_stdout

import pytest

from seqopt._cli.main import main
from seqopt.graph.formulation import formulation_names

ASK = {
    "bash": """
source {script}
COMP_WORDS=({words} "{last}"); COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 ))
COMP_LINE="{words} {last}"; COMP_POINT=${{#COMP_LINE}}
_shtab_seqopt
printf "%s\\n" "${{COMPREPLY[@]}}"
""",
    "fish": """
source {script}
complete -C "{words} {last}" | string split -f1 \\t
""",
}


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    """The scripts that the program prints, by shell."""
    folder, found = tmp_path_factory.mktemp("completion"), {}
    for shell in ("bash", "zsh", "fish"):
        found[shell] = folder / f"seqopt.{shell}"
        with found[shell].open("w", encoding="utf-8") as file, redirect_stdout(file):
            assert main(["completion", shell]) == 0
    return found


def offered(shell, script, line, folder):
    """What a shell offers for a line that ends where the Tab key is pressed."""
    first, _, last = line.rpartition(" ")
    text = ASK[shell].format(script=script, words=first, last=last)
    command = [shutil.which(shell), "-c", text]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    assert done.stderr == ""
    return {word.strip() for word in done.stdout.splitlines()}


@pytest.mark.parametrize("shell", ["bash", "fish"])
@pytest.mark.parametrize(
    ("line", "want"),
    [
        ("seqopt op", {"optimize"}),
        ("seqopt optimize arch2", {"arch25"}),
        ("seqopt optimize --formulation overlap_d", {"overlap_dp"}),
        ("seqopt scene vau", {"vault338", "vault:"}),
        ("seqopt compare --engine qqq", set()),
    ],
)
def test_the_tab_key_offers_what_there_is(scripts, tmp_path, shell, line, want):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    assert offered(shell, scripts[shell], line, tmp_path) - {""} == want


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_script_has_all_names_and_is_one_its_shell_reads(scripts, shell):
    text = scripts[shell].read_text(encoding="utf-8")
    for name in (*formulation_names(), "three-robot", "worst-ratio", "dome163", "discrete"):
        assert name in text
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    done = subprocess.run([shell, "-n", scripts[shell]], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
