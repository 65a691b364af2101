"""The command ``times``: who does what when in a build, and how long that takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from seqopt._cli import grammar, inputs, options, outputs, remarks
from seqopt._cli.answer import Answer
from seqopt._cli.terminal import wrapped
from seqopt._files import csv_text
from seqopt.arms._kept import arm_faults
from seqopt.contact.curing import _find_curing
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import ProblemError, SceneError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.build import GivenSequence
from seqopt.sequence.steps import Step, _idle_note
from seqopt.times._durations import has_durations
from seqopt.times._step_check import check_cured
from seqopt.times._steps import step_times
from seqopt.times._tables import aged_table, busy_table, softer_lines, spent_lines, total_lines

USUAL_SECONDS = "fetch=30,place=10,approach=10,grip=5,release=5"


class Times(options.Cured, options.Timed, options.Fixed):
    """Say how long a build takes and who does what when.

    A robot that holds nothing prepares what it does next while others hold and act; actions come
    one after the other, in the order of the steps.

    Usage
    [SCENE] [--method NAME] [--out DIR] [other options]
    [SCENE] --plan FILE [--out DIR] [other options]
    PLAN_DIR [--out DIR] [other options]

    Which steps may a build have?
    reassign :
        give the same grips, in the same order, to the robots with which the build ends first,
        within their reach and payload

    What must hold?
    --stands, --friction and --tilt go with --curing alone.

    stiffens : WORDS
        which share of its stiffness a joint has at an age, in the words of --curing, from 0 s on,
        as 0s=0.05,15min=1: responses of every step with joints as stiff as they are when it begins,
        beside the payloads

    What is written and printed?
    out : DIR
        folder to write plan.csv, times.csv and a chart to

    Examples
    --------
    seqopt times timed.json --method cantilever --durations rob3:slower=2.5
    seqopt times my.json --plan plan.csv --reassign --out faster
    """

    reassign: bool = False
    stiffens: options.Words = ()


def run(asked: Times) -> Answer:
    """Return the makespan of a build, and write its schedule on request."""
    outputs.require_out(asked, "plan.csv", "times.csv")
    scene, taken = inputs.find_scene(asked), list[str]()
    if not (asked.durations or has_durations(scene)):
        asked = replace(asked, durations=(USUAL_SECONDS,))
        taken.append(f"durations: not known, taken as {USUAL_SECONDS}; --durations says others")
    scene = inputs.in_seconds(asked, scene)
    network = build_network(scene)
    named = inputs.find_steps(asked, network)
    build, given, least = _build(asked, network, named.steps)
    timed, aged = build.times(), _aged(asked, build)
    tables = {"plan.csv": build.responses, "times.csv": build.times}
    tables |= {} if aged is None else {"aged.csv": lambda: aged}

    def files() -> dict[str, bytes | str]:
        texts = {name: csv_text(table()) for name, table in tables.items()}
        return {**texts, **outputs.time_files(build)}

    written = outputs.write_outputs(asked, files)
    busy = busy_table(scene, build.steps, build._waits)
    timed.attrs["robots"] = busy
    if build.standing is not None:
        check_cured(network, build.steps, build.standing, timed["start_s"].tolist())
    total = total_lines(scene.name, len(build.steps), given, least)
    lines = [*total, *remarks.waits_said(build), *spent_lines(busy)]
    if aged is not None:
        lines += softer_lines(scene, build.responses(), aged, remarks.exceeded(scene, aged))
    kept = f"written to {asked.path}: {', '.join(tables)}"
    lines.append(kept if written else "--out DIR writes when every step happens, and a chart of it")
    trouble = inputs.posture_trouble(asked, scene)
    cannot = (f"not checked; {trouble}",) if trouble else arm_faults(scene, build.steps)
    notes = (*taken, *named.notes, *remarks.carrying_notes(scene, build.steps))
    notes += (*_idle_note(scene, "robots", build.steps),)
    facts: dict[str, object] = {"makespan_s": given, "reassigned_s": least}
    facts |= {"robots": busy, "steps": timed}
    facts |= ({} if aged is None else {"aged": aged}) | ({"arms_cannot": cannot} if cannot else {})
    return Answer(
        facts,
        scene=scene,
        text="\n".join(map(wrapped, lines)),
        written=written,
        value=timed,
        notes=(*notes, *(f"arms: {each}" for each in cannot), *outputs.figure_notes(written)),
    )


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
    if not asked.reassign:
        return build, given, None
    build = GivenSequence(build.engine, build.reassigned(), standing=standing)
    return build, given, build.times()["end_s"].iloc[-1]


def _aged(asked: Times, build: GivenSequence) -> pd.DataFrame | None:
    """Return the responses of a build with the stiffness of joints at their age, if requested."""
    if not asked.stiffens:
        return None
    network = build.engine.network
    times = step_times(network.scene, build.steps, build._waits)
    try:
        return aged_table(network, build.steps, times, _find_curing(asked.stiffens))
    except SceneError as error:
        raise SceneError(f"--stiffens: {error}") from None
