"""Plans as a table and as JSON: absent, placed or held, by block and step."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from seqopt._files import harmless
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind


class BlockState(Enum):
    """The state of a block in a step."""

    ABSENT = "absent"
    PLACED = "placed"
    HELD = "held"  # placed, and held by a robot


@dataclass(frozen=True)
class StepStates:
    """A step by its blocks."""

    step: Step
    new: tuple[int, ...]  # names of the bricks that this step places
    holds: dict[str, tuple[int, int]]  # node and brick, by the robots' names
    states: dict[int, BlockState]  # of all bricks by name, in build order


def step_states(scene: Scene, steps: Sequence[Step]) -> Iterator[StepStates]:
    """Yield what becomes of every block in every step of a checked plan for the scene.

    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> steps = seqopt.sequential(seqopt.build_network(scene))
    >>> second = [*step_states(scene, steps)][1]
    >>> second.new, [second.states[name].value for name in (1, 2, 3)]
    ((2,), ['held', 'held', 'absent'])
    """
    begins = any(step.kind is StepKind.REMOVE for step in steps)
    before = steps[0].bricks if begins else 0  # of a take-down nothing is placed
    names = [brick.name for brick in scene.placed]
    for step in steps:
        holds = {
            robot.name: (node, scene.brick_of_node[node].name)
            for robot, node in zip(scene.robots, step.grips, strict=True)
            if node is not None
        }
        states = dict.fromkeys(names, BlockState.ABSENT)
        states |= dict.fromkeys(names[: step.bricks], BlockState.PLACED)
        states |= {brick: BlockState.HELD for _, brick in holds.values()}
        yield StepStates(step, tuple(names[before : step.bricks]), holds, states)
        before = step.bricks


def plan_csv(scene: Scene, steps: Sequence[Step]) -> str:
    """Return a plan as CSV, a row per step.

    Its columns are ``step``, ``type``, ``bricks``, the ``placed`` bricks, what every robot holds as
    ``NAME_node`` and ``NAME_brick``, and ``block_N`` for every brick in build order.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    robots = [robot.name for robot in scene.robots]
    grips = [harmless(f"{name}_{what}") for name in robots for what in ("node", "brick")]
    blocks = [f"block_{brick.name}" for brick in scene.placed]
    writer.writerow(["step", "type", "bricks", "placed", *grips, *blocks])
    for row in step_states(scene, steps):
        held = [cell for name in robots for cell in row.holds.get(name, ("", ""))]
        step, placed = row.step, " ".join(map(str, row.new))
        states = [state.value for state in row.states.values()]
        writer.writerow([step.number, step.kind.value, step.bricks, placed, *held, *states])
    return out.getvalue()


def plan_json(scene: Scene, steps: Sequence[Step]) -> str:
    """Return a plan as JSON.

    It has ``blocks``, the names of all bricks in build order; and ``steps``, each with its
    ``type``, the bricks that are ``placed``, what robots hold as ``holds``, and the ``states`` of
    all blocks in their order.
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
        "format": "seqopt-plan",
        "version": 1,
        "scene": scene.name,
        "blocks": [brick.name for brick in scene.placed],
        "robots": [robot.name for robot in scene.robots],
        "steps": rows,
    }
    return json.dumps(whole, ensure_ascii=False) + "\n"
