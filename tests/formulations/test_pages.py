"""Formulations made after the page on writing one pass the tests that it recommends."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from tests.builders import ROOT

PAGE = "tutorials/adding_formulation.md"
TESTS = [f"tests/formulations/test_{name}.py" for name in ("conformance", "degenerate")]


def blocks(page, kind):
    """The texts of code blocks on a page of the documentation."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"```{re.escape(kind)}\n(.*?)```", text, re.DOTALL)


def installed(folder):
    """Write a package with the formulations of the pages as if it were installed."""
    restarts = [*blocks(PAGE, "{code-cell}")[:2], "FORMULATION = RESTARTS\n"]
    for name, text in (("first", blocks(PAGE, "python")[0]), ("restarts", "\n".join(restarts))):
        (folder / f"page_{name}.py").write_text(text, encoding="utf-8")
    about = folder / "pages-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: pages\nVersion: 1\n")
    entries = "first = page_first:FORMULATION\nrestarts = page_restarts:FORMULATION\n"
    (about / "entry_points.txt").write_text(f"[seqopt.formulations]\n{entries}")


@pytest.mark.slow
def test_formulations_of_the_pages_pass_what_is_recommended(tmp_path):
    installed(tmp_path)
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
    found = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        [sys.executable, *words, "-k", "first or restarts", *TESTS],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": found},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert re.search(r"\b[1-9]\d* passed", done.stdout)
