"""Failure maps of builds: the answer of ``assess --map``."""

from __future__ import annotations

from collections.abc import Sequence

from seqopt._cli import grammar, inputs, options, outputs
from seqopt._cli.answer import Answer, Status
from seqopt._cli.terminal import wrapped
from seqopt._files import csv_text
from seqopt._showing import PAGE
from seqopt.engines.registry import USUAL, make_engine, versions
from seqopt.errors import ProblemError, SceneError, SeqoptError
from seqopt.network.build import build_network
from seqopt.problem.requirements import number_word
from seqopt.report._failures import Builds, failure_blocks, failure_page, usual_builds
from seqopt.scene._checks import MOST_BRICKS
from seqopt.scene._counts import scene_of_bricks
from seqopt.scene.scene import Scene, in_order
from seqopt.stability.failure_map import FailureMap, _brick_map, failure_map

BRICKS = "bricks"
WAYS = ("friction", "tilt")
SHARES = (0.5, 0.75, 1.0, 1.25, 1.5)  # of the bricks of a scene, by default
STEEPEST = 45.0  # degrees


def answer_map(asked: options.Fixed, over: str, holds: Sequence[str]) -> Answer:
    """Return the failure map of builds over an axis and the mortar of joints."""
    scene = inputs.find_scene(asked)
    axis, values = _axis(over)
    for name in holds:
        grammar.parse_mortar(name, "--holds")
    outputs.require_out(asked)
    builds, notes = _builds(asked, scene)
    if axis == BRICKS:
        scene, builds, found, more = _over_bricks(asked, scene, builds, (over, holds, values))
        notes += more
    else:
        found = failure_map(scene, builds, holds, axis, values, asked.tell)
    written = outputs.write_outputs(asked, lambda: _files(scene, builds, found))
    blocks = failure_blocks(scene, found, wrapped)
    where = outputs.written_to(asked.path, tables="tables, a picture", what="how steps fall")
    falls = found.cases["fall"].any()
    return Answer(
        facts={"versions": versions(), "cases": found.cases, "steps": found.steps},
        text="\n\n".join([*blocks, wrapped(where)]),
        headings=tuple(block.splitlines()[0] for block in blocks),
        written=written,
        scene=scene,
        value=found.cases,
        notes=(*notes, *outputs.figure_notes(written)),
        status=Status.DOES_NOT_HOLD if falls else Status.DONE,
    )


def _axis(text: str) -> tuple[str, tuple[float, ...]]:
    """Return the axis of a map, and its values; None for the default ones."""
    axis, _, values = text.partition("=")
    if axis not in (*WAYS, BRICKS):
        known = f"{', '.join(WAYS)} or {BRICKS}"
        raise ProblemError(f"--map {text}: give {known}, with values as friction=0.3,0.6")
    if axis == BRICKS:
        words = values.split(",") if values else ()
        return axis, tuple(
            sorted({grammar.parse_count(n, "--map bricks", MOST_BRICKS) for n in words})
        )
    numbers = [
        number_word(value, f"--map {text}", zero=True) for value in values.split(",") if values
    ]
    if wrong := [number for number in numbers if axis == "tilt" and number > STEEPEST]:
        raise ProblemError(
            f"--map {text}: {wrong[0]:g} is too much; give tilt from 0 to {STEEPEST:g}"
        )
    return axis, tuple(sorted({*numbers}))


def _over_bricks(
    asked: options.Fixed,
    scene: Scene,
    builds: Builds,
    over: tuple[str, Sequence[str], Sequence[float]],
) -> tuple[Scene, Builds, FailureMap, list[str]]:
    """Return the map over the number of bricks, and reasons for missing entries.

    Also the scene and the builds whose failing steps are drawn. A plan, or a scene of a fixed
    number of bricks, is mapped along its build.
    """
    (text, holds, counts), now = over, len(scene.bricks)
    try:
        if (plan := inputs.given_plan(asked)) is not None:
            raise SceneError(f"plan {plan}: it is for {now} bricks alone")
        scene_of_bricks(str(asked.scene), now)
    except SceneError as error:
        note = f"{error}; this maps steps by how many bricks are placed"
        placed = [count for count in counts if count <= now]
        found = failure_map(scene, builds, holds, "bricks placed", placed, asked.tell)
        return scene, builds, found, [note]
    scenes, notes = {now: (scene, builds)}, list[str]()
    for count in counts or [round(share * now) for share in SHARES]:
        try:
            order = None if asked.order is None else str(asked.order)
            other = in_order(scene_of_bricks(str(asked.scene), int(count)), order)
            if len(other.bricks) not in scenes:
                scenes[len(other.bricks)] = other, _builds(asked, other)[0]
        except SeqoptError as error:
            notes.append(f"{count:g} bricks: {error}")
    if counts and now not in counts:
        del scenes[now]
    if not scenes:
        raise ProblemError(f"--map {text}: {'; '.join(notes)}")
    ordered, usual = dict(sorted(scenes.items())), min(scenes, key=lambda n: abs(n - now))
    return *scenes[usual], _brick_map(ordered, usual, holds, asked.tell), notes


def _builds(asked: options.Fixed, scene: Scene) -> tuple[Builds, list[str]]:
    """Return the requested builds by name, and the reasons why others are infeasible."""
    if asked.method is None and inputs.given_plan(asked) is None:
        return usual_builds(scene, asked.tell)
    name, steps, _ = inputs.find_steps(asked, build_network(scene))
    return {name: steps}, []


def _files(scene: Scene, builds: Builds, found: FailureMap) -> dict[str, bytes | str]:
    """Return tables, page and picture by file name."""
    engine = make_engine(USUAL, build_network(scene), None)
    files: dict[str, bytes | str] = {
        "map.csv": csv_text(found.cases),
        "map_steps.csv": csv_text(found.steps),
        PAGE: failure_page(engine, builds, found),
    }
    return files | outputs.picture("map", lambda charts: charts.failure_figure(found))
