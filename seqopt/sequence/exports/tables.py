"""Plans as a table and as JSON: absent, placed or held, by block and step."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence

from seqopt.cells import harmless
from seqopt.errors import StepError
from seqopt.scene.checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.exports.states import step_states
from seqopt.sequence.steps import Step, StepKind, check_sequence

FORMAT, VERSION = "seqopt-plan", 1


def plan_csv(scene: Scene, steps: Sequence[Step]) -> str:
    """Return a plan as CSV.

    Returns
    -------
    str
        A row per step: ``step``, ``type``, the ``placed`` bricks, what every robot holds as
        ``NAME_node`` and ``NAME_brick``, and a column ``block_N`` for every brick in build order.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    robots = [robot.name for robot in scene.robots]
    grips = [f"{name}_{what}" for name in robots for what in ("node", "brick")]
    blocks = [f"block_{brick.name}" for brick in scene.placed]
    writer.writerow(["step", "type", "bricks", "placed", *map(harmless, grips), *blocks])
    for row in step_states(scene, steps):
        held = [cell for name in robots for cell in row.holds.get(name, ("", ""))]
        placed = " ".join(map(str, row.new))
        step = row.step
        states = [state.value for state in row.states.values()]
        writer.writerow([step.number, step.kind.value, step.bricks, placed, *held, *states])
    return out.getvalue()


def plan_json(scene: Scene, steps: Sequence[Step]) -> str:
    """Return a plan as JSON.

    Returns
    -------
    str
        ``blocks``, the names of all bricks in build order; and ``steps``, each with its ``type``,
        the bricks that are ``placed``, what robots hold as ``holds``, and the ``states`` of all
        blocks in their order.
    """
    rows = [
        {
            "step": row.step.number,
            "type": row.step.kind.value,
            "placed": list(row.new),
            "holds": {
                name: {"node": node, "block": brick} for name, (node, brick) in row.holds.items()
            },
            "states": [state.value for state in row.states.values()],
        }
        for row in step_states(scene, steps)
    ]
    whole = {
        "format": FORMAT,
        "version": VERSION,
        "scene": scene.name,
        "blocks": [brick.name for brick in scene.placed],
        "robots": [robot.name for robot in scene.robots],
        "steps": rows,
    }
    return json.dumps(whole, ensure_ascii=False) + "\n"


def parse_plan_json(scene: Scene, text: str) -> tuple[Step, ...]:
    """Return the checked steps of a plan that `plan_json` wrote.

    Parameters
    ----------
    scene : Scene
        In which every step must be possible.
    text : str

    Raises
    ------
    StepError
        If it is no such plan, or of other blocks or robots, or a step is impossible.
    """
    try:
        whole = json.loads(text)
        if (whole["format"], whole["version"]) != (FORMAT, VERSION):
            raise StepError(f"plan: format is {short(whole['format'])}; give a {FORMAT}")
        if whole["blocks"] != [brick.name for brick in scene.placed]:
            raise StepError(f"plan: its blocks are not those of scene {scene.name}")
        robots = [robot.name for robot in scene.robots]
        unknown = {name for row in whole["steps"] for name in row["holds"]} - set(robots)
        if unknown:
            raise StepError(f"plan: there is no robot {short(min(unknown))} in scene {scene.name}")
        steps, count = [], 0
        for i, row in enumerate(whole["steps"], start=1):
            count += len(row["placed"])
            grips = tuple(row["holds"].get(name, {}).get("node") for name in robots)
            steps.append(Step(i, StepKind(row["type"]), count, grips))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, StepError):
            raise
        raise StepError(f"plan: no {FORMAT} document: {short(error, 80)}") from error
    return check_sequence(scene, steps)
