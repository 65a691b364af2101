"""One way to a plan of the reference arch: its time, and its worst ratio over the published maxima.

What all plans have is a worst step: the largest of grip force, M_sup, T_max and D_max over the best
maxima that any published method reaches, one after the other, as exactly rigid bricks answer. Times
run from the scene to the plan, with its proof; of several repeats the median, after one that does
not count.

Command: ``python -m experiments.placement.parts.worst_ratios WAY`` prints the row of a way as JSON.
"""

import json
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

import seqopt
from seqopt import Plan, Step
from seqopt.graph.states.states import build_states
from seqopt.judge._schedules import _state_columns
from seqopt.sequence.rules import with_robots
from seqopt.study.published import WORST_RATIO, published_plan

Steps = Sequence[Step]
Row = dict[str, object]
SCENE, ENGINE = "arch25", "compliance"
REPEATED = 5  # times, where one takes less than a second
BEST = [seqopt.Limit(name, bound) for name, bound in WORST_RATIO.limits]


def fixed(method: str) -> tuple[Steps, str]:
    """Return the steps of a method that leaves no grip open, and that nothing is proven."""
    network = seqopt.build_network(seqopt.load_scene(SCENE))
    made = {"sequential": seqopt.sequential, "cantilever": seqopt.cantilever}
    steps = made[method](network) if method in made else published_plan(network.scene)
    seqopt.analyze(seqopt.make_engine(ENGINE, network), steps)
    return steps, ""


def chosen(criterion: str, formulation: str) -> tuple[Steps, str]:
    """Return the steps of the loop whose open grips are chosen, and what is proven least."""
    plan: Plan = seqopt.optimize(SCENE, "three-robot", criterion, formulation, ENGINE)
    return plan.steps, criterion


def free(aim: str, robots: int = 3, **words: object) -> tuple[Steps, str]:
    """Return the steps of the free schedule, and what is proven least."""
    own = {"aim": aim, "robots": robots, **words}
    plan: Plan = seqopt.optimize(SCENE, "free", WORST_RATIO, engine=ENGINE, **own)
    assert plan.status == "optimal"
    return plan.steps, aim


WAYS: dict[str, Callable[[], tuple[Steps, str]]] = {
    **{name: partial(fixed, name) for name in ("sequential", "cantilever", "published")},
    "loop, ranks": partial(chosen, "equations-2-3", "overlap_dp"),
    "loop, sum of ratios": partial(chosen, "weighted-published", "overlap_dp"),
    "loop, worst ratio": partial(chosen, WORST_RATIO.name, "minimax"),
    "free, 3 robots": partial(free, "minmax"),
    "free, fewest steps": partial(free, "steps,minmax", limits=BEST),
    "free, dry": partial(free, "minmax", stands="dry"),
    "free, 4 robots": partial(free, "minmax", 4),
    "free, 5 robots": partial(free, "minmax", 5),
}


def row(way: str) -> Row:
    seconds, (steps, least) = timed(WAYS[way])
    if seconds < 1:
        seconds = statistics.median(timed(WAYS[way])[0] for _ in range(REPEATED))
    robots = len(steps[0].grips)
    out = {"way": way, "robots": robots, "proven": least, "seconds": seconds}
    return out | {"worst_ratio": worst_ratio(steps, robots), "steps": len(steps)}


def timed(call: Callable[[], tuple[Steps, str]]) -> tuple[float, tuple[Steps, str]]:
    start = time.perf_counter()
    made = call()
    return time.perf_counter() - start, made


def worst_ratio(steps: Steps, robots: int) -> float:
    """Return the largest response of any step over the best published maximum of its kind."""
    scene = seqopt.load_scene(SCENE)
    if robots != len(scene.robots):
        scene = with_robots(scene, robots)
    engine = seqopt.make_engine(ENGINE, seqopt.build_network(scene))
    problem = build_states(engine, seqopt.FreeRules(), WORST_RATIO)
    columns = _state_columns(problem, steps, seqopt.analyze(engine, steps))
    return float(np.max(WORST_RATIO.costs(columns, 1, len(steps))))


if __name__ == "__main__":
    print(json.dumps(row(sys.argv[1])))
