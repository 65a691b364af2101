"""Tolerances: the largest misplacement of grips within all limits.

All grips may be misplaced by the same distance, each in any direction. Forces and displacements are
linear in the misplacement: one solution per grip and direction gives the worst case.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter

import numpy as np
import pandas as pd

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Engine, OpeningEngine, Want, grip_columns, select_sets
from seqopt.engines.registry import USUAL, AutoEngine, Recipe, recipe_of
from seqopt.errors import ProblemError
from seqopt.network.network import Network
from seqopt.responses._worst_direction import proven_rates, worst_misplacement, worst_rates
from seqopt.responses.quantities import NO_TOLERANCE, TOLERANCE, length_text
from seqopt.responses.table import _Columns, _grips_of, _Held, _Key
from seqopt.sequence.steps import Step

_AT_ONCE = 4096  # grip sets that are solved together


def is_tolerance(name: str) -> bool:
    """Return whether a response is a tolerance, of payloads alone or also of limits."""
    return name == TOLERANCE or name.startswith(f"{TOLERANCE}[")


def values_text(values: Mapping[str, float]) -> str:
    """Format values of aims or responses by name: lengths with their units, else six digits."""
    lengths = {name for name in values if is_tolerance(name) or name == "D_max"}
    return ", ".join(
        f"{name} {length_text(value) if name in lengths else format(value, '.6g')}"
        for name, value in values.items()
    )


@dataclass(frozen=True)
class Allowed:
    """Limits of a tolerance besides the payloads of robots.

    ``tension`` of any edge, N; ``shift`` of any node, m.
    """

    tension: float = np.inf
    shift: float = np.inf

    @property
    def name(self) -> str:
        """Its name as a response: ``tolerance[T_max=900,D_max=1e-05]``."""
        said = (("T_max", self.tension), ("D_max", self.shift))
        words = [f"{name}={most!r}" for name, most in said if np.isfinite(most)]
        return f"{TOLERANCE}[{','.join(words)}]" if words else TOLERANCE


ROBOTS_ALONE = Allowed()


def allowed_by(name: str) -> Allowed:
    """Parse the limits in the name of a tolerance."""
    words = name[len(TOLERANCE) + 1 : -1].split(",") if name != TOLERANCE else []
    said = dict(word.split("=") for word in words)
    return Allowed(float(said.get("T_max", "inf")), float(said.get("D_max", "inf")))


@dataclass(frozen=True)
class Tolerance:
    """The tolerance of the grips of a step, and the limit that is reached first.

    Attributes
    ----------
    distance : float
        m; zero where something is too large with all grips in their places, infinite where grips
        change nothing.
    proven : float
        Up to which nothing is too large, m: at most a ten-thousandth below it, mostly a millionth.
    what : str
        What becomes too large first; empty if nothing does.
    misplacement : tuple of (float, float, float)
        Of every grip, in the order of the robots, the worst that is as far, m.
    """

    distance: float
    proven: float
    what: str = ""
    misplacement: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class _Group:
    """Responses of one kind, n for each of S grip sets, that are linear in misplacements."""

    what: str
    own: Floats  # (S, n, 3)
    change: Floats  # (S, n, r, 3, 3); by component, for a meter in each direction
    most: Floats  # (S, n)
    axial: bool = False  # only the first component is limited, and only upward

    def rates(self) -> tuple[Floats, Floats]:
        """Return their rates (S, n) and directions (S, n, 3)."""
        if not self.axial:
            found, direction = worst_rates(*self._flat)
            return found.reshape(self.most.shape), direction.reshape(self.own.shape)
        room = self.most - self.own[..., 0]
        added = np.linalg.norm(self.change[..., 0, :], axis=3).sum(axis=2)
        rate = np.where(room > 0, added / np.where(room > 0, room, 1.0), np.inf)
        return rate, np.broadcast_to([1.0, 0.0, 0.0], self.own.shape)

    @property
    def _flat(self) -> tuple[Floats, Floats, Floats]:
        shape = self.change.shape
        return self.own.reshape(-1, 3), self.change.reshape(-1, *shape[2:]), self.most.ravel()

    def proven(self, direction: Floats) -> float:
        """Return an upper bound of the rates of the one grip set."""
        if self.axial:
            return float(self.rates()[0].max())
        return float(proven_rates(*self._flat, direction.reshape(-1, 3))[1].max())


def _groups(
    engine: Engine, bricks: int, grips: Ints, payload: Floats, allowed: Allowed
) -> Iterator[_Group]:
    """Yield the limited responses of grip sets (S, r), of joints that never fail."""
    if isinstance(engine, OpeningEngine):
        raise ProblemError(
            f"tolerance: a {type(engine).__name__} is not linear in where grips are; take the "
            "engine compliance or auto"
        )
    engine = engine.rigid if isinstance(engine, AutoEngine) else engine
    wanted = Want.EDGES if np.isfinite(allowed.tension) else Want(0)
    wanted |= Want.DISPLACEMENTS if np.isfinite(allowed.shift) else Want(0)
    sets, held = grips.shape
    fields = engine.solve(bricks, grips, wanted)
    moved = np.zeros((sets, 3 * held, held, 3))
    moved.reshape(sets, 3 * held, 3 * held)[:] = np.eye(3 * held)
    again = np.repeat(np.arange(sets), 3 * held)
    off = engine.solve(bricks, grips[again], wanted, moved.reshape(-1, held, 3))
    dead = select_sets(fields, again)

    def changes(name: str) -> Floats:
        found = getattr(off, name) - getattr(dead, name)
        return np.asarray(found.reshape(sets, held, 3, *found.shape[1:]))

    def vectors(what: str, name: str, most: Floats) -> _Group:
        return _Group(what, getattr(fields, name), changes(name).transpose(0, 3, 1, 4, 2), most)

    yield vectors("payload", "grip_force", payload)
    if np.isfinite(allowed.tension):
        own, change = fields.edge_force, changes("edge_force").transpose(0, 3, 1, 2)
        most, first = np.full(own.shape, allowed.tension), np.array([1.0, 0.0, 0.0])
        parts = own[..., None] * first, change[..., None, :] * first[:, None]
        yield _Group("tension", *parts, most, axial=True)
    if np.isfinite(allowed.shift):
        most = np.full(fields.displacement.shape[:2], allowed.shift)
        yield vectors("displacement", "displacement", most)


def misfits(engine: Engine, bricks: int, grips: Ints, allowed: Allowed = ROBOTS_ALONE) -> Floats:
    """Return the reciprocals (S,) of the tolerances of grip sets, 1/m.

    `NO_TOLERANCE` if a limit is violated without misplacement, and if two rigid grips hold one
    brick, which any misplacement makes incompatible.

    ``grips`` (S, r): numbers, as of `seqopt.Scene.grip_numbers`.
    """
    held, payload = grips.shape[1], _payloads(engine.network, grips)
    if not bricks:  # the empty site: nobody holds
        return np.zeros(len(grips))
    out = np.where(_tied(engine, bricks, grips), NO_TOLERANCE, 0.0)
    rows = np.flatnonzero(out == 0) if held else np.arange(0)
    step = max(1, _AT_ONCE // (3 * held + 1))
    for start in range(0, len(rows), step):
        part = rows[start : start + step]
        groups = _groups(engine, bricks, grips[part], payload[part], allowed)
        out[part] = np.max([group.rates()[0].max(axis=1) for group in groups], axis=0)
    return np.asarray(np.minimum(out, NO_TOLERANCE))


def _payloads(network: Network, grips: Ints) -> Floats:
    """Return the payloads (S, r) of the robots of grip sets, N."""
    kinds = network.scene.grip_kinds
    return np.asarray(kinds.payload[kinds.split(grips)[1]])


def _tied(engine: Engine, bricks: int, grips: Ints) -> Bools:
    """Return which sets (S,) have two rigid grips on one brick."""
    kinds = engine.network.scene.grip_kinds
    brick = grip_columns(engine.network, bricks, grips) // 2
    apart = -1 - np.arange(grips.shape[1])  # soft grips are on no brick together
    brick = np.where(kinds.gives[kinds.split(grips)[1]], apart, brick)
    return np.asarray((np.diff(np.sort(brick, axis=1), axis=1) == 0).any(axis=1))


def step_tolerance(engine: Engine, step: Step, allowed: Allowed = ROBOTS_ALONE) -> Tolerance:
    """Return the tolerance of the grips of a step, with its proven lower bound."""
    scene = engine.network.scene
    pairs = zip(scene.robots, step.grips, strict=True)
    holding = [robot.name for robot, node in pairs if node is not None]
    props = scene.standing_props(step.bricks, held=bool(holding))
    holding += [prop.label for prop in props]
    grips = _grips_of(scene, step)
    if not holding:
        return Tolerance(np.inf, np.inf)
    if _tied(engine, step.bricks, grips)[0]:
        return Tolerance(0.0, 0.0, "two rigid grips on one brick")
    payload = _payloads(engine.network, grips)
    worst, rate, proven = Tolerance(np.inf, np.inf), 0.0, 0.0
    for group in _groups(engine, step.bricks, grips, payload, allowed):
        rates, direction = group.rates()
        proven = max(proven, group.proven(direction))
        at = int(rates[0].argmax())
        if rates[0, at] > rate:
            rate = float(rates[0, at])
            far = worst_misplacement(group.change[:, at], direction[:, at])[0] / rate
            what = f"payload of {holding[at]}" if group.what == "payload" else group.what
            worst = Tolerance(1 / rate, 0.0, what, tuple(map(tuple, far.tolist())))
    return replace(worst, proven=1 / proven if proven else np.inf)


def each_tolerance(
    engine: Engine, steps: Sequence[_Held], known: dict[_Key, float] | None = None
) -> Floats:
    """Return the tolerance of grips of every step, m.

    Steps of equal numbers of bricks and grips are solved as one batch, equal states once.
    ``known``: cache by bricks and grips, updated in place.
    """
    known = {} if known is None else known
    new = {(bricks, len(held), held) for _, bricks, held in steps if (bricks, held) not in known}
    for (bricks, count), same in groupby(sorted(new), key=itemgetter(0, 1)):
        sets = [held for *_, held in same]
        grips = np.array(sets, dtype=np.int64).reshape(len(sets), count)
        for held, misfit in zip(sets, misfits(engine, bricks, grips).tolist(), strict=True):
            off = np.inf if misfit == 0 else 0.0 if misfit >= NO_TOLERANCE else 1 / misfit
            known[bricks, held] = off
    return np.array([known[bricks, held] for _, bricks, held in steps], dtype=float)


_SOFTEST, _STIFFEST = 1e2, 1e12  # N/m, between which a stiffness is sought
_CLOSE = 1.01  # ratio of stiffnesses that are told apart


def stiffness_for(engine: Engine, steps: Sequence[Step], distance: float) -> float | None:
    """Return the largest stiffness of all grips, N/m, at which the tolerance is met.

    Found by bisection, so that not all stiffer grips are checked. Infinite if rigid grips meet it,
    None if no stiffness from `_SOFTEST` on does.
    """
    recipe, scene = recipe_of(engine) or Recipe(USUAL, engine.network.scene), engine.network.scene

    def enough(stiffness: float | None) -> bool:
        soft = scene.with_grips(stiffness)
        held = [(s.number, s.bricks, soft.grip_numbers(s.grips, s.bricks)) for s in steps]
        found = each_tolerance(recipe.make(soft), held)
        return bool(found.min(initial=np.inf) >= distance)

    if enough(None):
        return np.inf
    low, high = _SOFTEST, _STIFFEST
    if not enough(low):
        return None
    while high > _CLOSE * low:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if enough(middle) else (low, middle)
    return low


COLUMN = "tolerance_mm"


def tolerances_along(engine: Engine, steps: Sequence[Step], name: str = TOLERANCE) -> list[float]:
    """Return the tolerances of steps, mm, for a tolerance's name."""
    return [1e3 * step_tolerance(engine, step, allowed_by(name)).distance for step in steps]


def tolerance_table(engine: Engine, steps: Sequence[Step]) -> pd.DataFrame:
    """Return a row per step with the tolerance of its grips, mm, and the limit reached first."""
    found = [step_tolerance(engine, step) for step in steps]
    return pd.DataFrame(
        {
            "step": [step.number for step in steps],
            COLUMN: [1e3 * each.distance for each in found],
            "proven_mm": [1e3 * each.proven for each in found],
            "stops": [each.what for each in found],
        }
    )


def misfits_along(table: _Columns) -> Floats:
    """Return the reciprocals of the tolerances in a table of steps, 1/m."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.minimum(1e3 / np.asarray(table[COLUMN], dtype=float), NO_TOLERANCE))
