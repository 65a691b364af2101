"""Safe calls of formulations: the judge's data stay unchanged, malformed answers are failures.

One rule for all formulations: the judge's data have the same checksum before and after the call,
which detects writes to unlocked arrays and attributes that were set.
"""

from __future__ import annotations

import hashlib
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cached_property, partial
from numbers import Real
from typing import Any, TypeVar

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import ProblemError, SeqoptError, SolverError, message_of
from seqopt.graph.decision_costs import Budget
from seqopt.graph.formulation import Formulation, Solution, formulations
from seqopt.graph.graph import LabelProof
from seqopt.problem.problem import AskedBudget
from seqopt.scene._checks import LARGEST_NUMBER, short

Result = TypeVar("Result")


def called(
    name: str, judged: Callable[[], object], kind: type[Result], solve: Callable[[], object]
) -> Result:
    """Call ``solve`` of the formulation ``name`` and return its answer, of type ``kind``.

    ``judged``: returns the data of the judge. Raises `SolverError` if the formulation raises
    anything but an error of seqopt or an interrupt, returns another type, or changes these data,
    even where it fails.
    """
    before = checksum(judged())
    try:
        found = solve()
    except (SeqoptError, MemoryError, KeyboardInterrupt):
        raise
    except BaseException as error:  # whatever a formulation of others may raise, exits too
        raise SolverError(f"formulation {name} failed: {message_of(error)}") from error
    finally:
        if checksum(judged()) != before:
            raise SolverError(
                f"formulation {name} changed the problem that it is judged by; make it use copies"
            )
    if not isinstance(found, kind):
        raise SolverError(
            f"formulation {name} returned a {type(found).__name__}, not a {kind.__name__}"
        )
    return found


@contextmanager
def readable(name: str) -> Iterator[None]:
    """Raise a `SolverError` for errors of reading the answer of the formulation ``name``."""
    try:
        yield
    except (TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise SolverError(f"formulation {name} returned nonsense: {message_of(error)}") from error


def text(given: object) -> str:
    """Return a string unchanged; raise a `TypeError` for any other type."""
    if not isinstance(given, str):
        raise TypeError(f"{type(given).__name__} where a text belongs")
    return given


def checksum(value: object) -> bytes:
    """Return a 16-byte checksum of the arrays, numbers, strings, fields and methods of a value.

    Engines count by identity, with their scene: their caches may grow.
    """
    digest = hashlib.blake2b(digest_size=16)
    _add(digest, value)
    return digest.digest()


def _add(digest: Any, value: object) -> None:
    digest.update(type(value).__qualname__.encode())
    if isinstance(value, np.ndarray):
        some = value if any(value.strides) or not value.size else value.flat[:1]
        digest.update(repr((value.dtype.str, value.shape)).encode())
        digest.update(np.ascontiguousarray(some).view(np.uint8))
    elif isinstance(value, str | bytes | int | float | complex | Enum | None):
        digest.update(repr(value).encode())
    elif isinstance(value, Mapping):
        _add(digest, [*value.items()])
    elif isinstance(value, tuple | list | set | frozenset):
        for part in value if isinstance(value, tuple | list) else sorted(value, key=repr):
            _add(digest, part)
        digest.update(b"end")
    elif hasattr(value, "network") and not is_dataclass(value):
        digest.update(str(id(value)).encode())
        _add(digest, [_shadowing(value), value.network.scene])
    elif callable(value) and not is_dataclass(value):
        digest.update(str(id(value)).encode())
    else:
        _add(digest, _parts(value))


def _parts(value: object) -> list[object]:
    """Return the fields of a value, the methods of its class, and attributes that shadow them."""
    methods = [(name, id(thing)) for k in type(value).__mro__ for name, thing in vars(k).items()]
    held = getattr(value, "__dict__", {})
    if is_dataclass(value):
        own = {f.name for f in fields(value)}
    else:
        own = {n for n in held if not isinstance(getattr(type(value), n, None), cached_property)}
    return [
        [pair for pair in methods if not pair[0].startswith("__")],
        [name for name in _shadowing(value) if name not in own],
        *(getattr(value, name) for name in sorted(own)),
    ]


def _shadowing(value: object) -> list[str]:
    """Return names of instance attributes that shadow methods of the class."""
    return [n for n in getattr(value, "__dict__", {}) if callable(getattr(type(value), n, None))]


CLOSE = 1e-6  # over a value: how far a bound may be above it by rounding


def with_numbers(name: str, found: Solution, goals: int) -> Solution:
    """Return the answer of the formulation ``name`` with all entries converted to numbers.

    Raises `SolverError` if one cannot be converted, or values and bounds are not one per goal.
    """
    with readable(name):
        states = tuple(tuple(map(_whole, state)) for state in found.states)
        objective, bound = (tuple(map(float, part)) for part in (found.objective, found.bound))
        if not len(objective) == len(bound) == goals or not states:
            raise ValueError(
                f"{len(states)} states, {len(objective)} values and {len(bound)} bounds for "
                f"{goals} goals"
            )
        if not all(b <= v + CLOSE * abs(v) for v, b in zip(objective, bound, strict=True)):
            raise ValueError("a value or bound is NaN, or a bound is above its value")
        visited = tuple(map(_wholes, found.visited))
        prices = tuple(tuple(map(float, each)) for each in found.prices)
        grips = tuple(tuple(map(_whole, row)) for row in found.grips)
        proofs = tuple(
            LabelProof(_wholes(rows), np.array(labels, dtype=float), np.array(own, dtype=float))
            for rows, labels, own in found.proofs
        )
        starts, motions = tuple(map(float, found.starts)), tuple(map(_motion, found.motions))
        timed = starts, float(found.ends), motions
        told = (visited, prices, text(found.stopped), grips, proofs, *timed)
        seconds = float(found.compile_seconds)
        if not 0 <= seconds < np.inf:
            raise ValueError(f"compile_seconds is {seconds}")
        order = tuple(map(_whole, found.order))
        sets, models = map(_whole, found.effort)
        own = partial(Solution, compile_seconds=seconds, order=order, effort=(sets, models))
        return own(states, objective, bound, *told)


def _whole(given: object) -> int:
    """Return an integer within the range of int64; raise a `ValueError` otherwise."""
    number = operator.index(given)  # type: ignore[arg-type]  # raises what `readable` tells
    if abs(number) > LARGEST_NUMBER:
        raise ValueError(f"{short(number)} stands for no node or brick")
    return number


def _wholes(given: object) -> Ints:
    """Return an integer array of rows; raise a `ValueError` if an entry is no integer."""
    out = np.asarray(given)
    whole = out.dtype.kind in "iuf" and out.ndim == 2
    if not whole or not ((np.abs(out) <= LARGEST_NUMBER) & (out % 1 == 0)).all():
        raise ValueError(f"{out.dtype} of shape {out.shape} where rows of whole numbers belong")
    return out.astype(np.int64)


def _motion(given: Floats) -> Floats:
    """Return twists (n, 6) of bricks as a float array; raise a `ValueError` for other shapes."""
    out = np.array(given, dtype=float)
    if out.ndim != 2 or out.shape[1] != 6 or not len(out):
        raise ValueError(f"a motion of shape {out.shape}")
    return out


def require_fit(
    budgets: Sequence[Budget | AskedBudget], formulation: Formulation, options: Mapping[str, object]
) -> None:
    """Raise a `ProblemError` unless a formulation supports the budgets and options given."""
    if budgets and not formulation.takes_budgets:
        able = [name for name, other in formulations("costs").items() if other.takes_budgets]
        raise ProblemError(
            f"{formulation.name}: the budget {budgets[0].name!r} couples all moves; "
            f"use {' or '.join(able)}"
        )
    formulation.require_options(options)


def require_time(formulation: Formulation, time_limit: float) -> None:
    """Raise a `ProblemError` unless a time limit is a number from 0, s, and is supported."""
    if not isinstance(time_limit, Real) or not time_limit >= 0:
        raise ProblemError(f"time_limit is {short(time_limit)}; give seconds from 0")
    limited = formulation.watched or "seconds" in formulation.options
    if np.isfinite(time_limit) and not limited:
        raise ProblemError(f"{formulation.name} takes no time limit; leave it out")


def require_proof(proof: object) -> None:
    """Raise a `ProblemError` if a lazy search, which solves models for its proof, has none."""
    if not proof:
        raise ProblemError("a lazy search proves what it finds; leave out lazy, or ask for a proof")
