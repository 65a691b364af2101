"""Forces of props, and violations of their capacities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Engine, Want
from seqopt.responses.quantities import lengths
from seqopt.scene.parts import Prop
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

EXCESS_COLUMN = "prop_excess_N"


def with_props(grips: Ints, props: Sequence[int]) -> Ints:
    """Return grip sets (S, r) with the grips of props, by number, after those of robots."""
    return np.hstack([grips, np.tile(np.array(props, dtype=np.int64), (len(grips), 1))])


def excess_of(props: Sequence[Prop], force: Floats) -> Floats:
    """Return the largest violation (S,) of capacities by forces (S, p, 3) of props, N.

    Force above the capacity, or tension in a prop that only pushes; zero if there is none.
    """
    out = np.zeros(len(force))
    for prop, own in zip(props, force.transpose(1, 0, 2), strict=True):
        if prop.capacity is not None:
            out = np.maximum(out, lengths(own) - prop.capacity)
        if prop.direction is not None:
            out = np.maximum(out, -own @ np.array(prop.direction))
    return np.asarray(out)


def prop_cells(scene: Scene, step: Step, force: Floats) -> dict[str, object]:
    """Return the cells of props in a table of steps, from their forces (p, 3)."""
    if not scene.props:
        return {}
    props = scene.standing_props(step.bricks, held=bool(step.held))
    size = lengths(force)
    most = int(size.argmax()) if len(props) else 0
    return {
        "props": len(props),
        "prop_node": props[most].node if len(props) else None,
        "F_prop_N": float(size[most]) if len(props) else np.nan,
        EXCESS_COLUMN: float(excess_of(props, force[None])[0]),
    }


def props_table(engine: Engine, steps: Sequence[Step]) -> pd.DataFrame:
    """Return a row per prop of a build: the steps in which it holds, and its forces.

    Columns: ``node``, ``brick``, ``from_step``, ``to_step``, ``largest_force_N``, ``at_step``, and
    of one that only pushes ``least_push_N``, negative if it would have to pull.
    """
    scene = engine.network.scene
    found: dict[int, list[tuple[int, Floats]]] = {}
    for step in steps:
        props = scene.standing_props(step.bricks, held=bool(step.held))
        if props:
            numbers = [scene.grip_numbers(step.grips, step.bricks)]
            force = engine.solve(step.bricks, numbers, Want(0)).grip_force[0, len(step.held) :]
            for prop, own in zip(props, force, strict=True):
                found.setdefault(scene.props.index(prop), []).append((step.number, own))
    return pd.DataFrame([_row(scene, scene.props[i], found[i]) for i in sorted(found)])


def _row(scene: Scene, prop: Prop, held: Sequence[tuple[int, Floats]]) -> dict[str, object]:
    force = np.array([own for _, own in held])
    size = lengths(force)
    push = np.nan if prop.direction is None else float((force @ np.array(prop.direction)).min())
    return {
        "node": prop.node,
        "brick": scene.brick_of_node[prop.node].name,
        "from_step": held[0][0],
        "to_step": held[-1][0],
        "largest_force_N": float(size.max()),
        "at_step": held[int(size.argmax())][0],
        "least_push_N": push,
    }
