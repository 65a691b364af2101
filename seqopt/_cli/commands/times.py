"""The command ``times``: who does what when in a build, and how long that takes."""

from __future__ import annotations

from typing import Annotated, Any

from seqopt._cli.answer import Answer
from seqopt._cli.outputs import read_build
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Folder
from seqopt.arms._kept import arm_faults, posture_trouble
from seqopt.exchange._files import Output, csv_text
from seqopt.problem.requirements import _carrying_excesses
from seqopt.report._folders import figure_notes, picture_files
from seqopt.sequence.steps import _idle_note
from seqopt.times._build import USUAL_SECONDS, times, with_usual_durations
from seqopt.times._tables import busy_said, busy_table, waits_said
from seqopt.work import Tell


def run(asked: Annotated[Call, ("call", times)], *, out: Folder = None, progress: Tell) -> Answer:
    """Say how long a build takes and who does what when.

    A robot that holds nothing prepares what it does next while others hold and act; actions come
    one after the other, in the order of the steps. --stands, --friction and --tilt go with --curing
    alone.

    Parameters
    ----------
    out : pathlib.Path, optional
        Folder to write plan.csv, times.csv and a chart to.

    Examples
    --------
    $ seqopt times timed.json --method cantilever --durations rob3:fetch=75
    $ seqopt times my.json --plan plan.csv --reassign --out faster
    """
    words = {name: word for name, word in asked.words.items() if name != "reassign"}
    output = Output(out, words.get("scene"), words.get("plan"))
    output.require("plan.csv", "times.csv")
    (found, notes), least = read_build(words, progress), None
    given = with_usual_durations(found)
    if given is not found:
        notes = (f"durations: not known, taken as {USUAL_SECONDS}; --durations says others", *notes)
    built = given.engine.network.scene
    build = Call(times, words)(scene=given, progress=progress)
    makespan = build.makespan
    if asked.words.get("reassign"):
        build = Call(times, words)(scene=build, reassign=True, progress=progress)
        least = build.makespan
    timed, tables = build.times(), {"plan.csv": build.responses, "times.csv": build.times}

    made = dict[str, bytes | str]()

    def files() -> dict[str, bytes | str]:
        made.update({name: csv_text(table()) for name, table in tables.items()})
        made.update(picture_files("times", lambda _: build.gantt()))
        return made

    where = "--out DIR writes when every step happens, and a chart of it"
    if written := output.write(progress, files):
        where = f"written to {out}: {', '.join(made)}"
    busy = busy_table(built, build.steps, build._waits)
    lines = [f"{built.name}: {len(build.steps)} steps take {makespan:.6g} s"]
    if least is not None:
        lines.append(f"the same grips by other robots: {least:.6g} s, the least")
    lines += (*waits_said(build), *busy_said(busy), where)
    trouble = posture_trouble(built, words.get("cache"), progress)
    cannot = (f"not checked; {trouble}",) if trouble else arm_faults(built, build.steps)
    carried = _carrying_excesses(built, build.steps)
    notes += tuple(f"payload exceeded: {excess}" for excess in carried)
    notes += (*_idle_note(built, "robots", build.steps), *(f"arms: {each}" for each in cannot))
    notes += figure_notes() if written else ()
    facts: dict[str, Any] = {"makespan_s": makespan, "reassigned_s": least}
    facts |= {"robots": busy, "steps": timed}
    facts |= {"arms_cannot": cannot} if cannot else {}
    text = "\n".join(map(wrapped, lines))
    return Answer(facts, text, notes=notes, scene=built, written=written)
