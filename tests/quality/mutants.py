"""Mutants of a module: its source with one operator, number, decorator or call changed.

Cosmic Ray's operators make them, those aside that `pyproject.toml` excludes, and one operator of
our own: functions of arrays swapped for their opposites. What differs in annotations only, which
nothing evaluates, and what is no Python are no mutants; of equal ones there is one.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import ndiff
from pathlib import Path

import cosmic_ray.plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Example, Operator
from parso.python.tree import Name
from parso.tree import NodeOrLeaf

ROOT = Path(__file__).resolve().parents[2]
OPPOSITES = (("any", "all"), ("min", "max"), ("argmin", "argmax"), ("minimum", "maximum"))
SWAPPED = {a: b for pair in OPPOSITES for a, b in (pair, pair[::-1])}


@dataclass(frozen=True)
class Mutant:
    """A changed module.

    Attributes
    ----------
    module : str
        Dotted.
    operator : str
        What made it.
    line : int
        The first line that is changed, from 1.
    before, after : str
        The changed lines, without indentation.
    source : str
        The whole text.
    """

    module: str
    operator: str
    line: int
    before: str
    after: str
    source: str


class SwapForOpposite(Operator):
    """Swap a function of arrays for its opposite, wherever it is called."""

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[tuple[object, object]]:
        """Yield where a call of such a function stands."""
        if isinstance(node, Name) and node.value in SWAPPED and node.get_next_leaf().value == "(":
            yield node.start_pos, node.end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        """Return the name of the other one."""
        node.value = SWAPPED[node.value]
        return node

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """Return an example."""
        return (Example("x.any()", "x.all()"),)


def path_of(module: str) -> Path:
    """Return the file of a module."""
    return ROOT / Path(*module.split(".")).with_suffix(".py")


def operators() -> dict[str, Operator]:
    """Return the operators that need no arguments and are not excluded, by name."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    filters = settings["tool"]["cosmic-ray"]["filters"]
    excluded = re.compile("|".join(filters["operators-filter"]["exclude-operators"]))
    out = {"SwapForOpposite": SwapForOpposite()}
    for name in sorted(cosmic_ray.plugins.operator_names()):
        found = cosmic_ray.plugins.get_operator(name)
        if not found.arguments() and not excluded.match(name):
            out[name.removeprefix("core/")] = found()
    return out


def meaning(source: str) -> str | None:
    """Return what Python makes of a text, annotations aside, or None if that is nothing."""
    try:
        tree = ast.parse(source)
    except SyntaxError:
        return None
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        if isinstance(node, ast.arg):
            node.annotation = None
        if isinstance(node, ast.arguments):  # the star before keywords is no product
            node.args = [*node.posonlyargs, *node.args, *node.kwonlyargs]
            node.defaults = [*node.defaults, *filter(None, node.kw_defaults)]
            node.posonlyargs, node.kwonlyargs, node.kw_defaults = [], [], []
        if isinstance(node, ast.AnnAssign):
            node.annotation = ast.Constant(None)
    return ast.dump(tree)


def changed(source: str, other: str) -> tuple[int, str, str]:
    """Return the first line in which texts differ, and the lines of each that do."""
    lines, rows = source.splitlines(), other.splitlines()
    first = next(i for i, pair in enumerate(zip(lines, rows, strict=False)) if pair[0] != pair[1])
    marked = [line for line in ndiff(lines, rows) if line[0] in "-+"]
    before, after = (
        " ".join(line[2:].strip() for line in marked if line[0] == sign) for sign in "-+"
    )
    return first + 1, before, after


def mutants(module: str) -> Iterator[Mutant]:
    """Yield all mutants of a module, line by line."""
    source = path_of(module).read_text(encoding="utf-8")
    tree, known, found = get_ast(source), {meaning(source), None}, []
    for name, operator in operators().items():
        count = sum(len(list(operator.mutation_positions(node))) for node in ast_nodes(tree))
        for occurrence in range(count):
            text = mutate_code(source, operator, occurrence)
            new = meaning(text)
            if new not in known:
                known.add(new)
                found.append(Mutant(module, name, *changed(source, text), text))
    yield from sorted(found, key=lambda mutant: mutant.line)
