"""The interface of engines: requests, fields, and how grips hold.

A compliant grip is held at its far end: it lets its node shift and turn by a compliance for every
force and moment that it transmits. Its far end may be moved. Moments and rotations are measured by
a lever, so that they are forces and lengths.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from enum import Flag, auto
from itertools import combinations
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import GripError, SolverError
from seqopt.network.network import Network, network_of
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene

FAR = 0.1  # motion over a brick's length beyond which a structure has gone
_RIGID = 1e-9  # compliance in a direction, over the largest, that stands for none


class Want(Flag):
    """Which fields are computed; grip forces always are."""

    EDGES = auto()
    DISPLACEMENTS = auto()
    SUPPORT = auto()
    JOINTS = auto()
    BRICKS = auto()
    SCREEN = auto()  # six digits are enough, to choose by; an engine may give more
    RESPONSES = EDGES | DISPLACEMENTS | SUPPORT  # what T_max, M_sup, F_rob, D_max and kin need
    ALL = RESPONSES | JOINTS | BRICKS


@dataclass(frozen=True, eq=False, repr=False)
class Fields(FrozenValue):
    """Full fields of S grip sets on one partial structure; arrays run over sets first.

    A field that was not asked for has no entries along its second axis.

    Attributes
    ----------
    edge_force : (S, E) float
        Axial force of every network edge, tension positive, N.
    displacement : (S, N, 3) float
        Of every network node, m.
    grip_force, grip_moment : (S, r, 3) float
        Force of every grip on the structure, N, and its moment about the node, N m; no moment
        where a grip lets its node turn.
    support : (S, G, 6) float
        Reaction on the structure at every ground end of the scene, in its order, N, and its moment
        about the end's own fixed point, N m; zero where the end does not act.
    joint_wrench : (S, J, 6) float
        Force and moment, about its position, of every spring of the network on its second body
        (`Springs.bodies`), N and N m; zero where it does not act.
    brick_twist : (S, b, 6) float
        Translation of every brick's centroid and its rotation, m and rad.
    """

    edge_force: Floats
    displacement: Floats
    grip_force: Floats
    support: Floats
    joint_wrench: Floats
    brick_twist: Floats
    grip_moment: Floats


def linear_limit(scene: Scene) -> float:
    """Return the displacement up to which a linear model holds, m: a tenth of the smallest side."""
    return FAR * min(min(brick.dimensions) for brick in scene.bricks)


class Engine(Protocol):
    """Solves partial structures of one scene: linear, each from scratch, with all weight at once.

    Examples
    --------
    >>> from seqopt.engines.registry import make_engine
    >>> from seqopt.network.network import build_network
    >>> from seqopt.scene.scene_file import load_scene
    >>> engine: Engine = make_engine("compliance", build_network(load_scene("arch25")))
    >>> fields = engine.solve(2, [[2], [3]], Want.SUPPORT)  # two bricks, node 2 or 3 held
    >>> fields.grip_force.shape, fields.support.shape, fields.displacement.shape
    ((2, 1, 3), (2, 2, 6), (2, 0, 3))
    """

    @property
    def network(self) -> Network:
        """The network whose nodes and edges the fields follow."""

    def solve(
        self,
        bricks: int,
        grips: ArrayLike,
        want: Want = Want.RESPONSES,
        moved: ArrayLike | None = None,
    ) -> Fields:
        """Return the fields of a partial structure for many grip sets.

        Parameters
        ----------
        bricks : int
            How many bricks stand, in build order.
        grips : (S, r) int
            Numbers of the nodes that each set holds. Where the robots of a scene are not equally
            stiff, a node's number means a grip of the first robot;
            `seqopt.Scene.grip_numbers` has the numbers for grips of given robots.
        want : Want, optional
            Which fields are evaluated; an engine may evaluate others too.
        moved : (S, r, 3) float, optional
            How far each grip is from where it should be, along the scene's axes, m; nowhere by
            default. A rigid grip moves its node as far, a soft one the far end of its spring.
            Fields are linear in it, beside those that the weight makes. Two rigid grips on one
            brick cannot stretch it: along the brick, both of its nodes go halfway between, which is
            what grips of one stiffness do.

        Returns
        -------
        Fields

        Raises
        ------
        GripError
            If a grip set names an unknown, blocked, unplaced or repeated node, or ``moved`` is not
            as many lengths.
        MechanismError
            If bricks, joints and grips leave a motion that nothing resists.
        SolverError
            If the numerical method fails.
        """


_NAMES = tuple(field.name for field in fields(Fields))
FLAGS = {
    "edge_force": Want.EDGES,
    "displacement": Want.DISPLACEMENTS,
    "support": Want.SUPPORT,
    "joint_wrench": Want.JOINTS,
    "brick_twist": Want.BRICKS,
}
SHAPES = dict.fromkeys(FLAGS, (6,)) | {"edge_force": (), "displacement": (3,)}
"""Trailing shape of every field, for an edge, node, end, spring or brick."""


def keep_wanted(answer: Fields, want: Want) -> Fields:
    """Return the requested fields alone."""
    dropped = [name for name, flag in FLAGS.items() if not want & flag]
    return replace(answer, **{name: getattr(answer, name)[:, :0] for name in dropped})


def require_finite(answer: Fields, bricks: int, grips: ArrayLike) -> Fields:
    """Return fields if all of their numbers are finite; raise `SolverError` if one is not."""
    for name in _NAMES:
        values = getattr(answer, name)
        if not np.isfinite(values).all():
            of_set = ~np.isfinite(values).reshape(len(values), -1).all(axis=1)
            nodes = ", ".join(map(str, np.asarray(grips)[int(of_set.argmax())])) or "none"
            raise SolverError(
                f"{bricks} bricks, held nodes {nodes}: {name.replace('_', ' ')} is not finite; "
                "correct lengths, masses or stiffnesses beyond all bounds in the scene"
            )
    return answer


def grip_columns(network: Network, bricks: int, grips: ArrayLike) -> Ints:
    """Return grip sets (S, r) of node numbers as the ``columns`` that functions of engines take.

    These are indices into ``network.inner.ravel()``. Raises `GripError` if there are fewer bricks,
    the shape is another, or a set names an unknown, blocked, unplaced or repeated node.
    """
    total = len(network.inner)
    if not isinstance(bricks, int | np.integer) or not 1 <= bricks <= total:
        raise GripError(f"brick count {short(bricks)}: the scene has 1 to {total} bricks")
    try:
        numbers = np.asarray(grips)
    except ValueError:
        raise GripError(
            "grip sets have different sizes; give as many nodes in each, or solve them by size"
        ) from None
    if numbers.ndim != 2 or (numbers.size and numbers.dtype.kind not in "iu"):
        shape = numbers.shape
        raise GripError(f"grips have shape {shape}; give integer node numbers, (sets, grips)")
    numbers, _ = network.scene.grip_kinds.split(numbers)
    known, index = network.index_of_grip
    at = np.searchsorted(known, numbers)
    columns = index.take(at, mode="clip").astype(np.int64, copy=False)
    wrong = (known.take(at, mode="clip") != numbers) | (columns >= 2 * bricks)
    if wrong.any():
        raise GripError(
            f"grip on node {numbers[wrong][0]}: with {bricks} bricks the free nodes are "
            f"{known[index < 2 * bricks].tolist()}"
        )
    ordered = np.sort(columns, axis=1)
    twice = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    if twice.any():
        named = numbers[twice][0].tolist()
        raise GripError(f"grip set {named}: a node is held twice; name it once")
    return columns


@dataclass(frozen=True, eq=False, repr=False)
class GripCompliance(FrozenValue):
    """The compliance of the grips of S grip sets, and their offsets.

    ``moved`` (S, r, 3): how far each is from where it should be, m; None if none is. ``matrix`` (S,
    r, w, w): m/N, of forces, then of moments over the lever if any grip of the scene transmits any
    (w = 6, else 3), infinite on the diagonal of those that a grip does not transmit; None if all
    are rigid and transmit none. ``lever``: m.
    """

    moved: Floats | None = None
    matrix: Floats | None = None
    lever: float = 1.0

    @property
    def rigid(self) -> bool:
        """Whether all grips are rigid, in their places, and transmit no moment."""
        return self.matrix is None and self.moved is None

    def select(self, which: Bools | Ints | slice) -> GripCompliance:
        """Select grip sets."""
        if self.rigid:
            return self
        moved = None if self.moved is None else self.moved[which]
        matrix = None if self.matrix is None else self.matrix[which]
        return replace(self, moved=moved, matrix=matrix)

    def offsets(self, grips: int) -> Floats:
        """Return how far the grips of one set are moved (r, 3)."""
        return np.zeros((grips, 3)) if self.moved is None else self.moved[0]

    def compliant(self, sets: int, grips: int) -> Bools:
        """Return which grips (S, r) are compliant to forces."""
        if self.matrix is None:
            return np.zeros((sets, grips), dtype=bool)
        return np.asarray(self.matrix[..., :3, :3].any(axis=(2, 3)))

    def transmits(self, grips: int) -> Bools:
        """Return which grips of one set transmit moments, (r,)."""
        if self.matrix is None or self.matrix.shape[3] == 3:
            return np.zeros(grips, dtype=bool)
        return np.isfinite(self.matrix[0, :, 5, 5])

    @property
    def transmitted(self) -> Floats:
        """The compliance (S, r, w, w) to grip wrenches; grips must not all be rigid."""
        assert self.matrix is not None
        return np.where(np.isinf(self.matrix), 0.0, self.matrix)


RIGID = GripCompliance()
"""Of rigid grips in their places."""


def read_compliance(
    network: Network, columns: Ints, grips: ArrayLike, moved: ArrayLike | None
) -> GripCompliance:
    """Return the compliance of grip sets (S, r), from columns and what `Engine.solve` takes.

    Raises `GripError` if ``moved`` is not as many lengths.
    """
    found = _in_place(network, np.asarray(grips))
    if moved is None:
        return found
    try:
        offsets = np.array(moved, dtype=float)
    except (TypeError, ValueError):
        raise GripError("moved: give lengths in meters, (sets, grips, 3)") from None
    if offsets.shape != (*columns.shape, 3):
        raise GripError(
            f"moved has shape {offsets.shape}; give lengths in meters, (sets, grips, 3), here "
            f"{(*columns.shape, 3)}"
        )
    if not np.isfinite(offsets).all():
        raise GripError("moved: a length is not finite; give meters")
    # two rigid grips on one brick cannot stretch it: along it, both nodes go halfway between
    ends = network.node_position[network.inner]
    steps = ends[:, 1] - ends[:, 0]
    axes = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    yields = found.compliant(*columns.shape)
    for i, j in combinations(range(columns.shape[1]), 2):
        one = columns[:, i] // 2 == columns[:, j] // 2
        both = np.flatnonzero(one & ~yields[:, i] & ~yields[:, j])
        axis = axes[columns[both, i] // 2]
        stretch = np.einsum("si,si->s", offsets[both, j] - offsets[both, i], axis)
        offsets[both, i] += 0.5 * stretch[:, None] * axis
        offsets[both, j] -= 0.5 * stretch[:, None] * axis
    return replace(found, moved=offsets)


def _in_place(network: Network, grips: Ints) -> GripCompliance:
    """Return the compliance of grips (S, r) in their places.

    Raises `GripError` if the compliance of one is not known: the posture of an arm is missing.
    """
    if network.scene.grip_kinds.rigid:
        return RIGID
    scene, known = network.scene, network.compliances
    node, of_robot = scene.grip_kinds.split(grips)
    kind = known.at(node, of_robot)
    if (kind < 0).any():
        at = tuple(np.argwhere(kind < 0)[0])
        name = scene.robots[[*scene.grip_kinds.of_robot].index(of_robot[at])].name
        raise GripError(
            f"robot {name} has no posture at node {node[at]}, so the compliance of its grip is "
            "not known; move its base, or leave out joint_stiffness"
        )
    scale = np.repeat([1.0, network.lever], 3)
    matrix = known.compliance * np.outer(scale, scale)  # of each kind of grip, m/N
    if known.transmits_moment.any():
        turning = np.where(known.transmits_moment, 0.0, np.inf)
        matrix[:, [3, 4, 5], [3, 4, 5]] += turning[:, None]
    else:
        matrix = matrix[:, :3, :3]
    one = len(matrix) == 1
    every = np.broadcast_to(matrix[0], (*grips.shape, *matrix.shape[1:])) if one else matrix[kind]
    return GripCompliance(None, every, network.lever)


class _GripSpring(NamedTuple):
    """A compliant grip as a spring between its node and its far end.

    ``ways`` (w,): in which of three shifts and three turns; ``compliance`` (w, w): m and rad for N
    and N m, with an inverse; ``offset`` (w,): of the far end, m.
    """

    grip: int
    ways: list[int]
    compliance: Floats
    offset: Floats


def grip_springs(compliance: GripCompliance, grips: int) -> list[_GripSpring]:
    """Return the compliant ones of the grips of one set, in space."""
    if compliance.matrix is None:
        return []
    yields, turns = compliance.compliant(1, grips)[0], compliance.transmits(grips)
    matrix, offset = compliance.matrix[0], compliance.offsets(grips)
    out = []
    for grip in range(grips):
        ways = [way for way in range(6) if (yields[grip] if way < 3 else turns[grip])]
        if not ways:
            continue
        scale, own = np.repeat([1.0, compliance.lever], 3)[ways], matrix[grip][np.ix_(ways, ways)]
        values, axes = np.linalg.eigh(own)
        least, even = _RIGID * values[-1], not (own - np.diag(np.diag(own))).any()
        if values[0] < least and not (even and values[0] > 0):  # too few joints give any
            own = np.asarray(axes * np.maximum(values, least) @ axes.T)
        offsets = np.pad(offset[grip], (0, 3))[ways]
        out.append(_GripSpring(grip, ways, own / np.outer(scale, scale), offsets))
    return out


@contextmanager
def _failing_in_a_line() -> Iterator[None]:
    """Let numerical failures of a function be a `SolverError`."""
    try:
        yield
    except (np.linalg.LinAlgError, ValueError) as error:
        # SciPy says so of arrays that it does not take
        if not isinstance(error, np.linalg.LinAlgError) and "infs or NaNs" not in str(error):
            raise
        raise SolverError(
            f"the equations have no answer in numbers ({error}); correct lengths, masses or "
            "stiffnesses beyond all bounds in the scene"
        ) from error


def no_sets(network: Network, bricks: int, held: int, *, sets: int = 0) -> Fields:
    """Return the fields of no grip set at all that would hold some nodes: their shapes.

    ``sets``: of so many, all zero, as of the empty site, which one set of no grips holds.
    """
    counts = _counts_of_fields(network, bricks)
    empty = {name: np.zeros((sets, count, *SHAPES[name])) for name, count in counts.items()}
    none = np.zeros((sets, held, 3))
    return Fields(grip_force=none, grip_moment=none.copy(), **empty)


def _counts_of_fields(network: Network, bricks: int) -> dict[str, int]:
    """Return the number of edges, nodes, ends, springs or bricks of each field."""
    edges, nodes = network.count_edges(bricks), network.count_nodes(bricks)
    ends, springs = len(network.springs.support), len(network.springs.since)
    return dict(zip(FLAGS, (edges, nodes, ends, springs, bricks), strict=True))


def select_sets(answer: Fields, which: Bools | Ints) -> Fields:
    """Return the fields of some grip sets."""
    return Fields(**{name: getattr(answer, name)[which] for name in _NAMES})


def _join_sets(parts: Sequence[Fields]) -> Fields:
    """Return the fields of the grip sets of several answers, one after the other."""
    return Fields(**{n: np.concatenate([getattr(part, n) for part in parts]) for n in _NAMES})


def _merge_sets(which: Bools, inside: Fields, outside: Fields) -> Fields:
    """Return the fields of grip sets, those of ``which`` (S,) from one answer, the rest not."""
    order = np.concatenate([np.flatnonzero(which), np.flatnonzero(~which)])
    return select_sets(_join_sets([inside, outside]), np.argsort(order))


class NamedEngine:
    """Base of engines, with a representation that names engine and structure.

    ``answered``: how many grip sets it was asked for in all, ``corrected``: of them those whose
    first answer had too few digits.
    """

    answered = corrected = 0

    def __init__(self, network: Network | Scene) -> None:
        self.network = network_of(network)  # whose nodes and edges the fields follow

    def __repr__(self) -> str:
        scene = self.network.scene
        return f"<{type(self).__name__} of {scene.name}: {len(scene.bricks)} bricks>"


class SerialEngine(NamedEngine, ABC):
    """Base of engines that solve grip sets one by one, each from scratch, with all fields."""

    @_failing_in_a_line()
    def solve(
        self,
        bricks: int,
        grips: ArrayLike,
        want: Want = Want.RESPONSES,
        moved: ArrayLike | None = None,
    ) -> Fields:
        """Return the fields of a partial structure for grip sets (S, r)."""
        columns = grip_columns(self.network, bricks, grips)
        self.answered += len(columns)
        compliance = read_compliance(self.network, columns, grips, moved)
        answers = [no_sets(self.network, bricks, columns.shape[1])]
        for i, held in enumerate(columns):
            own = compliance.select(slice(i, i + 1))
            answers.append(self._answer(bricks, held, own))
        return require_finite(_join_sets(answers), bricks, grips)

    @abstractmethod
    def _answer(self, bricks: int, columns: Ints, compliance: GripCompliance) -> Fields:
        """Return the fields of one grip set, whose columns are (r,)."""


class OpeningEngine(SerialEngine):
    """Base of the engine whose joints open, slip and break."""
