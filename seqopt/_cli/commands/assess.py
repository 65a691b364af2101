"""The command ``assess``: does every step stand, and with what margins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any

import pandas as pd

from seqopt._cli import outputs, remarks
from seqopt._cli.answer import Answer, Status
from seqopt._cli.inputs import NamedSteps, find_steps, given_plan
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import door
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import BuiltFrom, File, Words, as_built, parse_count, parse_mortar, shown
from seqopt._files import csv_text
from seqopt._later import Later
from seqopt.contact.mortar import Mortar, _mortar_name, _with_mortar
from seqopt.engines.registry import versions
from seqopt.errors import ProblemError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.build import ShownBuild
from seqopt.problem.requirements import number_word
from seqopt.responses.quantities import _steps_in_words
from seqopt.scene.scene import Scene
from seqopt.stability._steps import each_stability, find_margins, format_rows, stability_row
from seqopt.stability.assessment import Verdict
from seqopt.stability.failure_map import AXES, failure_map
from seqopt.work.progress import Tell, with_progress

MAP = Later("seqopt.report._failures")  # 24 ms, of pages
STEEPEST = 45.0  # degrees


@door
def assess(  # noqa: PLR0913  # every option is a parameter
    scene: BuiltFrom = "arch25",
    *,
    robots: Words | None = None,
    cache: Path | str | None = None,
    progress: Tell = shown,
    method: str | None = None,
    plan: ShownBuild | Path | str | None = None,
    mortar: Mortar | str | None = None,
    friction: float | None = None,
    tensile_strength: Annotated[float | None, ("zero", True)] = None,
    cohesion: Annotated[float | None, ("zero", True)] = None,
    margins: Words | None = None,
    steps: Annotated[str | None, ("value", "FROM:TO")] = None,
    map: Annotated[str | None, ("value", "AXIS")] = None,  # noqa: A002  # the option's name
    holds: Words | None = None,
    workers: int = 1,
    out: File | None = None,
) -> Answer[pd.DataFrame]:
    """Prove of every step of a sequence that it stands, or that it does not.

    Bricks are rigid, and their joints may open and slide. Say which brick and joint fail first; on
    request also how much bond, friction and robot force a step needs, and which tilt it survives:
    either ``margins`` with ``steps``, or a ``map`` with ``holds``, what is in the joints.

    Parameters
    ----------
    scene, robots, cache, progress : optional
        As of `optimize`; of a plan its steps are taken too.
    method, plan : optional
        As of `analyze`.
    mortar : Mortar or str, optional
        What is in the joints: the epoxy of Bruun et al. (25°, 3 MPa, 2 MPa), dry (nothing), or
        bond=STRENGTH (Pa) (default: dry, then epoxy, which alone decides the exit status).
    friction : float, optional
        Coefficient of friction, in place of the mortar's own.
    tensile_strength : float, optional
        What a joint holds in tension, Pa, in place of the mortar's own.
    cohesion : float, optional
        What a joint holds in shear without any pressure, Pa, in place of the mortar's own.
    margins : str or sequence of str, optional
        Margins beside the verdicts, or all, with commas between them; each takes several times as
        long (default: none; with ``steps`` all).
    steps : str, optional
        Steps of which margins are found, as 40:60 (default: all).
    map : str, optional
        Map where builds fail, over what holds their joints and over friction or tilt (degrees),
        with values of your own as tilt=0,2,5; of the fixed methods, a loop and a free schedule, or
        of ``method`` or ``plan`` alone.
    holds : str or sequence of str, optional
        With ``map``: what holds the joints, of dry, bond=STRENGTH (Pa) and epoxy, with commas
        between them (default: dry,epoxy).
    workers : int, optional
        Processes to share the steps among (default: 1).
    out : pathlib.Path or str, optional
        CSV file to write (default: standard output); with ``map`` a folder.

    Returns
    -------
    pandas.DataFrame
        A row per mortar and step: dry, then with epoxy, if no ``mortar`` is named; with ``map`` a
        row per build, mortar and value. ``attrs['notes']`` says what verdicts leave out.

    Examples
    --------
    >>> assess("wall:columns=2,courses=2", mortar="dry")["verdict"].value_counts().to_dict()
    {'stands': 7}

    $ seqopt assess arch25 --method cantilever --out stands.csv
    $ seqopt assess arch25 --method sequential --mortar dry --margins bond,tilt
    $ seqopt assess arch25 --method sequential --steps 40:49
    $ seqopt assess arch:span=2,rise=0.8 --map friction --out map
    """
    output, built = Output(out, scene, plan), as_built(scene)

    def steps_of(network: Network) -> NamedSteps:
        return find_steps(network, scene, plan, method, robots, progress, cache)

    if map is not None:
        known = method is not None or given_plan(scene, plan, method) is not None
        held = str(holds or "dry,epoxy").split(",")
        return _map(built.read(robots), map, held, steps_of if known else None, output, progress)
    output.keep_apart(output.path)
    given = {"friction": friction, "tensile_strength": tensile_strength, "cohesion": cohesion}
    mortars = _mortars(mortar, {name: each for name, each in given.items() if each is not None})
    network = build_network(built.read(robots))
    _, found, taken = steps_of(network)
    wanted = find_margins(margins or ("all" if steps else ())), _range(steps, len(found))
    rows, early = list[dict[str, Any]](), tuple[str, ...]()
    try:
        for name, own in mortars.items():
            told = with_progress(f"assessing steps, {_with_mortar(name)}", found, progress)
            results = each_stability(network, found, own, *wanted, (None, workers))
            for step, result in zip(told, results, strict=True):
                rows.append({"mortar": name, **stability_row(step, result)})
    except KeyboardInterrupt:
        if not rows:
            raise
        total = len(mortars) * len(found)
        early = (f"seqopt: interrupted; {len(rows)} of {total} verdicts were found",)
    scene_notes = remarks.settlement_notes(network.scene)
    notes = (*taken, *scene_notes, *remarks.carrying_notes(network.scene, found))
    answer = replace(_answer(output.path, mortars, rows), scene=network.scene, notes=notes)
    if not early:
        return answer
    return replace(answer, failures=(*answer.failures, *early), status=Status.INTERRUPTED)


def _answer(
    path: Path | None, mortars: Mapping[str, Mortar], rows: Sequence[dict[str, Any]]
) -> Answer[Any]:
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
    said = outputs.put_table(path, rows, "\n".join(lines) + ";")
    return Answer(facts, **said, value=rows, failures=failures, status=status)


def _mortars(mortar: Mortar | str | None, given: Mapping[str, float]) -> dict[str, Mortar]:
    """Return mortars by name: the one requested, or dry joints and epoxy.

    The last one decides the exit status. ``given``: properties in place of its own; the friction is
    that of dry joints as well.
    """
    own = replace(parse_mortar(mortar or "epoxy", "--mortar"), **given)
    dry = () if mortar else (Mortar(friction=own.friction),)
    return {_mortar_name(each): each for each in (*dry, own)}


def _range(steps: str | None, count: int) -> range:
    """Return the numbers of the steps of which margins are asked."""
    if steps is None:
        return range(1, count + 1)
    first, colon, last = steps.partition(":")
    ends = (first or "1", (last or str(count)) if colon else first)
    try:
        start, end = (parse_count(end, "--steps", count) for end in ends)
    except ProblemError as error:
        wrong = f"--steps {steps}: give numbers from 1 to {count}, as 3:7"
        raise ProblemError(wrong) from error
    if end < start:
        raise ProblemError(f"--steps {steps}: the first is after the last; exchange them")
    return range(start, end + 1)


def _map(
    scene: Scene,
    over: str,
    holds: Sequence[str],
    steps: Callable[[Network], NamedSteps] | None,
    output: Output,
    tell: Tell,
) -> Answer[pd.DataFrame]:
    """Return the failure map of builds over an axis and the mortar of joints."""
    axis, values = _axis(over)
    for name in holds:
        parse_mortar(name, "--holds")
    output.require()
    network = build_network(scene)
    if steps is None:
        builds, notes = MAP.usual_builds(scene, tell)
    else:
        named = steps(network)
        builds, notes = {named.name: named.steps}, []
    found = failure_map(scene, builds, holds, axis, values, tell)

    def files() -> dict[str, bytes | str]:
        tables = {"map.csv": csv_text(found.cases), "map_steps.csv": csv_text(found.steps)}
        picture = outputs.picture("map", lambda charts: charts.failure_figure(found))
        return {**tables, **picture}

    written = output.write(tell, files)
    blocks = MAP.failure_blocks(scene, found, wrapped)
    where = (
        f"tables and a picture {'are' if written else 'would be'} in {output.path or '--out DIR'}"
    )
    return Answer(
        facts={"versions": versions(), "cases": found.cases, "steps": found.steps},
        text="\n\n".join([*blocks, wrapped(where)]),
        written=written,
        scene=scene,
        value=found.cases,
        notes=(*notes, *outputs.figure_notes(written)),
        status=Status.DOES_NOT_HOLD if found.cases["fall"].any() else Status.DONE,
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
