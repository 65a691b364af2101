"""Changes of a module that no test notices: one operator, number, call or statement at a time.

Command: ``python -m tests.quality.mutants MODULE TESTS... [--most N]``, for example
``python -m tests.quality.mutants seqopt.problem.criteria tests/problem``. It lists every change
that the tests do not notice: add a test of what is promised, or delete what nobody needs. Of more
changes than ``--most`` as many are drawn, by a fixed seed. The exit status is 1 if a control fails:
the module as it is must pass, and with a line that raises must not.

Nothing is written: Python gets the changed text where it asks for the module. Every change has a
process of its own, forked from one that has imported the libraries and nothing of ours; a process
that takes too much time or memory is ended, which counts as noticed.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import multiprocessing
import os
import resource
import sys
import warnings
import zlib
from collections.abc import Iterator, Sequence
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("scipy.sparse.linalg", "scipy.stats", "pandas", "networkx", "jsonschema", "highspy")
SECONDS, BYTES = 60, 4 * 2**30  # of processor time and memory, for the tests of a change
PASSED, UNSEEN = 0, 77
COMPARED: dict[type, type] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
JOINED: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.MatMult: ast.Sub,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
OPPOSITES = (("any", "all"), ("min", "max"), ("argmin", "argmax"), ("minimum", "maximum"))
SWAPPED = {a: b for pair in OPPOSITES for a, b in (pair, pair[::-1])}


class Mutant(NamedTuple):
    """A changed text: the first line that is changed, from 1, what stood there and stands there."""

    line: int
    before: str
    after: str
    text: str


def _change(node: ast.AST) -> str | None:
    """Return what stands in place of a node; None if it stays."""
    new: ast.AST | str | None = None
    match node:
        case ast.Compare(left, [first, *more], others) if type(first) in COMPARED:
            new = ast.Compare(left, [COMPARED[type(first)](), *more], others)
        case ast.BinOp(left, sign, right) if type(sign) in JOINED and not _is_text(left):
            new = ast.BinOp(left, JOINED[type(sign)](), right)
        case ast.BoolOp(sign, parts):
            new = ast.BoolOp(JOINED[type(sign)](), parts)
        case ast.UnaryOp(ast.Not() | ast.USub(), inner) if not isinstance(inner, ast.Constant):
            new = inner
        case ast.Constant(value) if type(value) in (int, float):
            new = repr(2 * value + 1)
        case ast.Call(ast.Name(name)) if name in SWAPPED:
            new = ast.Call(ast.Name(SWAPPED[name]), node.args, node.keywords)
        case ast.Call(ast.Attribute(value, name)) if name in SWAPPED:
            new = ast.Call(ast.Attribute(value, SWAPPED[name]), node.args, node.keywords)
        case ast.Return(value) if value is not None and not isinstance(value, ast.Constant):
            new = "return None"
        case ast.Raise() | ast.AugAssign() | ast.Expr(ast.Call()):
            new = "pass"
    return f"({ast.unparse(new)})" if isinstance(new, ast.AST) else new


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr | ast.Constant) and not isinstance(
        getattr(node, "value", ""), int | float
    )


def mutants(source: str) -> Iterator[Mutant]:
    """Yield all changes of a text, line by line; annotations say nothing that is evaluated."""
    tree, lines = ast.parse(source), [line.encode() for line in source.splitlines(keepends=True)]
    owners = ((n, name) for n in ast.walk(tree) for name in ("annotation", "returns"))
    parts = (getattr(node, name, None) for node, name in owners)
    passed = {id(n) for part in parts if isinstance(part, ast.AST) for n in ast.walk(part)}
    places = (
        n for n in ast.walk(tree) if isinstance(n, ast.expr | ast.stmt) and id(n) not in passed
    )
    for node in sorted(places, key=lambda n: (n.lineno, n.col_offset)):
        new, last = _change(node), (node.end_lineno or node.lineno) - 1
        if new is not None:
            head = lines[node.lineno - 1][: node.col_offset]
            tail = lines[last][node.end_col_offset :]
            whole = [*lines[: node.lineno - 1], head, new.encode(), tail, *lines[last + 1 :]]
            before = ast.get_source_segment(source, node) or ""
            yield Mutant(node.lineno, before, new, b"".join(whole).decode())


class _Mutated(MetaPathFinder, InspectLoader):
    """Finds one module, with a text that is not that of its file."""

    def __init__(self, module: str, text: str) -> None:
        self.module, self.text, self.seen = module, text, False

    def find_spec(self, fullname: str, path: object, target: object = None) -> ModuleSpec | None:
        own = fullname == self.module
        return spec_from_file_location(fullname, path_of(fullname), loader=self) if own else None

    def get_source(self, fullname: str) -> str:
        self.seen = True
        return self.text

    def is_package(self, fullname: str) -> bool:
        return False


def path_of(module: str) -> Path:
    """Return the file of a module."""
    return ROOT / Path(*module.split(".")).with_suffix(".py")


def passes(module: str, text: str, tests: Sequence[str], seconds: int = SECONDS) -> bool:
    """Return whether tests pass with a text of a module; `RuntimeError` if none imports it."""
    context = multiprocessing.get_context("fork")
    process = context.Process(target=_run, args=(module, text, tests, seconds))
    with warnings.catch_warnings():  # of threads that libraries have started: ours are done
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    process.join(20 * seconds)
    if process.is_alive():
        process.kill()
    process.join()
    if process.exitcode == UNSEEN:
        raise RuntimeError(f"no test imports {module}")
    return process.exitcode == PASSED


def _run(module: str, text: str, tests: Sequence[str], seconds: int) -> None:
    """Run tests and end this process with their status."""
    os.chdir(ROOT)
    with Path(os.devnull).open("w", encoding="utf-8") as nothing:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(nothing.fileno(), stream.fileno())
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    sys.dont_write_bytecode = True
    finder = _Mutated(module, text)
    sys.meta_path.insert(0, finder)
    early = "ignore:Module already imported:pytest.PytestAssertRewriteWarning"
    words = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:faulthandler", "-W", early]
    status = pytest.main([*words, "-m", "not slow", *tests])
    seen = finder.seen and status != pytest.ExitCode.NO_TESTS_COLLECTED
    os._exit(int(status) if status or seen else UNSEEN)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what no test notices."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("module", help="dotted")
    parser.add_argument("tests", nargs="+", help="files or folders, from the root")
    parser.add_argument("--most", type=int, default=60, help="how many changes are tried")
    asked = parser.parse_args(arguments)
    for name in LIBRARIES:
        importlib.import_module(name)
    source = path_of(asked.module).read_text(encoding="utf-8")
    for text, wanted in ((source, True), (f"{source}\nraise RuntimeError\n", False)):
        if passes(asked.module, text, asked.tests, 10 * SECONDS) != wanted:
            print(f"a control fails: {asked.module} as it is must pass, and broken must not")
            return 1
    every = [*mutants(source)]
    rng = np.random.default_rng(zlib.crc32(asked.module.encode()))
    chosen = sorted(rng.permutation(len(every))[: asked.most].tolist())
    left = [every[i] for i in chosen if passes(asked.module, every[i].text, asked.tests)]
    for mutant in left:
        print(f"{asked.module}:{mutant.line}: {mutant.before}  ->  {mutant.after}")
    print(f"{len(chosen) - len(left)} of {len(chosen)} changes noticed ({len(every)} there are)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
