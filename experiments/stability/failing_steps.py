"""Claim: without bond the sequential and the cantilever method fail; larger arches need more bond.

Method: every step of every method on `arch25` is certified as rigid blocks (friction 25 degrees)
beside its elastic responses and the paper's limits (0.1 mm, 30 N m, payload 392.4 N). Then the
same bricks make longer arches of the same shape, and the same arch is built larger or of heavier
bricks. Payloads grow there with the number of bricks and with their weight, so that the bond alone
is asked about; what robots would have to carry stands beside it.

The claims of Bruun et al., as they are tested: (1) the twisting steps make the sequential method
fail first, and the sooner the larger the arch; (2) the cantilever method leans on the mortar: most
steps with cantilevered bricks stand by bond alone, and it needs more bond than the sequential
method; (3) the three-robot plan needs less bond than both. One arch, and arches of its shape.

Inputs: the shipped scene and plan. Command: ``python -m experiments.stability.failing_steps
[--quick]``. Writes ``experiments/results/failing_steps.csv``, ``failing_scale.csv`` and
``docs/figures/failing_steps.png``.
"""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.plotting import RESULTS, save_all, stored
from experiments.stability.parts.failing_chart import SIZES, chart
from experiments.stability.parts.larger_arches import Plans, growth
from seqopt.contact.mortar import DRY, EPOXY
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.network.network import GROUND, Network
from seqopt.placement.problem import pose
from seqopt.placement.solving import solve
from seqopt.responses.table import analyze, force_column
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.steps import Step
from seqopt.sequence.three_robots import modified_sequential, three_robot_loop
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import assess_steps, stability_table
from seqopt.study.presets import EQUATIONS
from seqopt.study.published import published_plan

TWISTING = (9, 11, 21, 23, 33, 35, 45, 47)  # table 4 of the paper
SCALED = ("sequential", "cantilever", "three-robot, published", "three-robot, optimized")


def plans(engine: ComplianceEngine) -> Plans:
    """Return the steps of every method of the reference arch."""
    net = engine.network
    out = {name: method(net) for name, method in METHODS.items()}
    modified = pose(engine, modified_sequential(net), EQUATIONS)
    out["modified sequential"] = solve(modified, "cascade").steps
    out["three-robot, published"] = published_plan(net.scene)
    loop = pose(engine, three_robot_loop(net), EQUATIONS)
    out["three-robot, optimized"] = solve(loop, "overlap_dp").steps
    out["three-robot, minimax"] = solve(loop, "minimax").steps
    return out


def cantilevered(net: Network, step: Step) -> int:
    """Return how many bricks were placed after the last one that is held or stands on ground."""
    block = {node: i + 1 for i, brick in enumerate(net.scene.placed) for node in brick.nodes}
    grounded = (net.springs.since <= step.bricks) & (net.springs.bodies[:, 0] == GROUND)
    standing = 1 + int(net.springs.bodies[grounded, 1].max())
    return step.bricks - max([standing, *(block[node] for node in step.held)])


def tabulate(engine: ComplianceEngine, name: str, steps: tuple[Step, ...]) -> pd.DataFrame:
    """Return margins and elastic responses of every step."""
    net = engine.network
    table = analyze(engine, steps)
    robots = [force_column(robot) for robot in net.scene.robots]
    largest = table[robots].abs().max(axis=1).fillna(0.0)
    dry = stability_table(steps, assess_steps(net, steps, DRY))
    bound = stability_table(steps, assess_steps(net, steps, EPOXY))
    return pd.DataFrame(
        {
            "method": name,
            "step": dry["step"],
            "type": dry["type"],
            "bricks": dry["bricks"],
            "cantilevered": [cantilevered(net, step) for step in steps],
            "bond_needed_Pa": dry["bond_needed_Pa"],
            "dry": dry["verdict"],
            "dry_friction_needed": dry["friction_needed"],
            "dry_tilt_deg": dry["tilt_survived_deg"],
            "dry_grip_N": dry["largest_grip_force_N"],
            "first_brick": dry["first_brick"],
            "first_joint": dry["first_joint"],
            "epoxy": bound["verdict"],
            "epoxy_tilt_deg": bound["tilt_survived_deg"],
            "epoxy_grip_N": bound["largest_grip_force_N"],
            "F_largest_N": largest,
            "M_sup_Nm": table["M_sup_Nm"],
            "D_max_1e-3mm": table["D_max_1e-3mm"],
            "unproven": dry["unproven"] + bound["unproven"],
        }
    )


def holds(steps: pd.DataFrame, scale: pd.DataFrame) -> dict[str, bool]:
    """Return the parts of the claim and whether the tables bear them out."""
    worst = steps.groupby("method")["bond_needed_Pa"].max()
    falls = steps[steps["dry"] != "stands"]
    twisting = falls[falls["method"] == "sequential"]["step"]
    hanging = steps[(steps["method"] == "cantilever") & (steps["cantilevered"] > 0)]
    grows = scale[scale["method"].isin(METHODS)].pivot_table(
        values="bond_needed_Pa", index=["scaling", "method"], columns="times"
    )
    published = worst["three-robot, published"]
    return {
        "every step is decided, and stands with the paper's epoxy": bool(
            (steps["epoxy"] == "stands").all() and (steps["unproven"] == 0).all()
        ),
        "without bond the sequential method falls at every twisting step": set(TWISTING)
        <= set(twisting),
        "the cantilever method has steps that stand by bond alone, all with cantilevered bricks "
        "among them": bool((hanging["dry"] != "stands").all()),
        "it needs more bond than the sequential method": bool(
            worst["cantilever"] > worst["sequential"]
        ),
        "the published plan needs less than both": bool(
            published < min(worst["cantilever"], worst["sequential"])
        ),
        "the bond both need grows with every scaling": bool(
            (grows.diff(axis=1).iloc[:, 1:] > 0).all(axis=None)
        ),
    }


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    scene = load_scene("arch25")
    engine = ComplianceEngine(build_network(scene))
    made = plans(engine)
    if quick:
        made = {name: made[name] for name in (*METHODS, "three-robot, published")}
        made = {
            name: tuple(step for step in steps if step.bricks in (5, 6, 11, 12, 17, 18, 23, 24))
            for name, steps in made.items()
        }
    steps = pd.concat([tabulate(engine, name, part) for name, part in made.items()])
    fixed = {name: made[name] for name in SCALED if name in made}
    scale = pd.DataFrame(growth(scene, fixed, SIZES[: 1 if quick else None]))
    for name, table in steps.groupby("method", sort=False):
        falls = table[table["dry"] != "stands"]
        numbers = ", ".join(map(str, falls["step"]))
        print(f"{name}: {len(table)} steps, {len(falls)} fall without bond ({numbers})")
    print(scale.to_string(index=False, float_format="%.4g"))
    parts = holds(steps, scale)
    for text, true in parts.items():
        print(f"{'yes' if true else 'NO'}: {text}")
    if not quick:
        RESULTS.mkdir(exist_ok=True)
        steps.to_csv(RESULTS / "failing_steps.csv", index=False, float_format="%.5g")
        scale.to_csv(RESULTS / "failing_scale.csv", index=False, float_format="%.5g")
        save_all(PICTURES)
    return Finding(all(parts.values()))


PICTURES: dict[str, Callable[[], Figure]] = {
    "failing_steps.png": lambda: chart(stored("failing_steps"), stored("failing_scale")),
}
CLAIM = Claim(experiment, quick="late steps only, nothing written", pictures=PICTURES)

if __name__ == "__main__":
    CLAIM.main()
