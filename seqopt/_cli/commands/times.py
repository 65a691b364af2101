"""The command ``times``: who does what when in a build, and how long that takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from seqopt._cli import grammar, inputs, options, outputs, remarks
from seqopt._cli.answer import Answer
from seqopt._cli.terminal import wrapped
from seqopt._files import csv_text
from seqopt.arms._kept import arm_faults
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import ProblemError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.build import GivenSequence
from seqopt.sequence.steps import Step, _idle_note
from seqopt.times._durations import has_durations
from seqopt.times._step_check import check_cured
from seqopt.times._tables import busy_table, spent_lines, total_lines

USUAL_SECONDS = "fetch=30,place=10,approach=10,grip=5,release=5"


class Times(options.Cured, options.Timed, options.Fixed):
    """Which steps may a build have?

    reassign :
        give the same grips, in the same order, to the robots with which the build ends first,
        within their reach and payload

    What must hold?
    --stands, --friction and --tilt go with --curing alone.

    What is written and printed?
    out : DIR
        folder to write plan.csv, times.csv and a chart to
    """

    reassign: bool = False


def run(asked: Times) -> Answer:
    """Say how long a build takes and who does what when.

    A robot that holds nothing prepares what it does next while others hold and act; actions come
    one after the other, in the order of the steps.

    Usage
    [SCENE] [--method NAME] [--out DIR] [other options]
    [SCENE] --plan FILE [--out DIR] [other options]
    PLAN_DIR [--out DIR] [other options]

    Examples
    --------
    seqopt times timed.json --method cantilever --durations rob3:slower=2.5
    seqopt times my.json --plan plan.csv --reassign --out faster
    """
    outputs.require_out(asked, "plan.csv", "times.csv")
    scene, taken = inputs.find_scene(asked), tuple[str, ...]()
    if not (asked.durations or has_durations(scene)):
        asked = replace(asked, durations=(USUAL_SECONDS,))
        taken = (f"durations: not known, taken as {USUAL_SECONDS}; --durations says others",)
    scene = inputs.in_seconds(asked, scene)
    named = inputs.find_steps(asked, network := build_network(scene))
    build, given, least = _build(asked, network, named.steps)
    timed = build.times()
    written, where = _write(asked, build)
    timed.attrs["robots"] = busy = busy_table(scene, build.steps, build._waits)
    lines = [*total_lines(scene.name, len(build.steps), given, least)]
    lines += [*remarks.waits_said(build), *spent_lines(busy)]
    lines.append(where)
    trouble = inputs.posture_trouble(asked, scene)
    cannot = (f"not checked; {trouble}",) if trouble else arm_faults(scene, build.steps)
    notes = (*taken, *named.notes, *remarks.carrying_notes(scene, build.steps))
    notes += (*_idle_note(scene, "robots", build.steps), *(f"arms: {each}" for each in cannot))
    facts: dict[str, Any] = {"makespan_s": given, "reassigned_s": least}
    facts |= {"robots": busy, "steps": timed}
    facts |= {"arms_cannot": cannot} if cannot else {}
    answer = Answer(
        facts, "\n".join(map(wrapped, lines)), notes=(*notes, *outputs.figure_notes(written))
    )
    return replace(answer, scene=scene, written=written, value=timed)


def _write(asked: Times, build: GivenSequence) -> tuple[tuple[Path, ...], str]:
    """Write the tables and the chart of a build, if requested, and say where."""
    tables = {"plan.csv": build.responses, "times.csv": build.times}

    def files() -> dict[str, bytes | str]:
        texts = {name: csv_text(table()) for name, table in tables.items()}
        return {**texts, **outputs.time_files(build)}

    if written := outputs.write_outputs(asked, files):
        return written, f"written to {asked.path}: {', '.join(tables)}"
    return (), "--out DIR writes when every step happens, and a chart of it"


def _build(
    asked: Times, network: Network, steps: Sequence[Step]
) -> tuple[GivenSequence, float, float | None]:
    """Return a build, its makespan, s, and that of the best assignment, if requested."""
    standing = grammar.parse_standing(asked)
    if standing is not None and not asked.curing:
        raise ProblemError("--stands: it goes with --curing here; seqopt assess says what stands")
    build = GivenSequence(make_engine(USUAL, network), (*steps,), standing=standing)
    try:
        given = float(build.times()["end_s"].iloc[-1])
    except StepError as error:
        if standing is None and "durations" not in str(error):
            raise
        where = "--durations" if "durations" in str(error) else "--curing"
        raise ProblemError(f"{where}: {error}") from None
    least = None
    if asked.reassign:
        build = GivenSequence(build.engine, build.reassigned(), standing=standing)
        least = build.times()["end_s"].iloc[-1]
    if standing is not None:
        check_cured(network, build.steps, standing, build.times()["start_s"].tolist())
    return build, given, least
