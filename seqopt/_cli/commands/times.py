"""The command ``times``: who does what when in a build, and how long that takes."""

from __future__ import annotations

from typing import Annotated, Any

from seqopt._cli import outputs, remarks
from seqopt._cli.answer import Answer
from seqopt._cli.inputs import Sequenced, posture_trouble, read_steps
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Folder, in_seconds
from seqopt._files import csv_text
from seqopt.arms._kept import arm_faults
from seqopt.contact.mortar import Mortar
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import ProblemError, StepError
from seqopt.network.build import build_network
from seqopt.plan.build import GivenSequence
from seqopt.problem.standing import Standing
from seqopt.sequence.steps import _idle_note
from seqopt.times._step_check import check_cured
from seqopt.times._tables import busy_table
from seqopt.work.progress import Tell

_SPENT = ("prepares", "acts", "holds", "idle")  # how a robot spends its time
USUAL_SECONDS = "fetch=30,place=10,approach=10,grip=5,release=5"


def times(
    asked: Annotated[Call, ("call", read_steps)],
    *,
    stands: Standing | Mortar | str | None = None,
    reassign: bool = False,
    out: Folder = None,
    progress: Tell,
) -> Answer:
    """Say how long a build takes and who does what when.

    A robot that holds nothing prepares what it does next while others hold and act; actions come
    one after the other, in the order of the steps. --stands, --friction and --tilt go with --curing
    alone.

    Parameters
    ----------
    stands : optional
        As of `optimize`.
    reassign : bool, optional
        Give the same grips, in the same order, to the robots with which the build ends first,
        within their reach and payload.
    out : pathlib.Path, optional
        Folder to write plan.csv, times.csv and a chart to.

    Examples
    --------
    $ seqopt times timed.json --method cantilever --durations rob3:fetch=75
    $ seqopt times my.json --plan plan.csv --reassign --out faster
    """
    output = Output(out, asked.words.get("scene"), asked.words.get("plan"))
    output.require("plan.csv", "times.csv")
    named, taken = asked(progress=progress), tuple[str, ...]()
    if not all(robot.durations for robot in named.scene.robots):
        built = in_seconds(named.scene, (USUAL_SECONDS,))
        named = named._replace(network=build_network(built))
        taken = (f"durations: not known, taken as {USUAL_SECONDS}; --durations says others",)
    demanded, built = stands if isinstance(stands, Standing) else None, named.scene
    build, given, least = _build(named, demanded, reassign=reassign)
    timed, tables = build.times(), {"plan.csv": build.responses, "times.csv": build.times}

    def files() -> dict[str, bytes | str]:
        texts = {name: csv_text(table()) for name, table in tables.items()}
        return {**texts, **outputs.picture("times", lambda _: build.gantt())}

    where = "--out DIR writes when every step happens, and a chart of it"
    if written := output.write(progress, files):
        where = f"written to {out}: {', '.join(tables)}"
    busy = busy_table(built, build.steps, build._waits)
    lines = [f"{built.name}: {len(build.steps)} steps take {given:.6g} s"]
    if least is not None:
        lines.append(f"the same grips by other robots: {least:.6g} s, the least")
    lines += remarks.waits_said(build)
    for row in busy.to_dict("records"):
        spent = (f"{what} {row[f'{what}_s']:.6g} s" for what in _SPENT)
        lines.append(f"  {row['robot']}: {', '.join(spent)}")
    lines.append(where)
    trouble = posture_trouble(built, asked.words.get("cache"), progress)
    cannot = (f"not checked; {trouble}",) if trouble else arm_faults(built, build.steps)
    notes = (*taken, *named.notes, *remarks.carrying_notes(built, build.steps))
    notes += (*_idle_note(built, "robots", build.steps), *(f"arms: {each}" for each in cannot))
    notes += outputs.figure_notes(written)
    facts: dict[str, Any] = {"makespan_s": given, "reassigned_s": least}
    facts |= {"robots": busy, "steps": timed}
    facts |= {"arms_cannot": cannot} if cannot else {}
    text = "\n".join(map(wrapped, lines))
    return Answer(facts, text, notes=notes, scene=built, written=written)


def _build(
    named: Sequenced, standing: Standing | None, *, reassign: bool
) -> tuple[GivenSequence, float, float | None]:
    """Return a build, its makespan, s, and that of the best assignment, if requested."""
    if standing is not None and standing.curing is None:
        raise ProblemError(
            "--stands: here it goes with --curing of mortar that has a bond; seqopt assess says "
            "what stands"
        )
    engine = make_engine(USUAL, named.network)
    build = GivenSequence(engine, named.steps, named.name, standing=standing)
    try:
        given = float(build.times()["end_s"].iloc[-1])
    except StepError as error:
        if standing is None and "durations" not in str(error):
            raise
        where = "--durations" if "durations" in str(error) else "--curing"
        raise ProblemError(f"{where}: {error}") from None
    least = None
    if reassign:
        build = GivenSequence(build.engine, build.reassigned(), standing=standing)
        least = build.times()["end_s"].iloc[-1]
    if standing is not None:
        check_cured(named.network, build.steps, standing, build.times()["start_s"].tolist())
    return build, given, least
