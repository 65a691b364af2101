"""Printed and computed values of the paper's arch, vault tests and discrete elements.

The first half of `experiments.study.parts.counterpart_rows`: what the model rests on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd

from experiments.calibration.parts.barrel_vaults import chain, vaults
from experiments.calibration.parts.laws import BED, fit, laws
from experiments.discrete.parts.arches_lmgc90 import error, inner_nodes, moved
from experiments.discrete.parts.pad_readings import STEPS, Reading
from experiments.harness.yardstick import ROUNDING
from seqopt.arrays import Floats
from seqopt.engines.interface import Engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.placement.problem import Problem, pose
from seqopt.report.comparison import Comparison, compare
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.sequence.two_robots import METHODS
from seqopt.study.presets import EQUATIONS
from seqopt.study.published import as_printed
from seqopt.study.tables import printed

Rows = Iterator["Row"]


@dataclass(frozen=True)
class Row:
    """One printed value beside ours; ``rounding`` is what print and reading leave open."""

    quantity: str
    at: str
    printed: float
    ours: float
    rounding: float = ROUNDING


@dataclass(frozen=True)
class Ours:
    """What several counterparts are read from."""

    engine: ComplianceEngine
    methods: Comparison
    problem: Problem

    @property
    def scene(self) -> Scene:
        """The paper's arch as it ships."""
        return self.engine.network.scene

    def steps(self, method: str) -> pd.DataFrame:
        """Return the responses of a method by step, the support's as the paper prints them."""
        return as_printed(self.scene, self.methods.tables[method]).set_index("step")


def ours() -> Ours:
    engine = ComplianceEngine(build_network(load_scene("arch25")))
    problem = pose(engine, three_robot_loop(engine.network), EQUATIONS)
    return Ours(engine, compare(engine, EQUATIONS), problem)


def arch_corners(scene: Scene) -> Floats:
    """Return the corners of all bricks, (8 B, 3), m."""
    out = []
    for brick in scene.bricks:
        length, width = np.array(brick.length_axis), np.array(brick.width_axis)
        frame = np.stack([length, width, np.cross(length, width)])
        half = np.array(list(product((-0.5, 0.5), repeat=3))) * np.array(brick.dimensions)
        out.append(np.array(brick.position) + half @ frame)
    return np.concatenate(out)


def geometry(own: Ours) -> Rows:
    corners = arch_corners(own.scene)
    first, last = (np.array(ground.position) for ground in own.scene.grounds)
    along = (last - first) * [1, 1, 0]
    span = float(np.ptp(corners @ along / np.linalg.norm(along)))
    yield Row("span [mm]", "arch", 2080, 1e3 * span, 5)
    yield Row("height [mm]", "arch", 1930, 1e3 * float(np.ptp(corners[:, 2])), 5)
    yield Row("bricks", "arch", 25, len(own.scene.bricks))
    yield Row("mass [kg]", "brick", 3.66, own.scene.bricks[0].mass, 0.005)


def vault_dimensions(_own: Ours) -> Rows:
    """Measure every vault back from the joints of its model, which lie at half the thickness."""
    for vault in vaults():
        made, at = chain(vault), f"test {vault.test}"
        half = made.slope[0]
        shift = vault.thickness / 2 * np.array([np.sin(half), 1 - np.cos(half)])
        span = np.ptp(made.points[:, 0]) - 2 * shift[0]
        yield Row("L [mm]", at, 1e3 * vault.span, 1e3 * float(span), 5)
        rise = np.ptp(made.points[:, 1]) - shift[1]
        yield Row("r [mm]", at, 1e3 * vault.rise, 1e3 * float(rise), 5)
        yield Row("bricks", at, vault.bricks, len(made.points) - 1)
        place = float(made.loads[0]) - shift[0]
        yield Row("x [mm]", at, 1e3 * vault.load_at, 1e3 * float(place), 5)


def bed_of_springs() -> Floats:
    """Return the stiffness of every vault, kN/mm, under the best bed of springs."""
    law = laws(vaults())[BED]
    k_t, k_r = fit(law, "absolute", np.ones(len(law.tests), dtype=bool))
    return np.asarray(k_t * law.curves(np.array([k_r / k_t]))[:, 0] / 1e6)


def secant(_own: Ours) -> Rows:
    study = printed("arch_stiffness")
    k = float(bed_of_springs()[0])
    yield Row("analytical secant [kN/mm]", "test 1", study["k_m_kN_mm"][0], k, 0.5)


def stiffness(_own: Ours) -> Rows:
    study, k = printed("arch_stiffness"), bed_of_springs()
    error = 100 * (k / study["k_e_kN_mm"].to_numpy() - 1)
    for i, test in enumerate(study["test"]):
        yield Row("k_m [kN/mm]", f"test {test}", study["k_m_kN_mm"][i], k[i], 0.5)
        yield Row("e_rel [%]", f"test {test}", study["e_rel_percent"][i], error[i])
    mean = study["e_rel_percent"].abs().mean()
    yield Row("mean size of e_rel [%]", "all tests", mean, float(np.abs(error).mean()))


def nodes_compared(own: Ours) -> Rows:
    study = printed("de_validation").set_index("bricks")["nodes"]
    for bricks, number in STEPS.items():
        step = METHODS["sequential"](own.engine.network)[number - 1]
        count = len(inner_nodes(own.engine.network, step))
        yield Row("inner nodes that no robot holds", f"{bricks} bricks", study[bricks], count)


def discrete_elements(own: Ours) -> Rows:
    study = printed("de_validation").set_index("bricks")["error_percent"]
    discrete = Reading().engine(own.engine.network)
    for bricks, number in STEPS.items():
        step = METHODS["sequential"](own.engine.network)[number - 1]
        mean = error(moved(own.engine, step), moved(discrete, step))
        yield Row("mean error [%]", f"{bricks} bricks", study[bricks], mean)


def node_displacements(own: Ours, number: int) -> dict[str, pd.Series]:
    """Return displacements of the inner nodes that no robot holds, 1e-3 mm, by model."""
    net = own.engine.network
    step = METHODS["sequential"](net)[number - 1]
    names = [int(str(net.node_name[i])) for i in inner_nodes(net, step)]
    models: dict[str, Engine] = {
        "double cross": own.engine,
        "discrete elements": Reading().engine(net),
    }
    return {
        model: pd.Series(1e6 * moved(engine, step), names).sort_index()
        for model, engine in models.items()
    }
