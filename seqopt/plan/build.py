"""Views that all plans share: a table of grips, pictures of steps, and a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from seqopt._registry import Later, Shown, display, offered
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.engines.interface import Engine
from seqopt.errors import SceneError
from seqopt.network.network import Network
from seqopt.responses._tolerance import COLUMN, step_tolerance
from seqopt.responses.quantities import _props_table
from seqopt.responses.table import (
    Departure,
    Enough,
    LinearRange,
    _analyzed,
    _Columns,
    _table_of,
    grips_table,
    what_was_enough,
)
from seqopt.sequence.steps import Site, Step, _check_part
from seqopt.stability.standing import Standing
from seqopt.stability.verdict import ASSESSED, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from seqopt._files import Page

STEPS = Later("seqopt.stability._steps")  # where it is asked whether steps stand


class ShownBuild(Shown):
    """Base class of plans: builds whose grips are all chosen.

    A subclass says which ``engine`` computes its ``steps``, what it is called (``title``), its
    objective and what is proven of it in words (``result``), run times by stage (``seconds``, s),
    how every state must stand, if at all (``standing``), and where a part of a build begins.
    """

    engine: Engine
    steps: tuple[Step, ...]
    title: str
    result: str
    seconds: Mapping[str, float]
    standing: Standing | None
    _begin: Site | None

    @cached_property
    def departures(self) -> tuple[Departure, ...]:
        """The limits of the linear range that steps exceed: their responses are not valid."""
        return self._within.departures(self._columns)

    @cached_property
    def _columns(self) -> _Columns:
        return _analyzed(self.engine, self.steps)

    def responses(self) -> pd.DataFrame:
        """Return the responses of every step, as of `seqopt.analyze`.

        Of a schedule the robots whose grips were chosen are beside, as ``optimized_robot``. Raises
        `ProblemError` if a problem is given by its costs alone; so do the tables below.
        """
        return _table_of(self._columns)

    @cached_property
    def _within(self) -> LinearRange:
        return LinearRange(self.engine)

    @cached_property
    def enough(self) -> Enough:
        """The sufficient model of the steps, what others would change, what is not modeled."""
        return what_was_enough(self._within, {"": self._columns})

    def table(self) -> pd.DataFrame:
        """Return every grip of the build, for as long as it lasts.

        Result: a row per grip, by first step: ``robot``, ``from_step``, ``to_step``, ``brick``,
        ``node``, ``places`` (whether the robot places the brick with it), ``largest_force_N`` and
        ``at_step``, the step of that force.
        """
        return grips_table(self.engine.network.scene, self.steps, self.responses())

    def stability(self, mortar: Mortar | str) -> pd.DataFrame:
        """Return whether every step stands with a mortar, or its name, and by which margins.

        Margins take ten times as long as `verdicts` alone. Movements of the ground enter neither.
        Result: as of `seqopt.stability._steps.stability_table`.
        """
        results = STEPS.assess_steps(self.engine.network, self.steps, mortar, ASSESSED)
        table: pd.DataFrame = STEPS.stability_table(self.steps, results)
        return table

    def verdicts(self, mortar: Mortar | str = "dry") -> tuple[Verdict, ...]:
        """Return whether every step stands, without margins: in seconds; ``bond=PASCAL``, too."""
        asked = self.engine.network, self.steps, find_mortar(mortar)
        found: tuple[Verdict, ...] = STEPS.step_verdicts(*asked)
        return found

    def props(self) -> pd.DataFrame:
        """Return the forces of all props of the scene, and the steps in which they act.

        Result: a row per prop: ``node``, ``brick``, ``from_step``, ``to_step``,
        ``largest_force_N``, ``at_step``, and of one that only pushes ``least_push_N``, negative
        where it would have to pull; no rows where there are no props.
        """
        return _props_table(self.engine, self.steps)

    def tolerances(self) -> pd.DataFrame:
        """Return the tolerance of grip positions of every step, in the worst direction.

        Result: a row per step: ``tolerance_mm`` (infinite without grips), ``proven_mm``, up to
        which no robot exceeds its payload, and what ``stops`` grips from being farther off. Raises
        `ProblemError` for discrete elements, which are not linear in that.
        """
        found = [(step.number, step_tolerance(self.engine, step)) for step in self.steps]
        rows = [(k, 1e3 * each.distance, 1e3 * each.proven, each.what) for k, each in found]
        return pd.DataFrame(rows, columns=["step", COLUMN, "proven_mm", "stops"])

    def times(self) -> pd.DataFrame:
        """Return the earliest start and end times of all actions, in the order of the steps.

        Result: a row per step: ``step``, ``type``, ``bricks``, ``robots`` who act, ``node`` that is
        taken, from when the robot ``prepares_s`` and is ``ready_s`` (none for a release),
        ``start_s`` and ``end_s`` of what changes the structure, and how long it ``waits_s`` for the
        robot; where mortar cures, also for the mortar, which alone it ``cures_s``, and the
        ``joint`` that was the last to hold. Raises `StepError` if it is not known how long a robot
        takes that acts.
        """
        table: pd.DataFrame = self._in_time("times_table")
        return table

    @property
    def makespan(self) -> float | None:
        """The makespan of the build, s; None if durations are not known."""
        return float(self._in_time("step_times")[-1].end) if self._timed else None

    def _in_time(self, name: str) -> Any:
        return offered(name)(self.engine.network.scene, self.steps, self._waits, self._begin)

    @cached_property
    def _waits(self) -> Any:
        """The model of curing, from which steps wait; None without curing."""
        return offered("mortar_waits")(self.engine.network, self.standing)

    def reassigned(self) -> tuple[Step, ...]:
        """Return the same grips in the same order, assigned to robots with the least makespan.

        A robot may have a grip that it reaches, that is within its payload, and of which it has the
        same compliance. Raises `StepError` if it is not known how long robots take, or some have
        arms, whose postures count.
        """
        scene = self.engine.network.scene
        own: tuple[Step, ...] = offered("reassign")(
            scene, self.steps, self.responses(), self._waits, self._begin
        )
        return own

    def plot(
        self, step: int | Sequence[int] | None = None, *, forces: bool = False, magnify: float = 0.0
    ) -> Figure:
        """Draw steps of the build: bricks, and which robot holds which node.

        ``step``: numbers of steps, from 1; by default six that are spread over the build;
        ``forces``: whether to draw the network, colored by axial force, instead of the bricks;
        ``magnify``: how many times larger displacements are drawn than they are; by default not at
        all, and not with forces. Result: a notebook shows it; ``savefig`` writes it to a file.
        Raises `ExtraError` if matplotlib is not installed (extra ``plot``); `StepError` if there is
        no such step.
        """
        figure: Figure = display(ShownBuild, "plot")(
            self.engine, self.steps, step, forces=forces, magnify=magnify
        )
        return figure

    @property
    def _timed(self) -> bool:
        """Whether the makespan is known: of a part only if its beginning is."""
        whole = bool(self.steps) and self.steps[0].number == 1
        robots = self.engine.network.scene.robots
        known = bool(robots) and all(robot.durations is not None for robot in robots)
        return known and (whole or self._begin is not None)

    def gantt(
        self, first: int | None = None, last: int | None = None, *, seconds: bool | None = None
    ) -> Figure:
        """Draw the grips over the steps of the build: a lane per robot, a bar per grip.

        Where it is known how long robots take, over seconds: with what they prepare, hatched. Every
        bar names its brick and its node, says whether the robot places the brick or holds it, and
        is shaded by the force of the grip.

        ``first``, ``last``: numbers of the first and the last step that are drawn; by default all;
        ``seconds``: whether time goes along, by default if it is known. Raises `ExtraError` if
        matplotlib is not installed (extra ``plot``); `StepError` if there are no such steps.
        """
        scene, responses = self.engine.network.scene, self.responses()
        timed = self._timed if seconds is None else seconds
        clock = (self._waits, self._begin) if timed else None
        draw = display(ShownBuild, "gantt")
        figure: Figure = draw(scene, self.steps, responses, (first, last), clock)
        return figure

    def export(
        self,
        format: str = "tasks",  # noqa: A002  # the option's name
        source: Path | str | None = None,
        distance: float | None = None,
    ) -> str:
        """Return the build in a format of others, as of `seqopt.export`."""
        text: str = display(ShownBuild, "export")(self, None, format, source, distance)
        return text

    def report(self, *others: ShownBuild) -> Page:
        """Return a page that shows the build step by step, in three dimensions, tables and charts.

        If the scene is small, the fixed methods are shown next to the plan. ``*others``: plans for
        the same scene, to compare side by side; else a `ProblemError`. Result: a notebook shows it;
        ``save("report.html")`` writes it to a file, and ``open()`` shows it in a browser.
        """
        page: Page = display(ShownBuild, "report")(self, *others)
        return page


@dataclass(frozen=True, repr=False)
class GivenSequence(ShownBuild):
    """Steps that were not optimized: those of a fixed method, or of a file.

    Parameters
    ----------
    engine : Engine
        What computes the responses; it has the scene.
    steps : tuple of Step
        Of `seqopt.sequential`, `seqopt.cantilever` or `seqopt.read_plan`.
    title : str, optional
        What it is called beside others.
    standing : Standing, optional
        With what every state must stand: where mortar cures, steps wait for it.
    result : str, optional
        Where they come from, in words.

    Attributes
    ----------
    seconds : mapping of str to float
        Empty: nothing was searched.

    Raises
    ------
    SceneError, StepError
        If an argument is not an engine or not a list of steps, or the steps are impossible.

    Examples
    --------
    >>> import seqopt
    >>> engine = seqopt.make_engine("auto", seqopt.build_network(seqopt.load_scene("arch25")))
    >>> build = seqopt.GivenSequence(engine, seqopt.sequential(engine.network), "sequential")
    >>> build
    <GivenSequence sequential of arch25: 49 steps>
    >>> float(build.table()["largest_force_N"].max().round(1))
    406.1
    """

    engine: Engine
    steps: tuple[Step, ...]
    title: str = "sequence"
    seconds: Mapping[str, float] = field(default_factory=dict, compare=False, hash=False)
    standing: Standing | None = None
    result: str = "given, not optimized"
    _begin = None

    def __post_init__(self) -> None:
        if not isinstance(getattr(self.engine, "network", None), Network):
            kind = type(self.engine).__name__
            raise SceneError(f"a {kind} is not an engine; give seqopt.make_engine('auto', scene)")
        _check_part(self.engine.network.scene, self.steps)

    def __repr__(self) -> str:
        name = self.engine.network.scene.name
        return f"<GivenSequence {self.title} of {name}: {len(self.steps)} steps>"
