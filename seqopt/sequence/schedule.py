"""Schedules: sequences in which some grips are still to be chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from seqopt.errors import StepError
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind, check_sequence


@dataclass(frozen=True)
class OpenGrip:
    """A grip to be chosen.

    Parameters
    ----------
    move : int
        Index of its move among the moves of the schedule, from 0.
    """

    move: int

    def __str__(self) -> str:
        return f"?{self.move + 1}"


ScheduledGrips = tuple[int | OpenGrip | None, ...]


@dataclass(frozen=True)
class OpenStep:
    """A step whose grips are nodes, open moves, or none.

    Parameters
    ----------
    number : int
        From 1.
    kind : StepKind
        What the step does.
    bricks : int
        How many bricks stand, in build order.
    grips : tuple of (int, OpenGrip or None)
        What each of the scene's robots holds: a node, a grip to be chosen, or nothing.
    """

    number: int
    kind: StepKind
    bricks: int
    grips: ScheduledGrips

    @cached_property
    def moves(self) -> tuple[int, ...]:
        """The moves that are open in this step, in order."""
        return tuple(sorted({grip.move for grip in self.grips if isinstance(grip, OpenGrip)}))


@dataclass(frozen=True)
class Move:
    """One repositioning to be decided.

    Parameters
    ----------
    robot : str
        Name of the robot that moves.
    step : int
        Number of the step in which it takes its grip.
    bricks : int
        Bricks placed at that step.
    candidates : tuple of int
        Nodes open to it: within reach, and held by no other robot while it stays.
    """

    robot: str
    step: int
    bricks: int
    candidates: tuple[int, ...]


@dataclass(frozen=True)
class Schedule:
    """A sequence with open moves; at most two neighboring moves are open in one step.

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
        What was done to look at fewer candidates than there are; empty where all are open.

    Raises
    ------
    StepError
        If more than two moves are open in one step, or two that are not neighbors.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> schedule = seqopt.three_robot_loop(network)
    >>> len(schedule.steps), len(schedule.moves)
    (90, 22)
    >>> schedule.steps[3].moves
    (0,)
    """

    method: str
    scene: Scene
    steps: tuple[OpenStep, ...]
    moves: tuple[Move, ...]
    left_out: str = ""

    def __post_init__(self) -> None:
        for step in self.steps:
            if len(step.moves) > 2 or (len(step.moves) == 2 and step.moves[1] != step.moves[0] + 1):
                raise StepError(
                    f"step {step.number}: moves {[m + 1 for m in step.moves]} are open at once; "
                    "at most two neighboring ones can be"
                )

    @cached_property
    def steps_of(self) -> Mapping[tuple[int, ...], tuple[OpenStep, ...]]:
        """The steps by the moves that are open in them, in order."""
        found: dict[tuple[int, ...], list[OpenStep]] = {}
        for step in self.steps:
            found.setdefault(step.moves, []).append(step)
        return {moves: tuple(steps) for moves, steps in found.items()}

    def fill(self, nodes: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked sequence in which every move takes the node chosen for it.

        Parameters
        ----------
        nodes : sequence of int
            A node for every move.

        Returns
        -------
        tuple of Step
            As many as the schedule has.

        Raises
        ------
        StepError
            If there is not one node per move, or a step is impossible with them.
        """
        if len(nodes) != len(self.moves):
            raise StepError(f"{len(nodes)} nodes for {len(self.moves)} moves; give one each")
        steps = [
            Step(
                step.number,
                step.kind,
                step.bricks,
                tuple(nodes[g.move] if isinstance(g, OpenGrip) else g for g in step.grips),
            )
            for step in self.steps
        ]
        return check_sequence(self.scene, steps)
