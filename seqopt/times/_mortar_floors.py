"""How long states of a build wait at least for mortar that cures, as its judge finds it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.mortar import Curing
from seqopt.judge._proof import Rebuilt
from seqopt.judge._states import StateEvaluator
from seqopt.network.network import Network
from seqopt.problem.standing import Standing
from seqopt.times._curing import JointsInTime
from seqopt.times._fall_cuts import CuringStates, FallCuts

Grips = tuple[Ints, Floats]
CLOSE = 1e-9  # of a time: what rounding may take from an age


class Floors:
    """Lower bounds of waits for mortar, by motions in which states fall; each is checked.

    ``motions``: that are claimed, (b, 6) in m and rad.
    """

    def __init__(self, network: Network, standing: Standing, motions: Sequence[Floats]) -> None:
        curing = standing.curing or Curing()
        joints = JointsInTime(network, curing)
        self._cuts = FallCuts(network, standing.mortar, joints)
        for motion in motions:
            if len(motion) <= len(network.inner):
                self._cuts.add(motion)
        self._brick, self._points = joints.closing, [curing.points_of(n) for n in joints.names]
        ages = np.array([points[-1][0] if points else 0.0 for points in self._points])
        self.full = np.zeros(len(network.inner))  # age at which all joints of a brick are cured, s
        np.maximum.at(self.full, self._brick, ages)

    def starts(self, bricks: int, grips: Grips, placed: Floats, start: Floats) -> Floats:
        """Return from when on, no sooner than times (k,), s, states are not proven to fall.

        ``grips``: nodes held, ascending, as places in build order from 1, and largest forces, N,
        (k, r); ``placed`` (k, b): when bricks were in their places, infinite for the one that is
        placed. Result: infinite where no wait is enough.
        """
        out = start.copy()
        rows = np.flatnonzero(self._falls(bricks, grips, placed, out))
        while len(rows):
            out[rows] = self._next(bricks, placed[rows], out[rows])
            rows = rows[np.isfinite(out[rows])]
            own = grips[0][rows], grips[1][rows]
            rows = rows[self._falls(bricks, own, placed[rows], out[rows])]
        return out

    def _joints(self, bricks: int) -> list[int]:
        return [j for j, brick in enumerate(self._brick.tolist()) if brick < bricks]

    def _falls(self, bricks: int, grips: Grips, placed: Floats, now: Floats) -> Bools:
        bond = np.zeros((len(now), len(self._joints(bricks))))
        for j in self._joints(bricks):
            age = np.maximum(now - placed[:, self._brick[j]], 0.0) + CLOSE * np.abs(now)
            for at, share in self._points[j]:
                bond[age >= at, j] = share
        return self._cuts.fall(bricks, grips, bond)

    def _next(self, bricks: int, placed: Floats, now: Floats) -> Floats:
        """Return when the next joint has more of its bond, (k,), s."""
        out = np.full(len(now), np.inf)
        for j in self._joints(bricks):
            for at, _ in self._points[j]:
                then = placed[:, self._brick[j]] + at
                later = then > now + 2 * CLOSE * np.abs(now)
                out = np.where(later & (then < out), then, out)
        return out


def cured_rows(
    evaluator: StateEvaluator, rebuilt: Rebuilt, motions: Sequence[Floats]
) -> CuringStates | None:
    """Return the bond that rebuilt states need; None where no mortar cures.

    ``motions``: that are claimed, (b, 6) in m and rad.
    """
    problem = evaluator.problem
    standing, begin = problem.standing, problem.rules.begin
    if standing is None or standing.curing is None:
        return None
    bricks = np.array(
        [evaluator.tables.bricks_at(level) if level else 0 for level in rebuilt.parts]
    )
    grips = [evaluator.held_to_stand(rows) for rows in rebuilt.states]
    held, payload = (np.concatenate([each[k] for each in grips]) for k in (0, 1))
    floors = Floors(problem.network, standing, motions)
    placed = np.zeros(len(floors.full))
    for k, age in enumerate(() if begin is None else begin.ages):
        placed[k] = -age
    return CuringStates(floors, bricks[rebuilt.part_of()], held, payload, floors.full, placed)
