"""Claim: without bond the sequential and the cantilever method fail; larger arches need more bond.

Method: every step of every method on `arch25` is certified as rigid blocks (friction
25 degrees) beside its elastic responses and the paper's limits (0.1 mm, 30 N m, payload 392.4 N).
Then the same bricks make longer arches of the same shape. Payloads grow there with the number of
bricks, so that the bond alone is asked about; what robots would have to carry stands beside it.

The claims of Bruun et al., as they are tested: (1) the twisting steps make the sequential method
fail first, and the sooner the larger the arch; (2) the cantilever method leans on the mortar: most
steps with cantilevered bricks stand by bond alone, and it needs more bond than the sequential
method; (3) the three-robot plan needs less bond than both. One arch, and arches of its shape.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.harness.charts import name_panels, note, subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import drawn
from experiments.harness.scenes import arch25, longer, method_steps
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt import Network, Scene, Step, build_network, pose, solve
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import DRY, EPOXY
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.network import GROUND
from seqopt.report._style import GRAY, dress, looks, plain, styled
from seqopt.responses.table import analyze, force_column
from seqopt.sequence.methods import METHODS, three_robot_loop
from seqopt.stability._steps import assess_steps, stability_table
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import Prover
from seqopt.stability.verdict import ASSESSED
from seqopt.study import EQUATIONS

ORDINARY = 0.10e6  # Pa: flexural bond of general-purpose mortar, EN 1996-1-1, 3.6.4
LIMITS = {"D_max_1e-3mm": 100.0, "M_sup_Nm": 30.0, "F_largest_N": 392.4}
NONE = 100.0  # Pa: less than any bond that a step needs, drawn for none
SIZES, OPTIMIZED = (1, 2, 4), 2  # times the reference arch
NAMES = {
    "sequential": "sequential",
    "cantilever": "cantilever",
    "three-robot, published": "three robots, published plan",
    "three-robot, optimized": "three robots, optimized plan",
}
LOOKS = looks(NAMES)
FEW = (*METHODS, "three-robot, published")
EVERY = (*METHODS, "modified sequential", *[*NAMES][2:], "three-robot, minimax")
TWISTING = (9, 11, 21, 23, 33, 35, 45, 47)  # table 4 of the paper


def cantilevered(net: Network, step: Step) -> int:
    """Return how many bricks were placed after the last one that is held or stands on ground."""
    block = {node: i + 1 for i, brick in enumerate(net.scene.placed) for node in brick.nodes}
    grounded = (net.springs.since <= step.bricks) & (net.springs.bodies[:, 0] == GROUND)
    standing = 1 + int(net.springs.bodies[grounded, 1].max())
    return step.bricks - max([standing, *(block[node] for node in step.held)])


COLUMNS = [
    "method", "step", "type", "bricks", "cantilevered", "bond_needed_Pa", "dry",
    "dry_friction_needed", "dry_tilt_deg", "dry_grip_N", "first_brick", "first_joint", "epoxy",
    "epoxy_tilt_deg", "epoxy_grip_N", "F_largest_N", "M_sup_Nm", "D_max_1e-3mm", "unproven",
]  # fmt: skip
ENDS = {
    "verdict": "",
    "friction_needed": "_friction_needed",
    "tilt_survived_deg": "_tilt_deg",
    "largest_grip_force_N": "_grip_N",
}  # of the names of columns, after the mortar's


def tabulate(engine: ComplianceEngine, name: str, steps: tuple[Step, ...]) -> pd.DataFrame:
    """Return margins and elastic responses of every step."""
    net = engine.network
    table = analyze(engine, steps)
    robots = [force_column(robot) for robot in net.scene.robots]
    largest = table[robots].abs().max(axis=1).fillna(0.0)
    found = (assess_steps(net, steps, mortar, ASSESSED) for mortar in (DRY, EPOXY))
    dry, bound = (stability_table(steps, each) for each in found)
    own = {name: f"dry{end}" for name, end in ENDS.items()}
    other = {name: f"epoxy{end}" for name, end in ENDS.items()}
    out = dry.rename(columns=own).join(bound[[*ENDS]].rename(columns=other))
    out = out.join(table[["M_sup_Nm", "D_max_1e-3mm"]]).assign(method=name, F_largest_N=largest)
    out["cantilevered"] = [cantilevered(net, step) for step in steps]
    out["unproven"] = dry["unproven"] + bound["unproven"]
    return out[COLUMNS]


Rows = Iterator[dict[str, object]]
Plans = dict[str, tuple[Step, ...]]


def bond(net: Network, step: Step) -> float:
    """Return the bond that a step needs, Pa."""
    assembly = step_assembly(net, step.bricks, step.grips)
    proven = Prover(assembly, compile_equilibrium)(bonded(assembly, DRY))
    return proven.value * assembly.stress_scale


def extremes(engine: ComplianceEngine, times: int, methods: Plans) -> Rows:
    """Yield the largest bond and responses of every method on an arch."""
    scene = engine.network.scene
    for name, steps in methods.items():
        table = analyze(engine, steps)
        robots = [force_column(robot) for robot in scene.robots]
        needed = np.array([bond(engine.network, step) for step in steps])
        row = {"times": times, "bricks": len(scene.bricks), "method": name}
        row |= {"bond_needed_Pa": needed.max()}
        row |= {"steps_without_bond_pct": 100 * float((needed <= 1e-6 * needed.max()).mean())}
        row |= {"F_largest_N": float(table[robots].astype(float).abs().max(axis=None))}
        yield row | table[["M_sup_Nm", "D_max_1e-3mm"]].max().to_dict()


def growth(scene: Scene, sizes: tuple[int, ...]) -> Rows:
    """Yield the extremes of longer arches; the choice for the longest is a study of its own."""
    for times in sizes:
        engine = ComplianceEngine(build_network(longer(scene, times)))
        net = engine.network
        made = {name: tuple(method(net)) for name, method in METHODS.items()}
        if times <= OPTIMIZED:
            loop = pose(engine, three_robot_loop(net), EQUATIONS)
            made["three-robot, optimized"] = solve(loop, "overlap_dp").steps
        yield from extremes(engine, times, made)


def holds(steps: pd.DataFrame, scale: pd.DataFrame) -> dict[str, bool]:
    worst = steps.groupby("method")["bond_needed_Pa"].max()
    falls = steps[steps["dry"] != "stands"]
    fell = {*falls[falls["method"] == "sequential"]["step"]}
    hanging = steps[(steps["method"] == "cantilever") & (steps["cantilevered"] > 0)]
    grows = scale[scale["method"].isin(METHODS)].pivot_table(
        values="bond_needed_Pa", index="method", columns="times"
    )
    published, cantilever, sequential = (
        worst[name] for name in ("three-robot, published", "cantilever", "sequential")
    )
    decided = (steps["epoxy"] == "stands").all() and (steps["unproven"] == 0).all()
    parts = {
        "every step is decided, and stands with the paper's epoxy": decided,
        "without bond the sequential method falls at every twisting step": {*TWISTING} <= fell,
        "the cantilever method has steps that stand by bond alone, all with cantilevered bricks "
        "among them": (hanging["dry"] != "stands").all(),
        "it needs more bond than the sequential method": cantilever > sequential,
        "the published plan needs less than both": published < min(cantilever, sequential),
        "the bond both need grows with the arch": (
            (grows.diff(axis=1).iloc[:, 1:] > 0).all(axis=None)
        ),
    }
    return {text: bool(true) for text, true in parts.items()}


def experiment(options: Options) -> Finding:
    engine = arch25()
    made = method_steps(engine, FEW if options.quick else EVERY)
    if options.quick:
        late = (5, 6, 11, 12, 17, 18, 23, 24)
        made = {n: tuple(step for step in m if step.bricks in late) for n, m in made.items()}
    steps = pd.concat([tabulate(engine, name, part) for name, part in made.items()])
    sizes = SIZES[: 1 if options.quick else None]
    scale = pd.DataFrame(growth(engine.network.scene, sizes))
    for name, table in steps.groupby("method", sort=False):
        falls = table[table["dry"] != "stands"]
        numbers = ", ".join(map(str, falls["step"]))
        print(f"{name}: {len(table)} steps, {len(falls)} fall without bond ({numbers})")
    print(scale.to_string(index=False, float_format="%.4g"))
    tables = {"failing_steps": steps, "failing_scale": scale}
    return Finding(holds(steps, scale), tables=tables)


@styled
def chart(steps: pd.DataFrame, scale: pd.DataFrame) -> Figure:
    figure, ((bond, shift), (force, size)) = subplots(6.6, 2, 2)
    for name, style in LOOKS.items():
        table = steps[steps["method"] == name]
        worst = table.groupby("bricks")[["bond_needed_Pa", "D_max_1e-3mm", "F_largest_N"]].max()
        line = style.line() | {"lw": 1.2, "ms": 4, "markevery": 2, "label": NAMES[name]}
        bond.semilogy(worst["bond_needed_Pa"].clip(lower=NONE) / 1e3, **line)
        shift.semilogy(worst["D_max_1e-3mm"], **line)
        force.plot(worst["F_largest_N"], **line)
    for axes, at, up in ((bond, 0.01, 2), (size, 0.66, -9)):
        _limit(axes, EPOXY.tensile_strength / 1e3, "epoxy, 3 MPa", 0.01)
        _limit(axes, ORDINARY / 1e3, "mortar, 0.1 MPa", at, up)
    _limit(shift, LIMITS["D_max_1e-3mm"], "limit of Bruun et al.")
    _limit(force, LIMITS["F_largest_N"], "payload")
    bond.set(ylabel="bond needed [kPa]", ylim=(0.7 * NONE / 1e3, 2e4), title="bond")
    ticks = [NONE / 1e3, 1.0, 10.0, 100.0, 1e3]
    bond.set_yticks(ticks, ["none", *(f"{tick:,g}" for tick in ticks[1:])])
    shift.set(ylabel="largest displacement D_max [1e-3 mm]", title="displacement, bonded bricks")
    force.set(ylabel="largest robot force [N]", ylim=(0, 460), title="robot force, bonded bricks")
    shift.set_ylim(2e-3, 2e3)
    for axes in (bond, shift, force):
        axes.set_xlabel("bricks placed")
    plain(shift.yaxis)
    _grow(size, scale)
    dress(bond, shift, force, size)
    name_panels(bond, shift, force, size)
    figure.legend(*bond.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _limit(axes: Axes, value: float, text: str, at: float = 0.01, up: float = 2) -> None:
    axes.axhline(value, color=GRAY, lw=1, ls="-")
    note(axes, text, (at, value), (0, up), xycoords=("axes fraction", "data"))


def _grow(axes: Axes, scale: pd.DataFrame) -> None:
    for name, table in scale.groupby("method", sort=False):
        line = LOOKS[str(name)].line() | {"ms": 4.5, "lw": 1.2}
        axes.loglog(table["times"], table["bond_needed_Pa"] / 1e3, **line)
    axes.set(xlabel="times as many bricks", ylabel="bond needed [kPa]", ylim=(8, 1e5))
    axes.set_xticks(SIZES, [f"{n}×" for n in SIZES])
    plain(axes.yaxis)
    axes.minorticks_off()
    axes.set_title("bond, longer arches")


CLAIM = Claim(
    experiment,
    digits=5,
    quick="late steps",
    pictures={"failing_steps.png": drawn(chart, "failing_steps", "failing_scale")},
)
