"""Schedules: sequences in which some grips are still to be chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import pandas as pd

from seqopt.arrays import Terse
from seqopt.errors import StepError
from seqopt.scene.scene import Scene
from seqopt.sequence.holds import holds
from seqopt.sequence.steps import Step, StepKind, check_sequence
from seqopt.showing import Shown, display

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


@dataclass(frozen=True, repr=False)
class Move(Terse):
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

    def require_pairs(self) -> None:
        """Raise a `StepError` if more than two moves, or two not neighboring, share a step.

        What ranks or compares candidates of moves needs that; what chooses states does not.
        """
        for step in self.steps:
            if len(step.moves) > 2 or (len(step.moves) == 2 and step.moves[1] != step.moves[0] + 1):
                raise StepError(
                    f"step {step.number}: moves {[m + 1 for m in step.moves]} are open at once; "
                    "for costs of moves at most two neighboring ones can be; give an aim"
                )

    def __repr__(self) -> str:
        counts = [len(move.candidates) for move in self.moves]
        nodes = f" from {min(counts)} to {max(counts)} nodes" if counts else ""
        what = f"{len(self.steps)} steps, {len(counts)} grips to choose{nodes}"
        return f"<Schedule {self.method} of {self.scene.name}: {what}>"

    def table(self) -> pd.DataFrame:
        """Return what is to be chosen.

        Returns
        -------
        pandas.DataFrame
            A row per open grip. Columns: ``move`` (from 1), ``robot``, ``step`` in which it takes
            the grip, ``to_step``, the last before it lets go, ``bricks`` that stand, ``newest``,
            the brick placed last, ``places``, whether the robot places it with this grip,
            ``candidates``, how many nodes it may take, and these ``nodes``.
        """
        open_holds = {hold.move: hold for hold in holds(self.scene, self.steps)}
        rows = [
            {
                "move": k + 1,
                "robot": move.robot,
                "step": move.step,
                "to_step": open_holds[k].last,
                "bricks": move.bricks,
                "newest": self.scene.placed[move.bricks - 1].name,
                "places": open_holds[k].places is not None,
                "candidates": len(move.candidates),
                "nodes": move.candidates,
            }
            for k, move in enumerate(self.moves)
        ]
        return pd.DataFrame(rows)

    def gantt(self, first: int = 1, last: int | None = None) -> Figure:
        """Draw the grips over the steps, a lane per robot; those to be chosen are hatched.

        Parameters
        ----------
        first, last : int, optional
            Numbers of the first and the last step that are drawn; by default all.

        Raises
        ------
        ExtraError
            If matplotlib is not installed (extra ``plot``).
        StepError
            If there are no such steps.
        """
        figure: Figure = display("gantt_picture")(self.scene, self.steps, None, (first, last))
        return figure

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
