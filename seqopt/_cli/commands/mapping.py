"""Failure maps of builds: the answer of ``assess --map``."""

from __future__ import annotations

from collections.abc import Sequence

from seqopt._cli import grammar, inputs, options, outputs
from seqopt._cli.answer import Answer, Status
from seqopt._cli.terminal import wrapped
from seqopt._files import csv_text
from seqopt._showing import PAGE
from seqopt.engines.registry import USUAL, make_engine, versions
from seqopt.errors import ProblemError
from seqopt.network.build import build_network
from seqopt.problem.requirements import number_word
from seqopt.report._failures import failure_blocks, failure_page, usual_builds
from seqopt.stability.failure_map import AXES, failure_map

STEEPEST = 45.0  # degrees


def answer_map(asked: options.Fixed, over: str, holds: Sequence[str]) -> Answer:
    """Return the failure map of builds over an axis and the mortar of joints."""
    scene = inputs.find_scene(asked)
    axis, values = _axis(over)
    for name in holds:
        grammar.parse_mortar(name, "--holds")
    outputs.require_out(asked)
    network = build_network(scene)
    if asked.method is None and inputs.given_plan(asked) is None:
        builds, notes = usual_builds(scene, asked.tell)
    else:
        name, steps, _ = inputs.find_steps(asked, network)
        builds, notes = {name: steps}, []
    found = failure_map(scene, builds, holds, axis, values, asked.tell)

    def files() -> dict[str, bytes | str]:
        page = failure_page(make_engine(USUAL, network, None), builds, found)
        tables = {"map.csv": csv_text(found.cases), "map_steps.csv": csv_text(found.steps)}
        picture = outputs.picture("map", lambda charts: charts.failure_figure(found))
        return {**tables, PAGE: page, **picture}

    written = outputs.write_outputs(asked, files)
    blocks = failure_blocks(scene, found, wrapped)
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
