"""What `experiments.calibration.identify_arch25` fits: the numbers, and the scene of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from experiments.harness.results import RESULTS
from experiments.harness.yardstick import ROUNDING, errors, percentiles, tension_share
from seqopt import ArchShape, Scene, analyze, arch_scene, build_network, load_scene
from seqopt.arrays import Floats
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.scene.parts import Brick
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import PUBLISHED, ROBOTS, as_printed, printed_steps, published_plan

SPAN, HEIGHT, BRICKS = 2.08, 1.93, 25  # m, section 3.1
# Which node of a brick that lies across is on the arch line: the grips that twist in A.1 and A.2.
LINE_NODES = {2: 2, 3: 4, 5: 9, 6: 10, 8: 15, 9: 16, 11: 21, 12: 22, 14: 26, 15: 28,
              17: 32, 18: 34, 20: 39, 21: 40, 23: 45, 24: 46}  # fmt: skip
ALONG = [b for b in range(BRICKS) if b % 3 == 0]
ACROSS = [b for b in range(BRICKS) if b % 3 != 0]
PLAN_ANGLES = np.radians([-5.0, 5.0])
PROVENANCE = (  # word for word that of the shipped scene, which came from there
    "Geometry and joint stiffness identified from Tables A.1 and A.2 of Bruun et al., arXiv "
    "2104.04856, by experiments/identify_arch25.py; brick, density, payload and pattern as printed "
    "there (section 3.1)."
)


@dataclass(frozen=True)
class Free:
    """A group of fitted numbers: name, unit, how many, and a typical change."""

    name: str
    unit: str
    count: int
    step: float


SHAPE = (
    Free("pitch", "rad", BRICKS, 0.05),
    Free("plan_angle", "rad", 1, 0.03),
    Free("yaw", "rad", len(ALONG), 0.02),
    Free("gap", "m", 1, 1e-3),
    Free("overhang", "m", 1, 1e-3),
    Free("stub", "m", 1, 5e-3),
    Free("log_translational_stiffness", "ln N/m", 1, 0.05),
    Free("log_rotational_stiffness", "ln N m/rad", 1, 0.05),
)
OFFSETS = Free("offset", "m", BRICKS, 1e-3)
TILTS = Free("tilt", "rad", BRICKS - len(ALONG), 0.03)  # in the place of the plan angle
ALONG_AND_ACROSS = (
    Free("log_translational_stiffness", "ln N/m", 2, 0.05),
    Free("log_rotational_stiffness", "ln N m/rad", 2, 0.05),
)
NO_YAW = tuple(group for group in SHAPE if group.name != "yaw")
VARIANTS = {
    "first stage": SHAPE,
    "line in a plane": NO_YAW,
    "free tilts": tuple(TILTS if g.name == "plan_angle" else g for g in SHAPE),
    "free tilts, line in a plane": tuple(TILTS if g.name == "plan_angle" else g for g in NO_YAW),
    "joints along and across": (*SHAPE[:-2], *ALONG_AND_ACROSS),
}


def unpack(numbers: Floats, groups: Sequence[Free]) -> dict[str, Floats]:
    """Return the numbers by the name of their group."""
    ends = np.cumsum([group.count for group in groups])
    return dict(zip((g.name for g in groups), np.split(numbers, ends[:-1]), strict=True))


def scene_of(numbers: Floats, groups: Sequence[Free]) -> Scene:
    part = unpack(numbers, groups)
    pitch = part["pitch"]
    yaw, roll = np.zeros(BRICKS), part.get("plan_angle", 0.0) * np.sin(pitch)
    if "yaw" in part:
        yaw[ALONG] = part["yaw"]
    if "tilt" in part:
        roll[ACROSS] = part["tilt"]
    kinds = ("translational", "rotational")
    linear, angular = (np.exp(part[f"log_{kind}_stiffness"]).tolist() for kind in kinds)
    shape = ArchShape(
        pitch=_within_a_turn(pitch),
        roll=_within_a_turn(roll),
        yaw=_within_a_turn(yaw),
        offset=part.get("offset", np.zeros(BRICKS)).tolist(),
        **{name: float(part[name][0]) for name in ("gap", "overhang", "stub")},
        translational_stiffness=(linear[0], linear[-1], linear[-1]),
        rotational_stiffness=(angular[0], angular[-1], angular[-1]),
    )
    scene = arch_scene(shape, "arch25", robots=ROBOTS, provenance=PROVENANCE)
    return replace(scene, bricks=tuple(map(_as_numbered, scene.bricks)))


def _as_numbered(brick: Brick) -> Brick:
    """Return a brick whose nodes have the paper's numbers: that on the arch line may be second."""
    if LINE_NODES.get(brick.name, brick.nodes[0]) == brick.nodes[0]:
        return brick
    other = sum(brick.nodes) - brick.placing_node
    return replace(brick, nodes=brick.nodes[::-1], placing_node=other)


def _within_a_turn(angles: Floats) -> list[float]:
    """Return the same directions by the smallest angles, for a search may step beyond a turn."""
    turns: list[float] = (angles - 2 * np.pi * np.round(angles / (2 * np.pi))).tolist()
    return turns


def starting_guess() -> Floats:
    """Return a catenary over the stated span and height, nominal joints, no tilt and no yaw."""
    half = SPAN / 2
    a = brentq(lambda c: c * (np.cosh(half / c) - 1) - HEIGHT, 0.1, 5.0)
    length = np.where(np.arange(BRICKS) % 3 == 0, 0.246, 0.116) + 0.014
    middle = np.cumsum(length) - length / 2
    along = (middle / length.sum() - 0.5) * 2 * a * np.sinh(half / a)
    pitch = np.arctan(-along / a)
    area = 0.116 * 0.053  # contact, m²; the paper prints stiffness per area, two springs in series
    stiffness = np.log([100e9 * area / 2, 0.9e9 * area / 2])
    return np.concatenate([pitch, [0.0], np.zeros(len(ALONG)), [0.014, 0.0615, 0.09], stiffness])


def start_of(groups: Sequence[Free]) -> Floats:
    """Return the starting guess for a set of numbers, tilted by the first plan angle."""
    begin = unpack(starting_guess(), SHAPE)
    begin["plan_angle"] = PLAN_ANGLES[:1]
    begin["tilt"] = (PLAN_ANGLES[0] * np.sin(begin["pitch"]))[ACROSS]
    return np.concatenate([np.resize(begin[group.name], group.count) for group in groups])


def report(numbers: Floats, groups: Sequence[Free]) -> pd.DataFrame:
    rows = [
        {"name": group.name, "index": i, "unit": group.unit, "value": value}
        for group in groups
        for i, value in enumerate(unpack(numbers, groups)[group.name].tolist())
    ]
    return pd.DataFrame(rows)


NUMBERS = RESULTS / "identify_arch25.csv"
FITTED = ("sequential", "cantilever")
UNSEEN, BESIDE = PUBLISHED, "Table B.1, "  # what took no part, and how its rows begin
PERCENTILES = ["median_pct", "p90_pct", "p95_pct"]
LIMITS = [0.15, 1.9, 4.0]  # percent, for the fitted tables and for the one that took no part


def scores(scene: Scene) -> pd.DataFrame:
    """Return the yardstick of a scene on the fitted tables and on the one that took no part."""
    engine = ComplianceEngine(build_network(scene))
    rows, all_errors = {}, []
    steps = {name: METHODS[name](engine.network) for name in FITTED}
    for name, sequence in (*steps.items(), (UNSEEN, published_plan(scene))):
        printed = printed_steps(name)
        table = as_printed(scene, analyze(engine, sequence))
        all_errors.append(errors(table, printed))
        rows[name] = (*percentiles(all_errors[-1]), 100 * tension_share(table, printed))
    rows["both"] = (*percentiles(pd.concat(all_errors[: len(FITTED)])), np.nan)
    columns = [*PERCENTILES, "T_pct_within_2_edges_pct"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


def beside_shipped(fitted: pd.DataFrame, scene: Scene) -> pd.DataFrame:
    """Return percentiles of a fit beside the shipped ones, and how far its numbers are off."""
    new, old = (scores(one) for one in (scene, load_scene("arch25")))
    rows = [
        {"what": prefix + name, "unit": "%", "shipped": old[name][row], "new": new[name][row]}
        for row, prefix in (("both", ""), (UNSEEN, BESIDE))
        for name in PERCENTILES
    ]
    table = pd.DataFrame(rows)
    table["difference"] = table["new"] - table["shipped"]
    both = fitted.merge(pd.read_csv(NUMBERS), on=["name", "index", "unit"])
    gap = (both["value_x"] - both["value_y"]).abs().groupby([both["name"], both["unit"]]).max()
    far = gap.rename_axis(["what", "unit"]).reset_index(name="difference")
    far["what"] += ", largest difference"
    return pd.concat([table, far], ignore_index=True)


def holds(table: pd.DataFrame, *, quick: bool) -> bool:
    part = table.set_index("what")
    every = [*PERCENTILES, *(BESIDE + name for name in PERCENTILES)]
    good = (part.loc[every, "shipped"].to_numpy(float) <= 2 * LIMITS).all()
    return bool(good and (quick or (part.loc[PERCENTILES, "difference"] <= ROUNDING).all()))
