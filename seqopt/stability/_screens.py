"""Which grip sets of a partial structure stand, with what margins: most without a solver.

A set stands if forces are found that hold it, and falls if a motion is found in which it falls:
either is checked by the structure's own data, with the friction cone and the payloads as they are.
What one set proves decides others: forces that hold a structure hold it with more grips, larger
payloads, or without a grip that they leave idle; a motion in which it falls makes it fall with any
grips whose payloads can take up less work than the loads do in it. So a linear program, whose cones
are inscribed polyhedra, is solved for few sets.

The sideways pulls that a structure survives are a convex set. What is between pulls that it
survives, it survives, so the least distance of their hull from no pull is survived in every
direction; the largest pull in any direction is survived by no more. One program for every direction
answers for every tilt, and a direction is asked where the hull is nearest.

Every margin is a bracket: what forces prove on one side, a motion on the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seqopt.arrays import Bools, Floats, Ints, Vector
from seqopt.contact.assembly import Assembly, _applied_rows, _prop_grips, bare_assembly
from seqopt.contact.mortar import ROUGHEST, Mortar, find_mortar
from seqopt.errors import GripError, SceneError, plugins
from seqopt.network.network import Network, network_of
from seqopt.scene.scene import Scene
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import (
    CAP,
    EXACT,
    FINE,
    GAP,
    LARGEST_FORCE,
    ROUNDING,
    Answer,
    Case,
    Sense,
    contact_work,
    hulls,
    is_finite,
    sideways,
    turned,
    violation,
)
from seqopt.stability.verdict import FALLS, OPEN, STANDS

Enough = Callable[[Answer], bool]
"""Says whether an answer proves what is asked, or the program must be refined."""

HeldProgram = Callable[[Floats, Enough], Answer]
"""A case of one assembly, solved for the payloads (N) of all its grips; none for one not held.

Where no forces exist, the answer claims that, has no value and a motion that says why.
"""

CompileHeld = Callable[[Assembly, Case], HeldProgram]
"""Makes the program of an assembly, whose grips are all that may ever be held, and a case."""

_TIGHT = 1e-8  # largest violation of forces that prove, over the force scale and max(1, z)
_IDLE = 1e-10  # a grip's force treated as zero, over the force scale
_Settled = Callable[[Floats], Bools]
"""Says which brackets (S, 2) are narrow enough."""
_FIRST = tuple(range(0, FINE, FINE // 4))
_FAR = 1.5  # times the pull that must be survived: what is survived by so much is far enough
_TURN = 2 * np.pi / FINE
_ANGLES: Floats = _TURN * np.arange(FINE, dtype=float)
Part = tuple[int, bool]  # how many bricks stand, and whether the props hold that could
_Cases = Callable[[Assembly], list[Case]]


def compile_held(assembly: Assembly, case: Case) -> HeldProgram:
    """Return the registered linear program (entry points ``seqopt.limit_analysis``)."""
    compiled: CompileHeld = plugins("seqopt.limit_analysis")["lp"].load()
    return compiled(assembly, case)


class _FallingMotion(NamedTuple):
    """A motion of the blocks, and what counts for any grips.

    ``work``, ``growth``: of the loads, less what contacts take up, and its growth with z;
    ``closing``: by which contacts close, weighted by the largest corner force; ``speed`` (G + 1,):
    of every node, and of none.
    """

    work: float
    growth: float
    closing: float
    speed: Floats


class _Known:
    """What is proven of one structure, with all grips that may ever be held, and case."""

    def __init__(self, assembly: Assembly, case: Case) -> None:
        self._assembly, self._case = assembly, case
        # z of forces in equilibrium, and what every grip exerts (G,), over the force scale
        self._forces: list[tuple[float, Floats]] = []
        self._motions: list[_FallingMotion] = []

    def bracket(self, places: Ints, payload: Floats) -> Floats:
        """Return between which values z is proven to lie.

        ``places`` (S, r): grips of the assembly that are held, from 0; as many as it has for none.
        ``payload`` (S, r): of those that hold them, N; zero for none. Result (S, 2): the least z
        that suffices is no smaller and no larger; of a largest z, the one proven to be survived
        (less than none, if nothing is) and the one that is not exceeded.
        """
        nothing = (0.0, np.inf) if self._case.sense is Sense.SMALLEST else (-np.inf, CAP)
        return self.tightened(np.tile(nothing, (len(places), 1)), places, payload)

    def learn(self, answer: Answer, held: Floats) -> _Known:
        """Keep what an answer proves by itself, and return itself; a solver's claim is not proof.

        ``held`` (G,): payload of every grip for which it was found, N; zero for one not held. A
        motion that proves nothing with these proves no more with fewer.
        """
        assembly, case, motion = self._assembly, self._case, answer.motion
        size = np.abs(motion).max(initial=0.0)
        if motion.shape == (len(assembly.centroid), 6) and 0 < size < np.inf:
            flat = np.ldexp(motion, -np.frexp(size)[1]).ravel()
            ((low, _), (high, _)), opening = contact_work(assembly, case, flat, (0.0, 1.0))
            by_load, by_growth = (float(load @ flat) for load in case.loads(assembly))
            work, growth = by_load - low, by_growth - (high - low)
            if work > ROUNDING if case.sense is Sense.SMALLEST else growth > 0:
                closing = LARGEST_FORCE * float(np.maximum(-opening, 0).sum())
                speed = np.linalg.norm((assembly.grip_map.T @ flat).reshape(-1, 3), axis=1)
                self._motions.append(_FallingMotion(work, growth, closing, np.append(speed, 0.0)))
        if is_finite(assembly, answer):  # forces hold by the assembly's own data
            needed, value = np.linalg.norm(answer.grip_force, axis=1), max(answer.value, 0.0)
            needed[needed <= _IDLE] = 0.0
            grip = np.where(needed[:, None] > 0, answer.grip_force, 0.0)
            clean = replace(answer, value=value, grip_force=grip)
            tight = violation(assembly, case, clean, held) <= _TIGHT * max(1.0, value)
            if tight and not grip[held <= 0].any():
                self._forces.append((value, needed))
        return self

    def tightened(self, bracket: Floats, places: Ints, payload: Floats) -> Floats:
        """Return brackets (S, 2) no wider than others, by what is known here; see `bracket`."""
        out, smallest = bracket.copy(), self._case.sense is Sense.SMALLEST
        forced, moved = out[:, int(smallest)], out[:, int(not smallest)]
        of_forces, of_motion = (np.minimum, np.maximum) if smallest else (np.maximum, np.minimum)
        own, common = self._case.payload
        for value, needed in self._forces:
            most = own * payload / self._assembly.scales[0] + value * common * (payload > 0)
            holds = np.ones(len(places), dtype=bool)  # the grips can exert these forces
            for grip in np.flatnonzero(needed).tolist():
                enough = most >= needed[grip] - _TIGHT * max(1.0, value)
                holds &= ((places == grip) & (payload > 0) & enough).any(axis=1)
            forced[holds] = of_forces(forced[holds], value)
        for motion in self._motions:
            of_motion(moved, self._proven_by(motion, places, payload), out=moved)
        return out

    def _proven_by(self, motion: _FallingMotion, places: Ints, payload: Floats) -> Floats:
        """Return the value of z that a motion proves for every row."""
        own, common = self._case.payload
        force = self._assembly.scales[0]
        loads, more = self._case.amounts(self._assembly)
        speed = motion.speed[places]
        work = motion.work - own * (payload * speed).sum(axis=1) / force
        work -= motion.closing * (loads + payload.sum(axis=1)) / force
        growth = motion.growth - common * (speed * (payload > 0)).sum(axis=1)
        growth -= motion.closing * more / force
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(work / growth)
        if self._case.sense is Sense.SMALLEST:
            value = np.where(growth < 0, np.minimum(ratio, CAP), CAP)
            return np.where(work > ROUNDING, value, 0.0)
        value = np.where(work > 0, 0.0, np.minimum(ratio, CAP))
        return np.where(growth > 0, value, CAP)


def node_assembly(network: Network, bricks: int, *, held: bool = True) -> Assembly:
    """Return a partial structure with a grip without payload at every inner node.

    ``held``: whether a robot holds any of these, so that props hold.
    """
    bare = bare_assembly(network, bricks)
    nodes, props = network.inner[:bricks].ravel(), _prop_grips(network, bricks, held=held)
    line = np.zeros((len(nodes) if props.line.any() else 0, 3))
    if len(line):
        numbers = network.scene.placed_nodes
        line[[numbers.index(node) for node in props.nodes]] = props.line
    return replace(
        bare,
        applied=_applied_rows(network, bricks, props),
        grip_line=line,
        grip_block=np.repeat(np.arange(bricks), 2),
        grip_position=network.node_position[nodes],
        payload=np.zeros(len(nodes)),
    )


class HeldStates:
    """One question about one structure, asked of any number of grip sets.

    ``assembly``: its grips are all that may ever be held; ``case``: what is bracketed; ``easier``:
    what a program is asked before; ``earlier``: answers to other cases of the same assembly, with
    their payloads: what they prove here for a z of zero is known, and new ones join them;
    ``solved``: how many times the program was called.
    """

    def __init__(
        self,
        assembly: Assembly,
        case: Case,
        compiled: CompileHeld,
        easier: Case | None = None,
        earlier: list[tuple[Answer, Floats]] | None = None,
    ) -> None:
        self.assembly, self._case, self._compile = assembly, case, compiled
        self._asked = [case] if easier is None else [easier, case]
        self._programs: list[HeldProgram] = []
        self.known = _Known(assembly, case)
        self._tried: set[tuple[bytes, float]] = set()
        self.solved = 0
        self._answers = earlier
        for answer, held in earlier or ():
            self.known.learn(replace(answer, value=0.0), held)

    def bracket(
        self, places: Ints, payload: Floats, settled: _Settled, wanted: float = 0.0
    ) -> Floats:
        """Return proven brackets of z, as narrow as needed where the solver's answers allow it.

        As `_Known.bracket`; ``settled``: says which are narrow enough; ``wanted``: a number for it:
        what is left open for one is asked again for another.
        """
        out = self.known.bracket(places, payload)
        open_ = ~settled(out)
        for row in np.argsort((payload > 0).sum(axis=1), kind="stable").tolist():
            if not open_[row]:
                continue
            held = np.zeros(len(self.assembly.payload) + 1)  # payload of every grip, and of none
            np.maximum.at(held, places[row], payload[row])
            key, rows = (held[:-1].tobytes(), wanted), np.flatnonzero(open_)
            if key not in self._tried:
                self._tried.add(key)
                new = self._solve(held[:-1], settled)
                out[rows] = new.tightened(out[rows], places[rows], payload[rows])
                open_[rows] = ~settled(out[rows])
            open_[row] = False
        return out

    def _solve(self, held: Floats, settled: _Settled) -> _Known:
        """Return what answers prove for those grips."""
        places, payload = np.flatnonzero(held)[None], held[held > 0][None]
        alone = partial(_Known, self.assembly, self._case)
        new = alone()

        def enough(answer: Answer) -> bool:
            return bool(settled(alone().learn(answer, held).bracket(places, payload))[0])

        for i in range(len(self._asked)):
            if i == len(self._programs):
                self._programs.append(self._compile(self.assembly, self._asked[i]))
            self.solved += 1
            answer = self._programs[i](held, enough)
            if self._answers is not None:
                self._answers.append((answer, held))
            self.known.learn(answer, held)
            if settled(new.learn(answer, held).bracket(places, payload))[0]:
                break
        return new


class TiltedStates:
    """One structure, with all grips that may ever be held, as in a case, pulled sideways."""

    def __init__(self, assembly: Assembly, case: Case, up: Vector, compiled: CompileHeld) -> None:
        self._assembly, self._compile = assembly, compiled
        self._cases = sideways(case, up, FINE)
        self._states: dict[int, HeldStates] = {}
        self._fell = np.zeros(FINE, dtype=np.int64)  # how many sets by each direction

    @property
    def solved(self) -> int:
        """How many linear programs were solved."""
        return sum(states.solved for states in self._states.values())

    def survive(
        self, pull: float, places: Ints, payload: Floats, *, solve: bool
    ) -> NDArray[np.int8]:
        """Return verdicts of grip sets under a pull in all directions; a fall in one is a fall.

        Of sets that stand without a pull. ``pull``: over gravity; ``places``, ``payload`` (S, r):
        as of `HeldStates.bracket`; ``solve``: whether directions that are open are solved.
        """

        def settled(bracket: Floats) -> Bools:
            """Return what has converged, or is far from the pull."""
            low, high = bracket.T
            narrow = high - low <= GAP * np.maximum(1e-2, high)
            return np.asarray((high < pull) | (low >= _FAR * pull) | narrow | (low >= CAP))

        survived, least = np.full((len(places), FINE), np.nan), np.full(len(places), np.inf)
        for way, states in self._states.items():
            low, high = states.known.bracket(places, payload).T
            survived[:, way] = np.where(low >= 0, low, np.nan)
            least = np.minimum(least, high)
        asked, rows = np.zeros(survived.shape, dtype=bool), np.arange(len(places) if solve else 0)
        while len(rows):
            safe, angle = hulls(_ANGLES, survived[rows])
            open_ = ~(safe >= pull) & (least[rows] >= pull)
            rows, ways = rows[open_], self._next(angle[open_], asked[rows[open_]])
            rows, ways = rows[ways >= 0], ways[ways >= 0]
            for way in np.unique(ways).tolist():
                own = rows[ways == way]
                if way not in self._states:
                    self._states[way] = HeldStates(self._assembly, self._cases[way], self._compile)
                grips = places[own], payload[own]
                low, high = self._states[way].bracket(*grips, settled, pull).T
                self._fell[way] += int((high < pull).sum())
                asked[own, way] = True
                survived[own, way] = np.where(low >= 0, low, np.nan)
                least[own] = np.minimum(least[own], high)
        stand = np.where(hulls(_ANGLES, survived)[0] >= pull, STANDS, OPEN)
        return np.where(least < pull, FALLS, stand).astype(np.int8)

    def _next(self, angle: Floats, asked: Bools) -> Ints:
        """Return the directions to ask next, (S,): -1 where there is none that would help.

        ``angle`` (S,): where their hulls are nearest; ``asked`` (S, F).
        """
        off = np.abs((np.arange(FINE) - angle[:, None] / _TURN + FINE / 2) % FINE - FINE / 2)
        off = np.where(asked | np.isnan(off), np.inf, off)
        near = off.argmin(axis=1)
        out = np.where(off.min(axis=1, initial=np.inf) <= 1.0, near, -1)
        for way in sorted(_FIRST, key=lambda way: (self._fell[way], -way)):
            out[~asked[:, way]] = way  # the one that most fell by comes last, and stays
        return out


@dataclass
class Proofs:
    """Proofs shared by the screens of one scene.

    ``upright``, ``tilted``: what is known of structures by brick count and mortar; ``answers``: by
    brick count, what the programs of all mortars found, if they are kept.
    """

    upright: dict[tuple[Part, Mortar], HeldStates] = field(default_factory=dict)
    tilted: dict[tuple[Part, Mortar, Case], TiltedStates] = field(default_factory=dict)
    keeps: bool = False
    answers: dict[Part, list[tuple[Answer, Floats]]] = field(default_factory=dict)


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
    proofs : Proofs, optional
        Of the same network and program: what other screens found.

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
        proofs: Proofs | None = None,
    ) -> None:
        self.network, self.mortar = network_of(network), find_mortar(mortar)
        self.tilt = tilt
        self._compile, self._proofs = compiled, proofs or Proofs()

    @property
    def solved(self) -> int:
        """How many linear programs were solved, also by others that share their proofs."""
        upright, tilted = self._proofs.upright.values(), self._proofs.tilted.values()
        return sum(one.solved for one in upright) + sum(one.solved for one in tilted)

    def stands(
        self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None, *, solve: bool = True
    ) -> NDArray[np.int8]:
        """Return which grip sets stand.

        ``bricks``: how many bricks stand, in build order. ``held`` (S, r): nodes held, as places in
        build order counted from 1; zero for a robot that holds none. ``payload`` (r,), (S, r):
        largest force of those that hold them, N; by default of the scene's robots, if all have the
        same. ``solve``: whether programs are solved where known proofs leave sets open. Result
        (S,): 1 where it is proven that the structure stands, -1 where it is proven that it falls,
        and 0 where neither is. Raises `GripError` as `held_places` does.
        """
        out = np.zeros(len(np.asarray(held)), dtype=np.int8)
        for own, part, places, loads in held_parts(self.network, bricks, held, payload):
            known, key, asked = self._proofs, (part, self.mortar), (places, loads)
            if key not in known.upright:
                assembly = node_assembly(self.network, part[0], held=part[1])
                case = bonded(assembly, self.mortar)  # of the least bond that is lacking
                answers = known.answers.setdefault(part, []) if known.keeps else None
                states = HeldStates(assembly, case, self._compile, case.fixed(), answers)
                known.upright[key] = states
            states = known.upright[key]
            bracket = states.bracket(*asked, _decided) if solve else states.known.bracket(*asked)
            stand, fall = bracket[:, 1] <= EXACT, bracket[:, 0] > EXACT
            found = np.where(fall, FALLS, np.where(stand, STANDS, OPEN)).astype(np.int8)
            rows = np.flatnonzero(found == STANDS) if self.tilt else ()
            if len(rows):
                pull, case = float(np.tan(self.tilt)), bonded(states.assembly, self.mortar).fixed()
                case = turned(case, pull) if len(states.assembly.applied) else case
                if (*key, case) not in known.tilted:
                    pulled = states.assembly, case, self.network.scene.up, self._compile
                    known.tilted[*key, case] = TiltedStates(*pulled)
                asked = places[rows], loads[rows]
                found[rows] = known.tilted[*key, case].survive(pull, *asked, solve=solve)
            out[own] = found
        return out


def _decided(bracket: Floats) -> Bools:
    """Return where brackets (S, 2) prove that no bond is lacking, or that some is."""
    return np.asarray((bracket[:, 1] <= EXACT) | (bracket[:, 0] > EXACT))


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


def held_parts(
    network: Network, bricks: int, held: ArrayLike, payload: ArrayLike | None
) -> Iterator[tuple[Ints, Part, Ints, Floats]]:
    """Yield rows of grip sets (n,), of which structure, and what `held_places` gives with props.

    Props hold beside robots; of the finished structure that nobody holds they are struck.
    """
    places, loads = held_places(network, bricks, held, payload)
    if not network.scene.props:
        yield np.arange(len(places)), (bricks, True), places, loads
        return
    numbers = network.scene.placed_nodes
    last = bricks == len(network.inner)
    robots = (loads > 0).any(axis=1) if last else np.ones(len(places), dtype=bool)
    for propped in (True, False):
        rows = np.flatnonzero(robots == propped)
        props = _prop_grips(network, bricks, held=propped)
        at = np.tile([numbers.index(node) for node in props.nodes], (len(rows), 1))
        most = np.tile(props.payload, (len(rows), 1))
        if len(rows):
            sets = np.hstack([places[rows], at.astype(np.int64)])
            yield rows, (bricks, propped), sets, np.hstack([loads[rows], most])


class Margins:
    """Brackets of the margins of grip sets; the parameters of its methods are those of `Screen`.

    Parameters
    ----------
    network : Network or Scene
    mortar : Mortar or str
        Of all joints; or its name.

    Attributes
    ----------
    screens : dict of float to Screen
        By the coefficient of friction, as far as they were needed.

    Examples
    --------
    >>> import seqopt
    >>> margins = Margins(seqopt.load_scene("arch25"), seqopt.DRY)
    >>> margins.bond(5, [[10, 7], [10, 0]]).round()  # Pa
    array([[  0.,   0.],
           [778., 778.]])
    """

    def __init__(self, network: Network | Scene, mortar: Mortar | str) -> None:
        self.network, self.mortar = network_of(network), find_mortar(mortar)
        self._levels: dict[tuple[str, Part], tuple[HeldStates, ...]] = {}
        self.screens = {self.mortar.friction: Screen(self.network, self.mortar)}

    @property
    def solved(self) -> int:
        """How many linear programs were solved."""
        own = sum(states.solved for level in self._levels.values() for states in level)
        return own + sum(screen.solved for screen in self.screens.values())

    def bond(self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None) -> Floats:
        """Return the least bond of grip sets at the mortar's friction.

        Result (S, 2): brackets, Pa, in tension and at once in shear; inf if none is enough.
        """
        bare = Mortar(friction=self.mortar.friction)
        each, assembly = self._brackets("bond", lambda a: [bonded(a, bare)], bricks, held, payload)
        return np.where(each[0][:, [0]] >= CAP, np.inf, each[0]) * assembly.stress_scale

    def grip(self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None) -> Floats:
        """Return the least payload, the same for all who hold, with the mortar.

        ``payload`` counts only in what a motion's rounding is charged with. Result (S, 2): between
        which values it lies, N; infinite if none is enough. Not where props only push.
        """
        if any(prop.direction for prop in self.network.scene.props):
            text = "the least payload is not found where props only push"
            raise SceneError(f"{text}; leave payloads out of the margins")

        def cases(assembly: Assembly) -> list[Case]:
            return [replace(bonded(assembly, self.mortar).fixed(), payload=(0.0, 1.0))]

        (bracket,), assembly = self._brackets("grip", cases, bricks, held, payload)
        return np.where(bracket[:, [0]] >= CAP, np.inf, bracket) * assembly.scales[0]

    def friction(
        self, bricks: int, held: ArrayLike, payload: ArrayLike | None = None, step: float = 2.0**-7
    ) -> Floats:
        """Return the least coefficient of friction at the mortar's bond, by halving intervals.

        ``step``: width of brackets (S, 2); infinite above where `ROUGHEST` is not proven enough.
        """
        sets = np.asarray(held)
        out = np.tile([0.0, np.inf], (len(sets), 1))
        open_ = np.ones(len(sets), dtype=bool)

        def narrow_by(friction: float, rows: Ints) -> None:
            """Narrow the brackets of rows by verdicts at a friction."""
            if friction not in self.screens:
                mortar = replace(self.mortar, friction=friction)
                self.screens[friction] = Screen(self.network, mortar)
            own = payload if payload is None or np.ndim(payload) < 2 else np.asarray(payload)[rows]
            found = self.screens[friction].stands(bricks, sets[rows], own)
            stand, fall = rows[found == STANDS], rows[found == FALLS]
            out[stand, 1] = np.minimum(out[stand, 1], friction)
            out[fall, 0] = np.maximum(out[fall, 0], friction)

        for friction in (0.0, 1.0, ROUGHEST):
            narrow_by(friction, np.arange(len(sets)))
        while True:
            open_ &= (out[:, 1] - out[:, 0] > step) & np.isfinite(out[:, 1])
            if not open_.any():
                return out
            middle = out.mean(axis=1)
            for friction in np.unique(middle[open_]).tolist():
                rows = np.flatnonzero(open_ & (middle == friction))
                before = out[rows]
                narrow_by(friction, rows)
                open_[rows] = (out[rows] != before).any(axis=1)

    def _brackets(
        self, name: str, cases: _Cases, bricks: int, held: ArrayLike, payload: ArrayLike | None
    ) -> tuple[list[Floats], Assembly]:
        """Return the brackets (S, 2) of z of every case, and a structure with their scales."""
        out: list[Floats] = []
        for rows, part, places, loads in held_parts(self.network, bricks, held, payload):
            if (name, part) not in self._levels:
                assembly = node_assembly(self.network, bricks, held=part[1])
                self._levels[name, part] = tuple(
                    HeldStates(assembly, case, compile_held) for case in cases(assembly)
                )
            states = self._levels[name, part]
            out = out or [np.zeros((len(np.asarray(held)), 2)) for _ in states]
            for each, own in zip(out, states, strict=True):
                each[rows] = own.bracket(places, loads, _narrow)
        return out, states[0].assembly


def _narrow(bracket: Floats) -> Bools:
    """Return which brackets (S, 2) of a margin have converged."""
    scale = np.maximum(1.0, np.where(np.isfinite(bracket[:, 0]), np.abs(bracket[:, 0]), 0.0))
    near = bracket[:, 1] - bracket[:, 0] <= GAP * scale
    return np.asarray(near | (bracket[:, 0] >= CAP))
