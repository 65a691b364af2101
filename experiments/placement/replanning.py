"""Claim: from every step of a plan the rest, planned anew, is at least as good as it was planned.

Method: on `arch25` the fixed methods, the published plan, the plan of the loop (criterion
`equations-2-3`) and the free plan of least worst step and fewest steps. From every step the rest is
planned anew as a free schedule of the robots that grip, with nothing changed, by the rules that the
plan keeps and with proof; its worst step (criterion `worst-ratio`, engine `compliance`) is compared
with that of the steps that were planned; where all bricks stand, and robots hold them at the end,
nothing is left to plan. The claim fails if one is worse, if one that goes on from
the free plan is not equal in both aims, or if one has no proof. Then one robot is lost at every
step of the free plan: the claim fails if there is neither a plan nor a reason that names what would
help.

Inputs: the shipped scene. Command: ``python -m experiments replanning [--quick]``.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd

import seqopt
from experiments.harness.claim import Claim, Finding, Options
from seqopt.errors import InfeasibleError, StepError
from seqopt.judge._rule_moves import check_free
from seqopt.plan.pose import states_of
from seqopt.plan.replan import goes_on, without
from seqopt.sequence.rules import Ending, FreeRules
from seqopt.sequence.site import Site
from seqopt.sequence.steps import Step, idle_robots
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import published_plan

AIM = "minmax,steps"
ENDINGS = ("released", "one-by-one", "held")
SAME = 1e-9


def kept_rules(engine: seqopt.Engine, steps: tuple[Step, ...]) -> FreeRules:
    """Return the strictest rules that a plan keeps."""
    payload = {} if _within(engine, steps) else {"payload": "ignored"}
    idle = idle_robots(engine.network.scene, steps)
    team = tuple(r.name for r in engine.network.scene.robots if r.name not in idle)
    for newest, least, ending in product(("either", "free"), (2, 1, 0), ENDINGS):
        rules = FreeRules(least_grips=least, newest=newest, ending=ending, robots=team, **payload)
        try:
            check_free(engine.network, rules, steps)
        except StepError:
            continue
        return rules
    raise AssertionError("no rules are kept")


def _within(engine: seqopt.Engine, steps: tuple[Step, ...]) -> bool:
    """Return whether no step of a plan exceeds a payload."""
    table = seqopt.analyze(engine, steps)
    robots = engine.network.scene.robots
    return all(not (table[f"F_{r.name}_N"] > r.payload).any() for r in robots)


def plans(engine: seqopt.Engine) -> dict[str, tuple[Step, ...]]:
    """Return the plans by name."""
    network = engine.network
    found = {name: method(network) for name, method in METHODS.items()}
    found["published"] = published_plan(network.scene)
    found["loop"] = seqopt.optimize(network.scene, "three-robot", engine="compliance").steps
    found["free"] = seqopt.optimize(network.scene, "free", aim=AIM, engine="compliance").steps
    return found


def rests(engine: seqopt.Engine, every: int) -> Iterator[dict[str, object]]:
    """Yield what the rest of each plan takes as planned, and planned anew, from its steps."""
    worst = seqopt.CRITERIA["worst-ratio"]
    for name, steps in plans(engine).items():
        rules = kept_rules(engine, steps)
        for done in range(0, len(steps), every):
            begin = Site.after(steps, done) if done else None
            if begin and rules.ending is Ending.HELD and begin.bricks == steps[-1].bricks:
                continue  # such a build has ended
            problem = seqopt.pose(engine, replace(rules, begin=begin), worst, AIM)
            old = goes_on(states_of(problem), steps[done:])
            start = time.process_time()
            plan = seqopt.solve(problem)
            yield {
                "plan": name,
                "step": done,
                "planned": old["minmax"],
                "planned_steps": old["steps"],
                "anew": plan.objective["minmax"],
                "anew_steps": plan.objective["steps"],
                "status": str(plan.status),
                "seconds": time.process_time() - start,
            }


def losses(engine: seqopt.Engine, every: int) -> Iterator[dict[str, object]]:
    """Yield what becomes of the free plan where a robot is lost after one of its steps."""
    scene = engine.network.scene
    steps = seqopt.optimize(scene, "free", aim=AIM, engine="compliance").steps
    for done, robot in product(range(1, len(steps), every), scene.robots):
        _, begin = without(scene, Site.after(steps, done), [robot.name])
        rules = FreeRules(begin=begin)
        left = tuple(each.name for each in scene.robots if each is not robot)
        start, plan, said = time.process_time(), None, ""
        try:
            plan = seqopt.optimize(
                scene, "free", aim=AIM, engine="compliance", rules=rules, robots=left
            )
        except InfeasibleError as error:
            said = str(error)
        yield {
            "step": done,
            "lost": robot.name,
            "plan": plan is not None,
            "said": said,
            "seconds": time.process_time() - start,
        }


def holds(rest: pd.DataFrame, loss: pd.DataFrame) -> dict[str, bool]:
    """Return whether each part of the claim holds."""
    free = rest[rest["plan"] == "free"]
    better = rest["anew"] <= rest["planned"] * (1 + SAME)
    named = loss["plan"] | loss["said"].str.contains("becomes possible|extend a reach")
    equal = np.isclose(free["anew"], free["planned"], rtol=SAME).all()
    equal &= (free["anew_steps"] == free["planned_steps"]).all()
    return {
        "no rest that is planned anew is worse": bool(better.all()),
        "from the free plan it is as good": bool(equal),
        "all are proven": bool((rest["status"] == "optimal").all()),
        "a robot lost: a plan, or a reason that names what would help": bool(named.all()),
    }


def experiment(options: Options) -> Finding:
    engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
    every = 45 if options.quick else 1
    rest, loss = (pd.DataFrame(each(engine, every)) for each in (rests, losses))
    for name, rows in rest.groupby("plan", sort=False):
        gain = (1 - rows["anew"] / rows["planned"]).max()
        print(f"{name}: {len(rows)} steps, rest better by up to {100 * gain:.3g} %")
    found = int(loss["plan"].sum())
    print(f"one robot lost: {found} of {len(loss)} have a plan, {len(loss) - found} a reason")
    slowest = max(rest["seconds"].max(), loss["seconds"].max())
    print(f"processor time of the slowest: {slowest:.2f} s")
    tables = {"replanning": rest, "replanning_losses": loss}
    return Finding(holds(rest, loss), tables=tables)


CLAIM = Claim(experiment, digits=6, quick="some steps")
