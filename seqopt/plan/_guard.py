"""How formulations are called: what judges them stays as it was, and nonsense is a failure.

One rule for all formulations: what the judge uses has a checksum, before a formulation is called
and after. Arrays that it unlocks and attributes that it sets are seen by it.
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
from seqopt.graph.formulation import Formulation, formulations
from seqopt.graph.graph import LabelProof
from seqopt.graph.layers.costs import Budget
from seqopt.graph.solution import Solution
from seqopt.scene._checks import LARGEST_NUMBER, short

Result = TypeVar("Result")


def called(
    name: str, judged: Callable[[], object], kind: type[Result], solve: Callable[[], object]
) -> Result:
    """Return the answer, of a kind, of a formulation by name, which ``solve`` calls.

    ``judged``: returns what its answer is judged by. Raises `SolverError` if the formulation raises
    anything but an error of seqopt or an interrupt, returns something else, or changes what it is
    judged by, also where it fails.
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
    """Say that a formulation, by name, failed where what it returned cannot be read."""
    try:
        yield
    except (TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise SolverError(f"formulation {name} returned nonsense: {message_of(error)}") from error


def text(given: object) -> str:
    """Return a text if it is one; a `TypeError` says that it is none."""
    if not isinstance(given, str):
        raise TypeError(f"{type(given).__name__} where a text belongs")
    return given


def checksum(value: object) -> bytes:
    """Return a checksum of a value: of its arrays, numbers, texts and fields, and of its methods.

    Engines count as themselves, with the scene that they are for: what they keep may grow.
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
    """Return the fields of a value, and what its class and itself call under which names."""
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
    """Return the methods of a value's class that it has under the same names itself."""
    return [n for n in getattr(value, "__dict__", {}) if callable(getattr(type(value), n, None))]


CLOSE = 1e-6  # over a value: how far a bound may be above it by rounding


def with_numbers(name: str, found: Solution, goals: int) -> Solution:
    """Return the answer of a formulation by name with numbers where numbers belong.

    Raises `SolverError` if a number is none, or there are not as many as goals.
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
    """Return a whole number that an array of these can hold."""
    number = operator.index(given)  # type: ignore[arg-type]  # raises what `readable` tells
    if abs(number) > LARGEST_NUMBER:
        raise ValueError(f"{short(number)} stands for no node or brick")
    return number


def _wholes(given: object) -> Ints:
    """Return rows of whole numbers."""
    out = np.asarray(given)
    whole = out.dtype.kind in "iuf" and out.ndim == 2
    if not whole or not ((np.abs(out) <= LARGEST_NUMBER) & (out % 1 == 0)).all():
        raise ValueError(f"{out.dtype} of shape {out.shape} where rows of whole numbers belong")
    return out.astype(np.int64)


def _motion(given: Floats) -> Floats:
    """Return the motion of some bricks as numbers."""
    out = np.array(given, dtype=float)
    if out.ndim != 2 or out.shape[1] != 6 or not len(out):
        raise ValueError(f"a motion of shape {out.shape}")
    return out


def require_fit(
    budgets: Sequence[Budget], formulation: Formulation, options: Mapping[str, object]
) -> None:
    """Raise a `ProblemError` unless a formulation takes budgets, if any, and has given options."""
    if budgets and not formulation.takes_budgets:
        able = [name for name, other in formulations("costs").items() if other.takes_budgets]
        raise ProblemError(
            f"{formulation.name}: the budget {budgets[0].name!r} couples all moves; "
            f"use {' or '.join(able)}"
        )
    formulation.require_options(options)


def require_time(formulation: Formulation, time_limit: float) -> None:
    """Raise a `ProblemError` unless a time limit, s, is one, and the formulation can keep it."""
    if not isinstance(time_limit, Real) or not time_limit >= 0:
        raise ProblemError(f"time_limit is {short(time_limit)}; give seconds from 0")
    limited = formulation.watched or "seconds" in formulation.options
    if np.isfinite(time_limit) and not limited:
        raise ProblemError(f"{formulation.name} takes no time limit; leave it out")


def require_proof(proof: object) -> None:
    """Raise a `ProblemError` where a lazy search is to leave out the proof, all it is for."""
    if not proof:
        raise ProblemError("a lazy search proves what it finds; leave out lazy, or ask for a proof")
