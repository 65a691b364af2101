"""The command ``assess``: does every step stand, and with what margins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Annotated, Any

from seqopt._cli.answer import Answer, Status
from seqopt._cli.outputs import read_steps
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import File, named
from seqopt._registry import Later
from seqopt.contact.mortar import Mortar, _mortar_name, _with_friction, _with_mortar, find_mortar
from seqopt.engines.registry import versions
from seqopt.errors import ProblemError
from seqopt.exchange._files import Output, csv_text, listed
from seqopt.problem.requirements import _carrying_excesses, number_word
from seqopt.questions import assess
from seqopt.responses.quantities import _steps_in_words
from seqopt.scene.scene_file import find_scene, plan_folder
from seqopt.sequence.steps import Step
from seqopt.stability._steps import each_stability, find_margins, format_rows, stability_row
from seqopt.stability.failure_map import AXES, _settlement_said, failure_map
from seqopt.stability.verdict import Verdict
from seqopt.work import Tell, with_progress

MAP = Later("seqopt.report._failures")  # 24 ms, of pages
FOLDERS = Later("seqopt.report._folders")  # 200 ms, where files are written
STEEPEST = 45.0  # degrees
COUNTS = ("jammed", "almost_solved", "stalled", "unproven")  # columns that are mostly zero


def run(
    asked: Annotated[Call, ("call", assess)],
    *,
    map: Annotated[str | None, ("value", "AXIS")] = None,  # noqa: A002  # the option's name
    holds: str | None = None,
    out: File = None,
    progress: Tell,
) -> Answer:
    """Prove of every step of a sequence that it stands, or that it does not.

    Bricks are rigid, and their joints may open and slide. Say which brick and joint fail first; on
    request also how much bond, friction and robot force a step needs, and which tilt it survives:
    either ``margins``, or a ``map`` with ``holds``, what is in the joints.

    Parameters
    ----------
    map : str, optional
        Map where builds fail, over what holds their joints and over friction or tilt (degrees),
        with values of your own as tilt=0,2,5; of the fixed methods, a loop and a free schedule, or
        of ``method`` or ``plan`` alone.
    holds : str, optional
        With ``map``: what holds the joints, of dry, bond=STRENGTH (Pa) and epoxy, with commas
        between them (default: dry,epoxy).
    out : pathlib.Path, optional
        CSV file to write (default: the table is printed, with ``quiet`` as CSV); with ``map`` a
        folder.

    Examples
    --------
    $ seqopt assess arch25 --method cantilever --out stands.csv
    $ seqopt assess arch25 --method sequential --mortar dry --margins bond,tilt
    $ seqopt assess arch:span=2,rise=0.8 --map friction --out map
    """
    words = {name: word for name, word in asked.words.items() if name != "mortar"}
    output, mortar = Output(out, words.get("scene"), words.get("plan")), asked.words.get("mortar")
    if map is not None:
        others = {"margins": "", "friction": ", or give --map friction=0.3", "workers": ""}
        others |= {"mortar": ", or give --holds"}
        for name in (each for each in others if each in asked.words):
            text = f"--{name}: not allowed with --map; leave one of them out{others[name]}"
            raise ProblemError(text)
        return _map(words, map, named(holds or "dry,epoxy"), output, progress)
    if holds is not None:
        raise ProblemError(f"--holds {holds}: it goes with --map; give --map friction, say")
    output.keep_apart(out)
    own = find_mortar(mortar or "epoxy")
    (given, taken), rows = read_steps(words, progress), list[dict[str, Any]]()
    values = asked.values(scene=given)
    rough = values["friction"]
    own = own if rough is None else _with_friction(own, rough)
    shown = (own,) if mortar else (Mortar(friction=own.friction), own)  # the last one decides
    mortars = {_mortar_name(each): each for each in shown}
    wanted, shared = find_margins(values["margins"] or ()), (None, values["workers"])
    network, steps = given.network, given.steps
    for name, each in mortars.items():
        reported = with_progress(f"assessing steps, {_with_mortar(name)}", steps, progress)
        found = each_stability(network, steps, each, wanted, shared=shared)
        pairs = zip(reported, found, strict=True)
        rows += [{"mortar": name, **stability_row(step, result)} for step, result in pairs]
    scene = network.scene
    carried = (f"payload exceeded: {excess}" for excess in _carrying_excesses(scene, steps))
    moves = (f"stability: {text}" for text in [_settlement_said(scene)] if text)
    notes = (*taken, *moves, *carried)
    return replace(_answer(output, mortars, rows), scene=scene, notes=notes)


def _answer(
    output: Output, mortars: Mapping[str, Mortar], rows: Sequence[dict[str, Any]]
) -> Answer:
    """Write the verdicts, a row each, and return their answer."""
    each = {name: [row for row in rows if row["mortar"] == name] for name in mortars}
    lines = [f"{_with_mortar(name)}: {format_rows(own)}" for name, own in each.items()]
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
    words = output.put(csv_text(rows), "\n".join(lines) + ";")
    if output.path is None:
        words["text"] = "\n".join(
            [*lines, "", *listed(rows, COUNTS), "", "--out FILE or --quiet: as CSV"]
        )
    return Answer(facts, **words, failures=failures, status=status)


def _map(
    words: Mapping[str, Any], over: str, holds: Sequence[str], output: Output, tell: Tell
) -> Answer:
    """Return the failure map of builds over an axis and the mortar of joints."""
    axis, values = _axis(over)
    for name in holds:
        find_mortar(name, "holds")
    output.require()
    builds: Mapping[str, Sequence[Step]]
    notes: Sequence[str]
    if {"method", "plan"} & {*words} or plan_folder(words.get("scene")):
        given, notes = read_steps(words, tell)
        scene, builds = given.network.scene, {given.title: given.steps}
    else:
        scene = find_scene(Call(assess, words).values()["scene"], robots=words.get("robots"))
        builds, notes = MAP.usual_builds(scene, tell)
    found = failure_map(scene, builds, holds, axis, values, tell)

    def files() -> dict[str, bytes | str]:
        tables = {"map.csv": csv_text(found.cases), "map_steps.csv": csv_text(found.steps)}
        picture = FOLDERS.picture_files("map", lambda charts: charts.failure_figure(found))
        return {**tables, **picture}

    written = output.write(tell, files)
    blocks = MAP.failure_blocks(scene, found, wrapped)
    where = (
        f"tables and a picture {'are' if written else 'would be'} in {output.path or '--out DIR'}"
    )
    return Answer(
        {"versions": versions(), "cases": found.cases, "steps": found.steps},
        "\n\n".join([*blocks, wrapped(where)]),
        written=written,
        scene=scene,
        notes=(*notes, *(FOLDERS.figure_notes() if written else ())),
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
