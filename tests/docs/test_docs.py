"""The documentation: built strictly, tutorials executed; the README's commands are real."""

from __future__ import annotations

import re
import subprocess
import sys

import pandas as pd
import pytest

from seqopt.cli.main import main
from seqopt.placement.formulation import exhibits, formulations
from tests.builders import ROOT


def build(source, target):
    """Build a site with warnings as errors."""
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    return subprocess.run([*command, source, target], capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_site_builds_strictly(tmp_path):
    done = build(ROOT / "docs", tmp_path / "html")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "html" / "tutorials" / "reference_arch.html").read_text(encoding="utf-8")
    assert "306.5" in page  # a number that only the executed tutorial prints


@pytest.mark.slow
@pytest.mark.parametrize("flaw", ["[lost](nowhere.md)", "```{code-cell}\nassert 1 == 2\n```"])
def test_a_flaw_fails_the_build(tmp_path, flaw):
    source = tmp_path / "docs"
    source.mkdir()
    (source / "conf.py").write_bytes((ROOT / "docs" / "conf.py").read_bytes())
    front = "---\nfile_format: mystnb\nkernelspec:\n  name: python3\n---\n"
    (source / "index.md").write_text(f"{front}# Page\n\n{flaw}\n", encoding="utf-8")
    assert build(source, tmp_path / "html").returncode != 0


def test_readme_shows_two_commands_that_exist(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = re.findall(r"```sh\n(.*?)\n```", text, flags=re.DOTALL)
    assert len(commands) >= 2
    assert commands[0].endswith("seqopt compare")
    assert commands[1].endswith("-m pytest -n auto")
    assert main(["compare"]) == 0
    assert "three-robot" in capsys.readouterr().out


def test_pictures_exist_and_no_number_is_missing():
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        if "_build" in page.parts:
            continue
        text = page.read_text(encoding="utf-8")
        assert "{{" not in text, page
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text):
            assert (page.parent / target).exists(), f"{page}: {target}"


def test_readme_python_runs(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(blocks) == 2
    exec(compile("".join(blocks), "README", "exec"), {})
    assert capsys.readouterr().out.startswith("(4, ")


def examples():
    """Python blocks of the documentation that are followed by the output they print."""
    pattern = re.compile(r"```python\n(.*?)```\n\n```text\n(.*?)```", flags=re.DOTALL)
    for page in sorted((ROOT / "docs").rglob("*.md")):
        for number, match in enumerate(pattern.finditer(page.read_text(encoding="utf-8"))):
            yield pytest.param(*match.groups(), id=f"{page.stem}-{number}")


@pytest.mark.parametrize(("code", "printed"), [*examples()])
def test_examples_print_what_they_show(code, printed, capsys):
    exec(compile(code, "example", "exec"), {})
    assert capsys.readouterr().out.strip() == printed.strip()


def test_exhibits_stand_on_the_page_that_compares_them():
    page = (ROOT / "docs" / "formulations" / "why.md").read_text(encoding="utf-8")
    stored = pd.read_csv(ROOT / "experiments" / "results" / "program_shapes.csv")
    assert {*exhibits(), "overlap_mip"} == {*stored["formulation"]}
    for row in stored.itertuples():
        line = next(text for text in page.splitlines() if text.startswith(f"| `{row.formulation}`"))
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        counts = (row.rows, row.columns, row.nonzeros, row.binaries)
        assert cells[1:5] == [f"{count:,}" for count in counts]
        assert float(cells[5]) == pytest.approx(row.relaxed, rel=1e-3, abs=1e-3)
        assert float(cells[6]) == pytest.approx(row.optimum, rel=1e-3)
        assert int(cells[7]) == row.nodes
        assert float(cells[8].split()[0]) == pytest.approx(row.seconds, rel=0.1)


def test_every_formulation_has_a_page_with_an_example():
    shown = {param.id.rsplit("-", 1)[0] for param in examples()}
    for name in formulations():
        page = (ROOT / "docs" / "formulations" / f"{name}.md").read_text(encoding="utf-8")
        for heading in ("Background", "Program", "Example", "When it fails"):
            assert f"## {heading}" in page, name
        assert name in shown
