"""Examples in docstrings run and print what they say."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import seqopt

PAGES = ("scene", "network", "contact", "engines", "stability")  # rooms whose page is a workflow
DOOR = "import seqopt\n"  # an example that goes through the package's own door needs it


def module_names() -> list[str]:
    """Return every module of the package; none would make the checks below pass without a word."""
    found = [m.name for m in pkgutil.walk_packages(seqopt.__path__, "seqopt.")]
    found = ["seqopt", *(name for name in found if not name.endswith("__main__"))]
    assert len(found) > 50
    return found


def examples(name: str) -> list[doctest.DocTest]:
    """Return the tests of a module that have examples."""
    module = importlib.import_module(name)
    return [test for test in doctest.DocTestFinder().find(module, name) if test.examples]


def failures(test: doctest.DocTest) -> int:
    """Return how many examples of a test print something else, what they print being shown."""
    if any(e.source == DOOR for e in test.examples) and not hasattr(seqopt, "load_scene"):
        pytest.skip("the package has no door yet")
    return doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test).failed


@pytest.mark.parametrize("name", module_names())
def test_examples_print_what_they_say(name):
    for test in examples(name):
        assert failures(test) == 0, test.name


@pytest.mark.parametrize("page", PAGES)
def test_a_room_shows_its_workflow(page):
    module = importlib.import_module(f"seqopt.{page}")
    own = doctest.DocTestFinder(recurse=False).find(module)
    assert sum(len(test.examples) for test in own) > 0
    assert module.__doc__.splitlines()[0].endswith(".")
    assert all(hasattr(module, name) for name in module.__all__)


def test_an_example_that_prints_something_else_is_seen(capsys):
    wrong = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "wrong", None, 0)
    assert failures(wrong) == 1
    assert "Expected" in capsys.readouterr().out
