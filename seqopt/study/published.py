"""The published three-robot plan, what it is compared with, and what does not add up in print."""

from __future__ import annotations

from importlib import resources

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.placement.costs import LayeredCosts
from seqopt.placement.problem import Problem
from seqopt.placement.ranking import move_costs, rank_of
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.plan_file import parse_plan
from seqopt.sequence.steps import Step

IRREGULARITIES = (
    "Table A.2 leaves the brick count of step 9 blank (it is 5) and F_sup of step 49 "
    "(472.3 N, the state of A.1 step 49).",
    "The payload is 40 kg (392.4 N); step 47 exceeds it in both two-robot methods.",
    "The text counts 23 optimizations; the printed three-robot plan contains 22.",
    "The printed D_max of the three-robot plan, 21.9e-3 mm, is that of step 88; the grips printed "
    "for step 86 move more.",
    "The three-robot plan moves more than the cantilever method (21.9 against 15.9e-3 mm), "
    "though it is called an improvement in all responses.",
    "Averages 'over the full sequence' (D_max 7.3e-3 mm, M_sup 6.8 N m) leave out the eight "
    "twisting steps; over all 49 steps of A.1 the mean D_max is 21.9e-3 mm.",
    "The average T_max of the sequential method is printed as 38.0 N; all 49 rows give 36.7 N. "
    "Those of the cantilever method leave out steps 1 to 4.",
)


PAPER_COLUMN = {
    "sequential": "sequential",
    "cantilever": "cantilever",
    "three-robot": "three_robot",
}


def is_reference_arch(scene: Scene) -> bool:
    """Return whether a scene is the study's arch as it ships with the package."""
    return scene == load_scene("arch25")


def published_plan(scene: Scene) -> tuple[Step, ...]:
    """Return the 90 steps of the study's three-robot plan (Table B.1), checked in a scene."""
    source = resources.files("seqopt").joinpath("data/paper/three_robot_plan.csv")
    return parse_plan(scene, source.read_text(encoding="utf-8"), "published three-robot plan")


def published_choice(problem: Problem) -> tuple[int, ...]:
    """Return the published plan's nodes as places among the candidates of the loop's moves."""
    scene = problem.schedule.scene
    plan = published_plan(scene)
    names = [robot.name for robot in scene.robots]
    nodes = [plan[m.step - 1].grips[names.index(m.robot)] for m in problem.schedule.moves]
    return tuple(
        move.candidates.index(int(node or 0))
        for move, node in zip(problem.schedule.moves, nodes, strict=True)
    )


def published_ranks(problem: Problem, choice: tuple[int, ...]) -> pd.DataFrame:
    """Return where chosen nodes rank, move by move, the choice before each being fixed."""
    sums = _to_go(problem.sums, np.add)
    peaks = _to_go(problem.peaks, np.maximum)
    rows = []
    for k, move in enumerate(problem.schedule.moves):
        before = choice[k - 1] if k else 0
        window = move_costs(problem, k, before)
        rows.append(
            {
                "move": k + 1,
                "step": move.step,
                "bricks": move.bricks,
                "robot": move.robot,
                "node": move.candidates[choice[k]],
                "candidates": len(move.candidates),
                "first_in_window": move.candidates[int(window.argmin())],
                "rank_in_window": rank_of(window, choice[k]),
                "rank_overlap": rank_of(problem.sums.shared[k][before] + sums[k], choice[k]),
                "rank_peak": rank_of(
                    np.maximum(problem.peaks.shared[k][before], peaks[k]), choice[k]
                ),
            }
        )
    return pd.DataFrame(rows)


def _to_go(placement: LayeredCosts, join: np.ufunc) -> list[Floats]:
    """Return the least cost from each candidate to the end, its own single cost included."""
    out = [placement.single[-1]]
    for single, shared in zip(placement.single[-2::-1], placement.shared[:0:-1], strict=True):
        out.insert(0, join(single, join(shared, out[0]).min(axis=1)))
    return out
