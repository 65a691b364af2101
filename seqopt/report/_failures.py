"""Where builds fail, in words: how many steps fall, what falls first, and what would cure it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from seqopt.errors import SeqoptError
from seqopt.network.network import build_network
from seqopt.scene.scene import Scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.rules import FREE
from seqopt.sequence.steps import Step
from seqopt.stability.failure_map import FailureMap
from seqopt.work import Tell
from seqopt.workflow import Search, optimize

PATIENCE = 20.0  # s for each plan: one that is not proven to be the best is a way to build as well
AXIS_WORDS = {"friction": "friction", "tilt": "tilt, degrees"}


def usual_builds(
    scene: Scene, progress: Tell = lambda _: None
) -> tuple[dict[str, Sequence[Step]], list[str]]:
    """Return the steps of the fixed methods, of a loop and of a free schedule.

    The plans are those of `seqopt.optimize` within `PATIENCE`. Results: ``builds`` by name, each
    once, and ``notes``: what is not possible, not proven to be the best, or the same as another.
    """
    network, builds, notes = build_network(scene), dict[str, Sequence[Step]](), list[str]()

    def keep(name: str, steps: Sequence[Step]) -> None:
        same = next((known for known, own in builds.items() if own == steps), None)
        if same is None:
            builds[name] = steps
        else:  # where nothing bridges, as in walls and domes, the fixed methods are one
            notes.append(f"{name}: the same steps as {same}")

    for name, method in METHODS.items():
        try:
            keep(name, method(network))
        except SeqoptError as error:
            notes.append(f"{name}: {error}")
    for schedule in (None, FREE):
        try:
            plan = optimize(scene, schedule, search=Search(time_limit=PATIENCE), progress=progress)
            keep(plan.method, plan.steps)
            if plan.stopped:
                notes.append(f"{plan.method}: the best plan within {PATIENCE:g} s")
        except SeqoptError as error:
            notes.append(f"{schedule or 'loop'}: {error}")
    return builds, notes


def cure_words(case: Mapping[Any, Any]) -> str:
    """Return the remedy for a case of a map that falls, in words."""
    bond, friction, node = case["bond_needed_Pa"], case["friction_needed"], case["grip_node"]
    enough = [f"a bond of {bond / 1e3:.3g} kPa"] if np.isfinite(bond) else []
    enough += [f"friction {friction:.3g}"] if np.isfinite(friction) else []
    open_ = np.isnan([bond, friction]).any()
    none = "what is enough is not proven" if open_ else "no bond or friction helps"
    text = f"every step stands with {' or '.join(enough)}" if enough else none
    more = "" if pd.isna(node) else f"; one more robot at node {int(node)} would hold this step"
    return f"{text}{more}"


_NAME = 26  # columns of a build with what holds it


def failure_blocks(scene: Scene, found: FailureMap, wrapped: Callable[[str], str]) -> list[str]:
    """Return how many steps fall, then what falls first and would cure it, under headings."""
    axis, values = AXIS_WORDS[str(found.cases["axis"].iloc[0])], sorted({*found.cases["value"]})
    heads = "".join(f"{value:8.3g}" for value in values)
    lines = [f"{scene.name}: steps that fall, by {axis}", f"{'':{_NAME}}{'steps':>5}{heads}"]
    for (build, holds), rows in found.cases.groupby(["build", "holds"], sort=False):
        counts = dict.fromkeys(values, "")
        for case in rows.to_dict("records"):
            open_ = f" ({case['undecided']}?)" if case["undecided"] else ""
            counts[case["value"]] = f"{case['fall']}{open_}"
        cells = "".join(f"{count:>8}" for count in counts.values())
        lines.append(f"{f'{build}, {holds}':{_NAME}}{rows['steps'].iloc[0]:5}{cells}")
    if not found.cases[["fall", "undecided"]].to_numpy().any():
        return ["\n".join(lines), "every step is proven to stand, in every case"]
    name, _, unit = axis.partition(", ")
    where = f"{name} {found.usual:.3g} {unit}".rstrip()
    cures = [f"What falls first, {where}, and what would cure it"]
    at = (found.cases["value"] == found.usual) & (found.cases["fall"] > 0)
    for case in found.cases[at].to_dict(orient="records"):
        joint = f", joint {case['joint']} {case['motion']}" if case["joint"] else ""
        where = f"step {case['first_step']}, brick {case['brick']}{joint}"
        cures.append(wrapped(f"{case['build']}, {case['holds']}: {where}; {cure_words(case)}"))
    return ["\n".join(block) for block in (lines, cures if len(cures) > 1 else []) if block]
