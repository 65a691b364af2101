"""The command ``assess``: does every step stand, and with what margins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from seqopt._cli import grammar, inputs, options, outputs, remarks
from seqopt._cli.answer import Answer, Status
from seqopt._cli.terminal import wrapped
from seqopt._files import csv_text
from seqopt._later import Later
from seqopt._showing import PAGE
from seqopt.contact.mortar import Mortar, _mortar_name, _with_mortar
from seqopt.engines.registry import USUAL, make_engine, versions
from seqopt.errors import ProblemError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.problem.requirements import number_word
from seqopt.responses.quantities import _steps_in_words
from seqopt.sequence.steps import Step
from seqopt.stability._steps import each_stability, find_margins, format_rows, stability_row
from seqopt.stability.assessment import Verdict
from seqopt.stability.failure_map import AXES, failure_map
from seqopt.work.progress import with_progress

MAP = Later("seqopt.report._failures")  # 24 ms, of pages
STEEPEST = 45.0  # degrees


class Assess(options.Fixed):
    """What must hold?

    With --map, --holds says what is in the joints.

    mortar : MORTAR
        what is in the joints: the epoxy of Bruun et al. (25°, 3 MPa, 2 MPa), dry (nothing), or
        bond=STRENGTH (Pa) (default: dry, then epoxy, which alone decides the exit status)
    friction : F
        coefficient of friction, in place of the mortar's own
    tensile_strength : PA
        what a joint holds in tension, Pa, in place of the mortar's own
    cohesion : PA
        what a joint holds in shear without any pressure, Pa, in place of the mortar's own

    What is asked beside verdicts?
    Either --margins with --steps, or --map with --holds.

    margins : NAMES
        margins beside the verdicts: {margins} or all, with commas between them; each takes several
        times as long (default: none; with --steps: all)
    steps : FROM:TO
        steps of which margins are found, as 40:60 (default: all)
    map : AXIS
        map where builds fail, over what holds their joints and over friction or tilt (degrees),
        with values of your own as tilt=0,2,5; of the fixed methods, a loop and a free schedule, or
        of --method or --plan alone
    holds : NAMES
        with --map: what holds the joints, of dry, bond=STRENGTH (Pa) and epoxy, with commas between
        them (default: dry,epoxy)

    Who chooses and proves, and how long?
    workers : N
        processes to share the steps among (default: 1)
    cache : DIR
        where robots have arms: keep their postures there, and use what is there

    What is written and printed?
    out : FILE
        CSV file to write (default: standard output); with --map a folder
    """

    mortar: Mortar | str | None = None
    margins: options.Words | None = None
    steps: str | None = None
    map: str | None = None
    holds: options.Words | None = None
    workers: int = options.word(1, most=options.MOST_WORKERS)
    friction: float | None = options.word(None, zero=True, shell=True)
    tensile_strength: float | None = options.word(None, zero=True, shell=True)
    cohesion: float | None = options.word(None, zero=True, shell=True)


def run(asked: Assess) -> Answer:
    """Prove of every step of a sequence that it stands, or that it does not.

    Bricks are rigid, and their joints may open and slide. Say which brick and joint fail first; on
    request also how much bond, friction and robot force a step needs, and which tilt it survives.

    Usage
    [SCENE] [--method NAME] [--out FILE] [other options]
    [SCENE] --plan FILE [--out FILE] [other options]
    PLAN_DIR [--out FILE] [other options]
    [SCENE] --map AXIS [--out DIR] [other options]

    Examples
    --------
    seqopt assess arch25 --method cantilever --out stands.csv
    seqopt assess arch25 --method sequential --mortar dry --margins bond,tilt
    seqopt assess arch25 --method sequential --steps 40:49
    seqopt assess arch:span=2,rise=0.8 --map friction --out map
    """
    if asked.map is not None:
        return _map(asked, asked.map, str(asked.holds or "dry,epoxy").split(","))
    outputs.keep_apart(asked, asked.path)
    scene, mortars = inputs.find_scene(asked), _mortars(asked)
    network = build_network(scene)
    _, steps, taken = inputs.find_steps(asked, network)
    rows, early = list[dict[str, Any]](), tuple[str, ...]()
    try:
        for row in _verdicts(asked, network, steps, mortars):
            rows.append(row)
    except KeyboardInterrupt:
        if not rows:
            raise
        total = len(mortars) * len(steps)
        early = (f"seqopt: interrupted; {len(rows)} of {total} verdicts were found",)
    notes = (*taken, *remarks.settlement_notes(scene), *remarks.carrying_notes(scene, steps))
    answer = replace(_answer(asked, mortars, rows), scene=scene, notes=notes)
    if not early:
        return answer
    return replace(answer, failures=(*answer.failures, *early), status=Status.INTERRUPTED)


def _answer(asked: Assess, mortars: Mapping[str, Mortar], rows: Sequence[dict[str, Any]]) -> Answer:
    """Write the verdicts, a row each, and return their answer."""
    each = {name: [row for row in rows if row["mortar"] == name] for name in mortars}
    lines = [f"{_with_mortar(name)}: {format_rows(own)}" for name, own in each.items() if own]
    found = {name: Counter(row["verdict"] for row in own) for name, own in each.items()}
    counts = {name: {v.value: own[v.value] for v in Verdict} for name, own in found.items()}
    facts: dict[str, Any] = {"mortar": {name: asdict(mortar) for name, mortar in mortars.items()}}
    facts |= {"versions": versions, "verdicts": counts, "steps": rows}
    falls = counts[[*mortars][-1]][Verdict.FALLS.value]  # of the mortar that decides
    status, failures = Status.DOES_NOT_HOLD if falls else Status.DONE, tuple[str, ...]()
    if undecided := [row["step"] for row in rows if row["verdict"] == Verdict.UNDECIDED.value]:
        unsure = _steps_in_words([*dict.fromkeys(undecided)])
        failures = (f"seqopt: solver failed: {unsure}: undecided; this says nothing about them",)
        status = Status.FAILED
    said = outputs.put_table(asked.path, rows, "\n".join(lines) + ";")
    return Answer(facts, **said, value=rows, failures=failures, status=status)


def _mortars(asked: Assess) -> dict[str, Mortar]:
    """Return mortars by name: the one requested, or dry joints and epoxy.

    The last one decides the exit status. Options replace its properties, and the friction of dry
    joints as well.
    """
    given = {
        name: value
        for name in ("friction", "tensile_strength", "cohesion")
        if (value := getattr(asked, name)) is not None
    }
    own = replace(grammar.parse_mortar(asked.mortar or "epoxy", "--mortar"), **given)
    dry = () if asked.mortar else (Mortar(friction=own.friction),)
    return {_mortar_name(mortar): mortar for mortar in (*dry, own)}


def _verdicts(
    asked: Assess, network: Network, steps: Sequence[Step], mortars: Mapping[str, Mortar]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of all steps, mortar by mortar."""
    margins, at = _margins(asked, steps)
    for name, mortar in mortars.items():
        told = with_progress(f"assessing steps, {_with_mortar(name)}", steps, asked.tell)
        found = each_stability(network, steps, mortar, margins, at, (None, asked.workers))
        for step, result in zip(told, found, strict=True):
            yield {"mortar": name, **stability_row(step, result)}


def _margins(asked: Assess, steps: Sequence[Step]) -> tuple[tuple[str, ...], range]:
    """Return the requested margins, and the numbers of their steps."""
    margins = find_margins(asked.margins or ("all" if asked.steps else ()))
    if asked.steps is None:
        return margins, range(1, len(steps) + 1)
    first, colon, last = asked.steps.partition(":")
    ends = (first or "1", (last or str(len(steps))) if colon else first)
    try:
        start, end = (grammar.parse_count(end, "--steps", len(steps)) for end in ends)
    except ProblemError as error:
        wrong = f"--steps {asked.steps}: give numbers from 1 to {len(steps)}, as 3:7"
        raise ProblemError(wrong) from error
    if end < start:
        raise ProblemError(f"--steps {asked.steps}: the first is after the last; exchange them")
    return margins, range(start, end + 1)


def _map(asked: Assess, over: str, holds: Sequence[str]) -> Answer:
    """Return the failure map of builds over an axis and the mortar of joints."""
    scene = inputs.find_scene(asked)
    axis, values = _axis(over)
    for name in holds:
        grammar.parse_mortar(name, "--holds")
    outputs.require_out(asked)
    network = build_network(scene)
    if asked.method is None and inputs.given_plan(asked) is None:
        builds, notes = MAP.usual_builds(scene, asked.tell)
    else:
        name, steps, _ = inputs.find_steps(asked, network)
        builds, notes = {name: steps}, []
    found = failure_map(scene, builds, holds, axis, values, asked.tell)

    def files() -> dict[str, bytes | str]:
        page = MAP.failure_page(make_engine(USUAL, network, None), builds, found)
        tables = {"map.csv": csv_text(found.cases), "map_steps.csv": csv_text(found.steps)}
        picture = outputs.picture("map", lambda charts: charts.failure_figure(found))
        return {**tables, PAGE: page, **picture}

    written = outputs.write_outputs(asked, files)
    blocks = MAP.failure_blocks(scene, found, wrapped)
    where = outputs.written_to(asked.path, tables="tables, a picture", what="how steps fall")
    falls = found.cases["fall"].any()
    return Answer(
        facts={"versions": versions(), "cases": found.cases, "steps": found.steps},
        text="\n\n".join([*blocks, wrapped(where)]),
        written=written,
        scene=scene,
        value=found.cases,
        notes=(*notes, *outputs.figure_notes(written)),
        status=Status.DOES_NOT_HOLD if falls else Status.DONE,
    )


def _axis(text: str) -> tuple[str, tuple[float, ...]]:
    """Return the axis of a map, and its values; none for the usual ones."""
    axis, _, values = text.partition("=")
    where = f"--map {text}"
    if axis not in AXES:
        raise ProblemError(f"{where}: give {' or '.join(AXES)}, with values as friction=0.3,0.6")
    numbers = {number_word(value, where, zero=True) for value in values.split(",") if values}
    steep = [number for number in numbers if axis == "tilt" and number > STEEPEST]
    if steep:
        raise ProblemError(f"{where}: {max(steep):g} is too much; give tilt from 0 to {STEEPEST:g}")
    return axis, tuple(sorted(numbers))
