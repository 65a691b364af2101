"""Which grip sets of a partial structure stand: many at a time, most without a solver.

A set stands if forces are found that hold it, and falls if a motion is found in which it falls:
either is checked by the structure's own data (`seqopt.stability._held_states`), with the friction
cone and the payloads as they are. What one set proves decides many others, so that a linear
program, whose cones are inscribed polyhedra, is solved for few of them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seqopt.arrays import Bools, Floats, Ints, Vector
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import Contacts
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.errors import GripError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.stability._held_states import CompileHeld, HeldStates, compile_held, node_assembly
from seqopt.stability._prover import DIRECTIONS, FINE, sideways
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import EXACT

STANDS, FALLS, OPEN = 1, -1, 0
_Level = tuple[int, int, bool]  # bricks, directions, and whether corners are around them all


class Screen:
    """Says which grip sets of the partial structures of a scene stand.

    Parameters
    ----------
    network : Network or Scene
    mortar : Mortar or str
        Of all joints; or its name.
    tilt : float, optional
        By which it must survive being tilted in every direction, rad: the sideways acceleration
        tan(tilt) g. A set stands if it does at corners around all of them, and falls if it does
        in one; what survives between 0.998 and 1 of that acceleration may stay open.
    compiled : callable, optional
        Makes the programs to solve; the registered one by default.

    Examples
    --------
    >>> import seqopt
    >>> screen = Screen(seqopt.load_scene("arch25"), seqopt.DRY)
    >>> screen.stands(5, [[10, 7], [10, 0]])  # 10th and 7th node in build order; one robot free
    array([ 1, -1], dtype=int8)
    """

    def __init__(
        self,
        network: Network | Scene,
        mortar: Mortar | str,
        tilt: float = 0.0,
        compiled: CompileHeld = compile_held,
    ) -> None:
        self.network, self.mortar = network_of(network), find_mortar(mortar)
        self.tilt = tilt
        self._compile, self._contacts = compiled, Contacts(self.network)
        self._levels: dict[_Level, tuple[HeldStates, ...]] = {}

    @property
    def solved(self) -> int:
        """How many linear programs were solved."""
        return sum(states.solved for level in self._levels.values() for states in level)

    def stands(
        self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None
    ) -> NDArray[np.int8]:
        """Return which grip sets stand.

        ``bricks``: how many bricks stand, in build order. ``held`` (S, r): nodes held, as places in
        build order counted from 1; zero for a robot that holds none. ``payload`` (r,), (S, r):
        largest force of those that hold them, N; by default of the scene's robots, if all have the
        same. Result (S,): 1 where it is proven that the structure stands, -1 where it is proven
        that it falls, and 0 where neither is. Raises `GripError` as `held_places` does.
        """
        places, loads = held_places(self.network, bricks, held, payload)
        out = self._verdicts((bricks, DIRECTIONS, True), places, loads)
        if not self.tilt:
            return out
        out[out != STANDS] = OPEN
        tries = (DIRECTIONS, False, FALLS), (FINE, True, STANDS), (FINE, False, FALLS)
        for count, around, sure in tries:
            rows = np.flatnonzero(out == OPEN)
            found = self._verdicts((bricks, count, around), places[rows], loads[rows])
            out[rows[found == sure]] = sure
        return out

    def _verdicts(self, level: _Level, places: Ints, loads: Floats) -> NDArray[np.int8]:
        """Return which sets stand in all directions of a level."""
        out = np.full(len(places), STANDS, dtype=np.int8)
        for states in self._level(level):
            rows = np.flatnonzero(out != FALLS)
            bracket = states.bracket(places[rows], loads[rows], _decided)
            fall, stand = bracket[:, 0] > EXACT, bracket[:, 1] <= EXACT
            out[rows[fall]] = FALLS
            out[rows[~fall & ~stand]] = OPEN
        return out

    def _level(self, level: _Level) -> tuple[HeldStates, ...]:
        if level not in self._levels:
            bricks, count, around = level
            upright = node_assembly(self.network, bricks, self._contacts)
            pull = np.tan(self.tilt) / (np.cos(np.pi / count) if around else 1.0)
            self._levels[level] = tuple(
                _lacking(assembly, self.mortar, self._compile)
                for assembly in _pulled(upright, pull, self.network.scene.up, count)
            )
        return self._levels[level]


def _lacking(assembly: Assembly, mortar: Mortar, compiled: CompileHeld) -> HeldStates:
    """Return the question whether a structure stands: whether it lacks any bond."""
    case = bonded(assembly, mortar)
    return HeldStates(assembly, case, compiled, case.fixed())


def _decided(bracket: Floats) -> Bools:
    """Return where brackets (S, 2) prove that no bond is lacking, or that some is."""
    return np.asarray((bracket[:, 1] <= EXACT) | (bracket[:, 0] > EXACT))


def _pulled(assembly: Assembly, pull: float, up: Vector, count: int) -> tuple[Assembly, ...]:
    """Return the assemblies to which sideways pulls, over gravity, turn one; itself for none."""
    if not pull:
        return (assembly,)
    weight = np.linalg.norm(assembly.weight, axis=1, keepdims=True)
    cases = sideways(bonded(assembly, Mortar(friction=0.0)), up, count)
    loads = [pull * weight * np.array(case.pull) for case in cases]
    return tuple(replace(assembly, weight=assembly.weight + load) for load in loads)


def held_places(
    network: Network, bricks: int, held: ArrayLike, payload: ArrayLike | None
) -> tuple[Ints, Floats]:
    """Return grip sets, as `Screen.stands` takes them, as grips of `node_assembly`.

    Results: ``places`` (S, r): from 0; the number of nodes for none. ``payload`` (S, r): N; zero
    for none. Raises `GripError` if there are no such nodes, or payloads are missing or not numbers.
    """
    sets, most = np.asarray(held), 2 * bricks
    if sets.ndim != 2 or (sets.size and sets.dtype.kind not in "iu"):
        raise GripError(f"held: an array of shape {sets.shape}; give a row of nodes per grip set")
    if not 1 <= bricks <= len(network.inner):
        raise GripError(f"{bricks} bricks: give from 1 to {len(network.inner)}")
    if sets.size and not 0 <= sets.min() <= sets.max() <= most:
        bad = sets.min() if sets.min() < 0 else sets.max()
        known = f"give from 1 to {most}, or 0 for none"
        raise GripError(f"held: node {bad} of {bricks} bricks; {known}")
    if payload is None:
        own = {robot.payload for robot in network.scene.robots}
        if len(own) != 1:
            known = f"scene {network.scene.name}: its robots have no payload in common"
            raise GripError(f"{known}; give one per grip")
        payload = own.pop()
    loads = np.broadcast_to(np.asarray(payload, dtype=float), sets.shape)
    if not (np.isfinite(loads).all() and (loads >= 0).all()):
        raise GripError("payload: it is negative or no number; give N")
    free = sets == 0
    return np.where(free, most, sets - 1).astype(np.int64), np.where(free, 0.0, loads)
