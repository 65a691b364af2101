"""The command ``assess``: does every step stand, and with what margins."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict

import pandas as pd

from seqopt._cli.answer import Answer, Status
from seqopt._cli.asked import asked_scene, asked_steps, scene_facts
from seqopt._cli.loading import LOADS, answer_load_factor
from seqopt._cli.mapping import MAP, answer_map
from seqopt._cli.options import (
    BUILT,
    HOLDS,
    MOVES,
    PROVES,
    STEPS_USAGE,
    WRITTEN,
    declare,
    form_options,
    scene_options,
    steps_options,
)
from seqopt._cli.outputs import keep_apart, put_table
from seqopt._cli.rows import Rows
from seqopt._cli.screens import question
from seqopt._cli.values import MOST_WORKERS, asked_mortar, count_word
from seqopt.contact.mortar import Mortar
from seqopt.engines.registry import versions
from seqopt.errors import ProblemError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.scene_file import dump_scene
from seqopt.sequence.steps import Step
from seqopt.stability._step_verdicts import each_stability, find_margins, format_rows, stability_row
from seqopt.stability.assessment import MARGINS, Verdict
from seqopt.work.progress import with_progress

DESCRIPTION = (
    "Prove of every step of a sequence that it stands, or that it does not, as rigid bricks whose "
    "joints may open and slide, and say which brick and joint fail first. On request also how much "
    "bond, friction and robot force a step needs, and which tilt it survives."
)
USAGE = (*STEPS_USAGE, "[SCENE] --map AXIS [--out DIR] [other options]")
EXAMPLES = (
    "seqopt assess arch25 --method cantilever --out stands.csv",
    "seqopt assess arch25 --method sequential --mortar dry --margins bond,tilt",
    "seqopt assess arch25 --method sequential --steps 40:49",
    "seqopt assess arch:span=2,rise=0.8 --map friction --out map",
)


STRENGTH = {
    "--friction F": "coefficient of friction, in place of the mortar's own",
    "--tensile-strength PA": "what a joint holds in tension, Pa, in place of the mortar's own",
    "--cohesion PA": "what a joint holds in shear without any pressure, Pa, in place of the "
    "mortar's own",
}
HOW = {
    "--margins NAMES": f"margins beside the verdicts: {', '.join(MARGINS)} or all, with commas "
    "between them; each takes several times as long (default: none; with --steps: all)",
    "--steps FROM:TO": "steps of which margins are found, as 40:60 (default: all)",
}
WORKERS = {"--workers N": "processes to share the steps among (default: 1)"}
OUT = {"--out FILE": "CSV file to write (default: standard output); with --map a folder"}
OF_HOLDS = "With --map, --holds says what is in the joints."
OF_ASKED = "One of: --margins with --steps, --load-factor, and --map with --holds."


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``assess``."""
    scene_options(question(command, BUILT))
    steps_options(question(command, MOVES))
    holds = question(command, HOLDS, OF_HOLDS)
    holds.add_argument(
        "--mortar",
        default="epoxy",
        help="what is in the joints: the epoxy of Bruun et al. (25°, 3 MPa, 2 MPa), dry (nothing), "
        "or bond=STRENGTH (Pa) (default: %(default)s)",
    )
    declare(holds, STRENGTH)
    declare(question(command, "What is asked beside verdicts?", OF_ASKED), HOW | LOADS | MAP)
    declare(question(command, PROVES), WORKERS)
    declare(question(command, WRITTEN), OUT)
    form_options(command)


def run(options: argparse.Namespace) -> Answer:
    """Assess every step of a sequence, or map builds; tables are written whatever the verdicts."""
    if options.map is not None:
        return answer_map(options)
    if options.load_factor:
        return answer_load_factor(options)
    keep_apart(options, options.out)
    scene, mortar = asked_scene(options), asked_mortar(options)
    network = build_network(scene)
    steps = asked_steps(options, network)
    rows = _found(options, network, steps, mortar)
    table = pd.DataFrame(rows.rows)
    went_on = f"kept: {rows.taken_up} of {len(table)} steps, found before, from {rows.path}"
    answer = put_table(options.out, table, f"{format_rows(table)};")
    rows.done()
    found = {verdict: table["verdict"] == verdict.value for verdict in Verdict}
    unsure = table["step"][found[Verdict.UNDECIDED]]
    said = f"steps {', '.join(map(str, unsure))} are undecided; this says nothing about them"
    status = Status.DOES_NOT_HOLD if found[Verdict.FALLS].any() else Status.DONE
    return Answer(
        facts={
            "scene": scene_facts(scene),
            "mortar": asdict(mortar),
            "versions": versions(),
            "verdicts": {verdict.value: int(each.sum()) for verdict, each in found.items()},
            "steps": table,
        },
        **answer,
        notes=(went_on,) if rows.taken_up else (),
        failures=(f"seqopt: solver failed: {said}",) if len(unsure) else (),
        status=Status.FAILED if len(unsure) else status,
    )


def _found(
    options: argparse.Namespace, network: Network, steps: Sequence[Step], mortar: Mortar
) -> Rows:
    """Return the rows of all steps; those that were kept of an earlier run are taken up."""
    margins, at = _asked_margins(options, steps)
    workers = count_word(options.workers, "--workers", MOST_WORKERS, usual=1)
    asked = dump_scene(network.scene), steps, mortar, margins, at, versions()
    rows = Rows(options.out, asked)
    left = steps[len(rows.rows) :]
    told = with_progress("assessing steps", left, options.tell)
    found = each_stability(network, left, mortar, margins, at, (None, workers))
    try:
        for step, result in zip(told, found, strict=True):
            rows.add(stability_row(step, result))
    except KeyboardInterrupt:
        raise KeyboardInterrupt(rows.where(len(steps), "steps")) from None
    return rows


def _asked_margins(
    options: argparse.Namespace, steps: Sequence[Step]
) -> tuple[tuple[str, ...], range]:
    """Return which margins are asked for, and the numbers of which steps."""
    margins = find_margins(options.margins or ("all" if options.steps else ()))
    if options.steps is None:
        return margins, range(1, len(steps) + 1)
    first, colon, last = options.steps.partition(":")
    ends = (first or "1", (last or str(len(steps))) if colon else first)
    try:
        start, end = (count_word(end, "--steps", len(steps)) for end in ends)
    except ProblemError as error:
        wrong = f"--steps {options.steps}: give numbers from 1 to {len(steps)}, as 3:7"
        raise ProblemError(wrong) from error
    if end < start:
        raise ProblemError(f"--steps {options.steps}: the first is after the last; exchange them")
    return margins, range(start, end + 1)
