"""Every example in a docstring prints what it shows; the door and the rooms' pages have one."""

from __future__ import annotations

import ast
import doctest
import inspect
import pkgutil
from importlib import import_module
from itertools import pairwise

import pytest

import seqopt

PAGES = ("sequence", "responses", "placement", "study", "report", "cli")
OTHER_ROOMS = {  # whose names at the door are documented elsewhere
    "Scene", "load_scene", "save_scene", "ArchShape", "arch_scene", "Network", "build_network",
    "Engine", "make_engine", "DRY", "EPOXY", "assess_steps", "Stability", "__version__",
}  # fmt: skip


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
WITH_EXAMPLES = [name for name in MODULES if examples(import_module(name))]


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_print_what_they_show(name):
    assert failures(examples(import_module(name))) == ""


@pytest.mark.parametrize("room", PAGES)
def test_a_room_opens_with_an_example(room):
    page = import_module(f"seqopt.{room}")
    assert ">>> " in page.__doc__
    assert "\n\n" in page.__doc__  # one line on what it is for, then the rest
    assert all(hasattr(page, name) for name in page.__all__)
    assert len(page.__all__) <= 8


@pytest.mark.parametrize("name", sorted({*seqopt.__all__} - OTHER_ROOMS))
def test_a_name_at_the_door_has_an_example(name):
    thing = getattr(seqopt, name)
    home = import_module(f"seqopt.{seqopt._HOME_OF[name]}")
    text = constant_docs(home).get(name) or inspect.getdoc(thing)
    section = text.partition("Examples\n--------\n")[2]
    assert section.startswith(">>> import ")
    assert ">>> import seqopt" in section


def test_a_wrong_example_is_seen():
    parser = doctest.DocTestParser()
    wrong = parser.get_doctest(">>> 1 + 1\n3\n", {}, "wrong", None, 0)
    assert "Expected:\n    3\nGot:\n    2" in failures([wrong])
    assert len(WITH_EXAMPLES) > 15
    assert "CRITERIA" in [test.name for test in examples(import_module("seqopt.study.presets"))]
