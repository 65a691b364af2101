"""Every example in a docstring prints what it shows; the door and the rooms' pages have one."""

import ast
import doctest
import inspect
import pkgutil
from importlib import import_module
from itertools import pairwise

import pytest

import seqopt
from tests.builders import ROOT

pytestmark = pytest.mark.slow

ROOMS = sorted(page.parent.name for page in (ROOT / "seqopt").glob("[a-z]*/__init__.py"))


def examples(module):
    """Return the examples of a module, those below its constants included."""
    found = doctest.DocTestFinder(exclude_empty=True).find(module)
    parser = doctest.DocTestParser()
    for name, text in constant_docs(module).items():
        test = parser.get_doctest(text, vars(module).copy(), name, module.__file__, 0)
        found.append(test)
    return [test for test in found if test.examples]


def constant_docs(module):
    """Return the strings that stand below the assignments of a module, by name."""
    body = ast.parse(inspect.getsource(module)).body
    out = {}
    for assigned, below in pairwise(body):
        if not isinstance(assigned, ast.Assign | ast.AnnAssign):
            continue
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            targets = assigned.targets if isinstance(assigned, ast.Assign) else [assigned.target]
            out |= {target.id: inspect.cleandoc(below.value.value) for target in targets}
    return out


def failures(tests):
    """Return what examples print in place of what they show."""
    said = []
    runner = doctest.DocTestRunner(verbose=False)
    for test in tests:
        runner.run(test, out=said.append)
    return "".join(said)


MODULES = [
    "seqopt",
    *(m.name for m in pkgutil.walk_packages(seqopt.__path__, "seqopt.") if m.name[-2:] != "__"),
]
WITH_EXAMPLES = [name for name in MODULES if ">>> " in inspect.getsource(import_module(name))]


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_print_what_they_show(name):
    assert failures(examples(import_module(name))) == ""


def test_a_room_opens_with_an_example():
    for room in ROOMS:
        page = import_module(f"seqopt.{room}")
        assert ">>> " in page.__doc__, room
        assert "\n\n" in page.__doc__, room  # one line on what it is for, then the rest
        assert all(hasattr(page, name) for name in page.__all__), room
        assert len([name for name in page.__all__ if name[0].isupper()]) <= 8, room
        assert len(page.__all__) <= 10, room
        assert page.__all__ or room in ("cli", "times"), room  # whose pages say why


def test_a_name_at_the_door_has_an_example():
    for name in {*seqopt.__all__} - {"__version__"}:
        home = import_module(f"seqopt.{seqopt._HOME_OF[name]}")
        text = constant_docs(home).get(name) or inspect.getdoc(getattr(seqopt, name))
        assert ">>> " in text.partition("Examples\n--------\n")[2], name


def test_a_wrong_example_is_seen():
    parser = doctest.DocTestParser()
    wrong = parser.get_doctest(">>> 1 + 1\n3\n", {}, "wrong", None, 0)
    assert "Expected:\n    3\nGot:\n    2" in failures([wrong])
    assert len(WITH_EXAMPLES) > 15
    assert len(ROOMS) > 10
    assert "CRITERIA" in [test.name for test in examples(import_module("seqopt.study"))]
