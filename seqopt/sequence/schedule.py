"""Schedules: sequences in which some grips are still to be chosen.

Candidates may be restricted to those near the working end, the two bricks placed last. Optima of
the restricted problem are heuristic for the whole, also if they are proven.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import groupby
from numbers import Integral
from operator import itemgetter
from typing import TYPE_CHECKING, ClassVar, NamedTuple, NoReturn

import networkx as nx
import numpy as np

from seqopt._registry import Shown, display
from seqopt.arrays import Bools, Ints, Terse
from seqopt.errors import ProblemError, StepError, did_you_mean
from seqopt.network.network import Network, PartKind
from seqopt.scene.scene import Scene, _hang_free
from seqopt.sequence.steps import AnyStep, Step, StepKind, check_sequence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RULE = re.compile(r"near:([0-9]+)")
_NEWEST = 2  # bricks that make the working end: a build from both ends has two of them


def near_rule(rule: str) -> str:
    """Return a rule that restricts candidates to nodes near the working end of a build, checked.

    ``near:12`` keeps the nodes of bricks that at most 12 joints part from the bricks placed last.
    """
    text = rule.strip() if isinstance(rule, str) else ""
    if _RULE.fullmatch(text) is None:
        hint = did_you_mean(str(rule).partition(":")[0], ("near",))
        raise StepError(f"candidates {rule!r}{hint}: give near:JOINTS, as near:12")
    return text


def _near_nodes(rule: str, scene: Scene, bricks: int, nodes: Sequence[int]) -> tuple[int, ...]:
    """Select the nodes that are near at a brick count by a rule, or else the nearest ones."""
    placed = scene.build_order[:bricks]
    graph = nx.Graph(j.bricks for j in scene.joints if {*j.bricks} <= {*placed})
    graph.add_nodes_from(placed)
    joints = nx.multi_source_dijkstra_path_length(graph, {*placed[-_NEWEST:]})
    away = {n: joints.get(scene.brick_of_node[n].name, math.inf) for n in nodes}
    limit = max(int(rule.partition(":")[2]), min(away.values(), default=0))
    return tuple(node for node in nodes if away[node] <= limit)


@dataclass(frozen=True)
class Hold:
    """One grip, from its first to its last step."""

    robot: int  # index among the scene's robots
    first: int  # number of the first step in which it is held
    last: int  # and of the last
    node: int | None  # None where it is still to be chosen
    move: int | None  # index of the move that chooses it, from 0; None where it is given
    places: int | None  # name of the brick that is placed with it in its first step


def holds(scene: Scene, steps: Sequence[AnyStep]) -> tuple[Hold, ...]:
    """Return every grip of a sequence or schedule with its steps, by robot, then by step."""
    out = []
    for robot in range(len(scene.robots)):
        grips = [(step.grips[robot], step) for step in steps]
        for grip, run in groupby(grips, key=itemgetter(0)):
            if grip is not None:
                during = [step for _, step in run]
                first, last = during[0], during[-1].number
                node = int(grip) if isinstance(grip, Integral) else None
                move = getattr(grip, "move", None)  # an open grip names its move
                newest = scene.placed[first.bricks - 1]
                held_before = node is not None and node not in newest.nodes  # a part of a build
                is_placing = first.kind is StepKind.PLACE and not held_before
                places = newest.name if is_placing else None
                out.append(Hold(robot, first.number, last, node, move, places))
    return tuple(out)


@dataclass(frozen=True)
class OpenGrip:
    """A grip to be chosen. ``move``: index of its move among the moves of the schedule, from 0."""

    move: int

    def __str__(self) -> str:
        return f"?{self.move + 1}"


ScheduledGrips = tuple[int | OpenGrip | None, ...]


@dataclass(frozen=True)
class OpenStep(AnyStep):
    """A step whose grips are nodes, open moves, or none."""

    grips: ScheduledGrips

    @cached_property
    def moves(self) -> tuple[int, ...]:
        """The moves that are open in this step, in order."""
        return tuple(sorted({grip.move for grip in self.grips if isinstance(grip, OpenGrip)}))


@dataclass(frozen=True, repr=False)
class Move(Terse):
    """One repositioning to be decided."""

    robot: str  # name of the robot that moves
    step: int  # in which it takes its grip
    bricks: int  # placed at that step
    candidates: tuple[int, ...]  # within reach, and held by no other robot while it stays


@dataclass(frozen=True, repr=False)
class Schedule(Shown):
    """A sequence with open moves.

    Parameters
    ----------
    method : str
        Name of the method that made it.
    scene : Scene
        What is built, and by which robots.
    steps : tuple of OpenStep
        Numbered from 1.
    moves : tuple of Move
        In the order in which they are made.
    left_out : str, optional
        How candidates were left out, in words; empty if all are open.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> schedule = seqopt.three_robot_loop(network)
    >>> schedule
    <Schedule three-robot of arch25: 90 steps, 22 grips to choose from 2 to 46 nodes>
    >>> schedule.steps[3].moves
    (0,)
    """

    method: str
    scene: Scene
    steps: tuple[OpenStep, ...]
    moves: tuple[Move, ...]
    left_out: str = ""

    begin: ClassVar[None] = None  # it builds from the empty site

    def names_robots(self, *, in_pairs: bool = False) -> bool:
        """Return whether steps say which robot holds: they do.

        ``in_pairs``: raise a `StepError` if more than two moves, or two not neighboring, share a
        step. What ranks or compares candidates of moves needs that; what chooses states does not.
        """
        for step in self.steps if in_pairs else ():
            if step.moves and step.moves[-1] - step.moves[0] > 1:
                raise StepError(
                    f"step {step.number}: moves {[m + 1 for m in step.moves]} are open at once; "
                    "to rank candidates at most two neighboring ones can be; take worst-ratio "
                    "or weighted"
                )
        return True

    def chosen(self, steps: Sequence[Step]) -> tuple[int, ...]:
        """Return the node that every move takes in a sequence."""
        grips = {step.number: step.grips for step in steps}
        found = dict[int, int | None]()
        for step in self.steps:
            for grip, node in zip(step.grips, grips[step.number], strict=True):
                if isinstance(grip, OpenGrip):
                    found[grip.move] = node
        return tuple(node for _, node in sorted(found.items()) if node is not None)

    def described(self, scene: Scene) -> dict[str, object]:
        """Return the rules, for a summary: there are none."""
        return {}

    def letting_go(self, scene: Scene, steps: Sequence[Step]) -> int:
        """Return the number of last steps that only release against rules: zero, without rules."""
        return 0

    def free(self) -> NoReturn:
        """Raise a `ProblemError`: steps are given."""
        raise ProblemError(
            f"schedule {self.method}: its steps are given; orders, parts of builds, and steps or "
            "regrips in a Pareto set, go with the free schedule"
        )

    def keeps_payloads(self, *, stands: bool) -> bool:
        """Return whether robots hold no more than their payloads: where states must stand."""
        return stands

    def team(self, scene: Scene) -> tuple[int, ...]:
        """Return the indices of the participating robots of a scene: all."""
        return tuple(range(len(scene.robots)))

    def relaxed(self, scene: Scene) -> tuple[str, ...]:
        """Return the default rules that are relaxed: there are none."""
        return ()

    def places(self, before: Ints, after: Ints) -> Bools:
        """Return which moves from levels to levels, (m,), place a brick."""
        kinds = [False, *(step.kind is StepKind.PLACE for step in self.steps)]
        return np.array(kinds)[after]

    def in_scene(self, scene: Scene) -> Schedule:
        """Return the same steps of another scene with the same bricks, nodes and robots."""
        return self if scene is self.scene else replace(self, scene=scene)

    def loosened(self, scene: Scene) -> Iterator[tuple[str, Schedule]]:
        """Yield relaxations: given steps have none."""
        yield from ()

    @property
    def has_pairs(self) -> bool:
        """Whether at most two moves, consecutive ones, share a step, so that moves form layers."""
        return all(step.moves[-1] - step.moves[0] <= 1 for step in self.steps if step.moves)

    def __repr__(self) -> str:
        counts = [len(move.candidates) for move in self.moves]
        nodes = f" from {min(counts)} to {max(counts)} nodes" if counts else ""
        what = f"{len(self.steps)} steps, {len(counts)} grips to choose{nodes}"
        return f"<Schedule {self.method} of {self.scene.name}: {what}>"

    def gantt(self, first: int | None = None, last: int | None = None) -> Figure:
        """Draw the grips over some steps, a lane per robot; those to be chosen are hatched."""
        figure: Figure = display(Schedule, "gantt")(self.scene, self.steps, None, (first, last))
        return figure

    def fill(self, nodes: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked sequence in which every move takes the node chosen for it."""
        if len(nodes) != len(self.moves):
            raise StepError(f"{len(nodes)} nodes for {len(self.moves)} moves; give one each")
        steps = []
        for s in self.steps:
            grips = tuple(nodes[g.move] if isinstance(g, OpenGrip) else g for g in s.grips)
            steps.append(Step(s.number, s.kind, s.bricks, grips))
        return check_sequence(self.scene, steps)


def thin(schedule: Schedule, rule: str) -> Schedule:
    """Return a schedule with the candidates near the working end alone, by a `near_rule`.

    It says what was left out.

    Examples
    --------
    >>> import seqopt
    >>> schedule = seqopt.three_robot_loop(seqopt.load_scene("arch25"))
    >>> thin(schedule, "near:3").left_out
    'near:3 keeps 173 of 492 candidates'
    """
    near, scene = near_rule(rule), schedule.scene
    moves = tuple(
        replace(move, candidates=_near_nodes(near, scene, move.bricks, move.candidates))
        for move in schedule.moves
    )
    kept, all_ = (sum(len(m.candidates) for m in some) for some in (moves, schedule.moves))
    if kept == all_:
        return schedule
    text = f"{near} keeps {kept:,} of {all_:,} candidates"
    return replace(schedule, moves=moves, left_out=text)


def islands(network: Network, bricks: int) -> tuple[frozenset[int], ...]:
    """Return the bricks of every part of a partial structure without joints to a ground end."""
    springs, placed = network.springs, network.scene.placed
    ties = springs.stiffness.any(axis=1)
    at_once = ties & (springs.since == springs.bodies[:, 1] + 1) & (springs.since <= bricks)
    if len(np.unique(springs.bodies[at_once, 1])) == bricks:  # each to what stood before
        return ()
    graph = network.partial(bricks, {*np.flatnonzero(~ties | (springs.since > bricks)).tolist()})
    of_node = dict(graph.nodes.data("brick"))
    found = []
    for part in nx.weakly_connected_components(graph):
        if not any(graph.nodes[node]["kind"] is PartKind.BASE for node in part):
            found.append(sorted({of_node[node] for node in part} - {-1}))
    return tuple(frozenset(placed[i].name for i in part) for part in sorted(found))


def check_support(
    network: Network, steps: Sequence[Step] | Sequence[OpenStep], moves: Sequence[Move] = ()
) -> None:
    """Require that every island is held at every step, for any choice of open grips."""
    on = network.scene.brick_of_node
    loose = cache(partial(islands, network))
    for step in steps:
        holds = []
        for grip in step.grips if loose(step.bricks) else ():
            nodes = moves[grip.move].candidates if isinstance(grip, OpenGrip) else (grip,)
            holds.append({on[node].name for node in nodes if node is not None})
        for island in loose(step.bricks):
            if not any(names and names <= island for names in holds):
                raise StepError(
                    f"step {step.number} ({step.kind.value}): {_hang_free(island)}, and no robot "
                    "is sure to hold on; place it later, or write a schedule in which one more "
                    "robot holds it"
                )


class _Carried(NamedTuple):
    """A brick that a robot places or removes."""

    step: int  # its number
    robot: int  # index among the scene's robots
    brick: int  # its name


def carried(scene: Scene, steps: Sequence[AnyStep]) -> Iterator[_Carried]:
    """Yield robot and brick of every transport in steps, whose grips may be open.

    The robot that removes a brick held it before: unknown if the first step removes one.
    """
    removals = {step.number - 1: step for step in steps if step.kind is StepKind.REMOVE}
    for hold in holds(scene, steps):
        if hold.places is not None:
            yield _Carried(hold.first, hold.robot, hold.places)
        if (step := removals.get(hold.last)) is not None:  # in which nobody else lets go
            yield _Carried(step.number, hold.robot, scene.placed[step.bricks].name)
