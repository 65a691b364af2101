"""The formulation on the page on writing one is short, and passes what the page recommends."""

import ast
import os
import re
import subprocess
import sys

import pytest

from tests.builders import ROOT, install

PAGE = "tutorials/adding_formulation.md"
TESTS = [f"tests/formulations/test_{name}.py" for name in ("conformance", "degenerate")]


def blocks(page, kind):
    """The texts of code blocks on a page of the documentation."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"```{re.escape(kind)}\n(.*?)```", text, re.DOTALL)


def written():
    """The file that the page shows."""
    return blocks(PAGE, "{code-cell}")[0]


def test_a_formulation_takes_few_lines_and_one_import():
    """Its program and empty lines aside."""
    tree = ast.parse(written())
    of_text = range(tree.body[0].lineno, tree.body[0].end_lineno + 1)
    lines = [n for n, line in enumerate(written().splitlines(), 1) if line and n not in of_text]
    assert len(lines) <= 20
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [node.module for node in imports] == ["formulations.on_graph"]


@pytest.mark.slow
def test_the_formulation_of_the_page_passes_what_is_recommended(tmp_path):
    (tmp_path / "page_once.py").write_text(written(), encoding="utf-8")
    install(tmp_path, "seqopt.formulations", once="page_once:FORMULATION")
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
    found = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        [sys.executable, *words, "-k", "once", *TESTS],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": found},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert re.search(r"\b[1-9]\d* passed", done.stdout)
