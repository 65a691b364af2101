"""Pages are true and whole: what they run, show, offer and refer to."""

import ast
import re
import subprocess
import sys

import pytest

from tests.builders import ROOT
from tests.docs.extensions import extension, stated
from tests.docs.site import broken
from tests.docs.transcripts import DOCS, PAGES, blocks, furnish, run

NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w])")
PICTURE = re.compile(r"!\[([^\]]*)\]\(([^)]+)\)")
SHOW = """
import runpy, sys
import matplotlib.pyplot as plt
counts = []
def show():
    counts.append(len(plt.get_fignums()))
    plt.close("all")
plt.show = show
runpy.run_path(sys.argv[1], run_name="__main__")
print("figures shown:", counts, "left:", len(plt.get_fignums()))
"""


RUN = ("own_format",)  # the same cells are executed when the site is built


def told():
    """Pages that can be downloaded, by name."""
    for path in sorted([*(DOCS / "tutorials").glob("*.md"), *(DOCS / "guides").glob("*.md")]):
        text = path.read_text(encoding="utf-8")
        if text.startswith("---\nfile_format: mystnb"):
            yield pytest.param(text, id=path.stem)


# commands that take as long as all others
LONG = ("--order search", "seqopt pareto arch25", "tolerance,minmax")


def shown(name, *, long):
    """Blocks of a page that take long, or all others, which need nothing of these."""
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    return [b for b in blocks(text) if any(word in b.code for word in LONG) == long]


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_pages_show_what_is_printed(name, tmp_path):
    check_printed(shown(name, long=False), tmp_path)


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in PAGES if shown(name, long=True)])
def test_pages_show_what_is_printed_after_a_while(name, tmp_path):
    check_printed(shown(name, long=True), tmp_path)


def check_printed(some, tmp_path):
    furnish(tmp_path)
    names = {}
    for block in some:
        printed, well = run(block, tmp_path, names)
        if block.printed is None:
            assert well, f"{block.code}\n{printed}"
        else:
            assert printed.strip() == block.printed.strip(), block.code


def unprinted(text):
    """Numbers in words, rounded as they are, that no command that is shown takes or prints."""
    found = [*blocks(text)]
    shown = " ".join([*(" ".join(b.commands) for b in found), *(b.printed or "" for b in found)])
    printed = [float(number) for number in NUMBER.findall(shown)]
    words = re.sub(r"`[^`]*`", " ", re.sub(r"```.*?```", " ", text, flags=re.DOTALL))
    return [
        number
        for number in NUMBER.findall(words)
        if not any(
            round(value, len(number.partition(".")[2])) == float(number) for value in printed
        )
    ]


def test_the_readmes_figures_stand_beside_the_command_that_prints_them():
    """What the commands print is compared above."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    told = text.partition("## A minute on the command line")[2].partition("## A minute in")[0]
    assert len(NUMBER.findall(told)) > 20
    assert unprinted(told) == []
    assert unprinted(told.replace("0.84 times", "0.75 times")) == ["0.75"]  # the control


@pytest.mark.slow
def test_a_wrong_output_is_seen(tmp_path):
    (block,) = blocks("```sh\nseqopt scene wall:columns=2,courses=1\n```\n\n```text\nwrong\n```\n")
    printed, well = run(block, tmp_path)
    assert well
    assert "2 bricks" in printed
    assert printed.strip() != block.printed.strip()


def test_images_have_words():
    for page in [ROOT / "README.md", *DOCS.rglob("*.md")]:
        for words, target in PICTURE.findall(page.read_text(encoding="utf-8")):
            assert len(words.split()) >= 3, f"{page.name}: {target} has the text {words!r}"


def scripted(text):
    """A page as a script."""
    downloads = extension("downloads")
    return downloads.script(downloads.notebook(text, stated()))


@pytest.mark.slow
@pytest.mark.parametrize("text", [*told()])
def test_downloads_are_plain_python_without_checks(text):
    script = scripted(text)
    ast.parse(script)
    assert "{{" not in script.replace("f'{{", "")
    assert not re.search(r"\]\((?!http)[^)]*\.md", script)
    assert 'pip install ".[' in script


@pytest.mark.slow
@pytest.mark.parametrize("text", [page for page in told() if page.id in RUN])
def test_downloads_run_and_show_their_figures(text, tmp_path):
    script = tmp_path / "seqopt_page.py"
    script.write_text(scripted(text), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", SHOW, script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    last = done.stdout.splitlines()[-1]
    assert last.endswith("left: 0"), last
    assert ("plt.subplots" in script.read_text(encoding="utf-8")) == ("shown: []" not in last)


def test_equations_become_mathml():
    equations = extension("equations")
    found = equations.mathml(r"\min_x \; & x \\ \text{s.t.} \; & x \ge 1", block=True)
    assert found.startswith("<math")
    assert found.count("<mtr>") == 2
    with pytest.raises(Exception, match="cannot become MathML"):
        equations.mathml(r"\frac{1}{", block=False)


def test_links_that_lead_nowhere_are_seen(tmp_path):
    (tmp_path / "a.html").write_text('<h1 id="x"></h1><a href="b.html#y"></a><a href="#x"></a>')
    (tmp_path / "b.html").write_text('<script src="https://cdn.example/x.js"></script>')
    (tmp_path / "c.html").write_text('<img alt="_images/x.png"><img alt="A wall of bricks">')
    assert broken(tmp_path) == [
        "a.html: b.html#y",
        "b.html: https://cdn.example/x.js",
        "c.html: image '_images/x.png'",
    ]
