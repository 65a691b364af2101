"""Claim: where its condition is met, a simpler model gives the answer of the next one in less time.

That is, to 1e-8 between planar, rigid and discrete bricks and to 1e-5 from rigid bricks to the
stiff-bar frame; and where its condition is not met a level is wrong by more than a tenth. For less:
in the median of rounds it takes less time, if only by a little where a plane is all it saves; for
`auto`, which where joints give way takes the discrete elements themselves, no more than a tenth
above theirs. The lowest ratio of a round is stored beside the median.

Method: a level and the next answer the same grip sets. Planar bricks: arches of 10 to 200 bricks in
one plane, three random grips (condition met), and `arch25` pressed flat into its middle plane,
every step of the sequential method (not met). Rigid bricks: every such step against the frame, and
against discrete elements with the paper's epoxy (met: all joints stay within their limits) and
without bonds (not met; some steps in which the bricks come to rest). The error is the largest
difference of the inner nodes' displacements over the largest displacement, in the worst set. Times
are medians of rounds in one process on one core, ratios those within rounds.

Inputs: the shipped scene; seed 0. Command: ``OPENBLAS_NUM_THREADS=1 python -m
experiments fidelity_ladder [--quick]``.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from statistics import median
from typing import NamedTuple, TypeVar

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.charts import note, subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import best, drawn, two
from experiments.harness.scenes import arch25, grip_sets
from seqopt import DRY, ArchShape, Scene, arch_scene, build_network, sequential
from seqopt.arrays import Floats, Ints, Vector
from seqopt.engines._auto import AutoEngine
from seqopt.engines._planar import PlanarEngine
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Engine, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.report._style import BLUE, GRAY, GREEN, VERMILION, dress, plain, styled
from seqopt.scene.parts import Brick, Ground, Joint

S = TypeVar("S", Joint, Ground)
SPAN = 6.0  # m along the line of a flat arch


def flat_arch(count: int) -> Scene:
    """Return a closed arch of bricks that all lie along it, in one plane."""
    pitch = np.linspace(1.3, -1.3, count)
    size = (SPAN / count, 0.116, 0.053)
    return arch_scene(ArchShape(pitch=pitch, pattern="V", dimensions=size, gap=0.0))


def flattened(scene: Scene) -> Scene:
    """Return a scene pressed into the plane y = 0; bricks laid across it keep their size along it.

    Nodes keep their numbers and all lie in the plane.
    """
    ends = tuple(replace(_spring(end), anchor=_pressed(end.anchor)) for end in scene.grounds)
    bricks, joints = tuple(map(_brick, scene.bricks)), tuple(map(_spring, scene.joints))
    name = f"{scene.name} flattened"
    return replace(scene, name=name, bricks=bricks, joints=joints, grounds=ends)


def _pressed(point: Sequence[float]) -> Vector:
    return point[0], 0.0, point[2]


def _unit(axis: Sequence[float]) -> Vector:
    size = float(np.hypot(axis[0], axis[2]))
    return axis[0] / size, 0.0, axis[2] / size


def _brick(brick: Brick) -> Brick:
    (length, width, height), axis = brick.dimensions, brick.length_axis
    if abs(axis[1]) > abs(brick.width_axis[1]):  # it lies across
        length, width, axis = width, length, brick.width_axis
    axes = {"length_axis": _unit(axis), "width_axis": (0.0, 1.0, 0.0)}
    place = _pressed(brick.position)
    return replace(brick, position=place, dimensions=(length, width, height), **axes)


def _spring(spring: S) -> S:
    position, along = _pressed(spring.position), _unit(spring.along)
    return replace(spring, position=position, along=along, across=(0.0, 1.0, 0.0))


EXACT, FRAME, WRONG = 1e-8, 1e-5, 0.1
SAME = 0.9  # ratio of times that are alike
SIZES = (10, 25, 50, 100, 200)
SETS = 200
MET, NOT_MET = "met", "not met"
RESTING = (3, 7, 13, 24, 40)  # steps of the sequential method that rest unbonded
LOOKS = {"planar": (GREEN, "s"), "rigid": (BLUE, "o"), "auto": (VERMILION, "D")}


Question = tuple[int, Ints]
"""Brick count and grip sets (S, r) of one partial structure."""


class Pair(NamedTuple):
    """A level and what it is held against, and what both are asked."""

    level: str
    against: str
    case: str
    condition: str
    first: Engine
    second: Engine
    questions: list[Question]


def steps_of(scene: Scene, numbers: tuple[int, ...] | None = None) -> list[Question]:
    """Return the steps of the sequential method, or some of them."""
    steps = sequential(build_network(scene))
    chosen = [step for step in steps if numbers is None or step.number in numbers]
    return [(s.bricks, np.array([s.held], dtype=np.int64).reshape(1, -1)) for s in chosen]


def pairs(*, quick: bool) -> Iterator[Pair]:
    for count in SIZES[: 1 if quick else None]:
        net = build_network(flat_arch(count))
        asked, case = [(count, grip_sets(net, count, SETS))], f"flat arch, {count} bricks"
        yield Pair("planar", "rigid", case, MET, PlanarEngine(net), ComplianceEngine(net), asked)
    rigid = arch25()
    net, scene = rigid.network, rigid.network.scene
    all_steps = steps_of(scene)[: 12 if quick else None]
    flat = PlanarEngine(build_network(flattened(scene)))
    yield Pair("planar", "rigid", "arch25 pressed flat", NOT_MET, flat, rigid, all_steps)
    yield Pair("rigid", "frame", "arch25", MET, rigid, FrameEngine(net), all_steps)
    bonded, dry = DiscreteEngine(net), DiscreteEngine(net, DRY)
    yield Pair("rigid", "discrete", "arch25, epoxy", MET, rigid, bonded, all_steps)
    yield Pair("auto", "discrete", "arch25, epoxy", MET, AutoEngine(net), bonded, all_steps)
    resting = steps_of(scene, RESTING[: 2 if quick else None])
    yield Pair("rigid", "discrete", "arch25, no bonds", NOT_MET, rigid, dry, resting)
    yield Pair("auto", "discrete", "arch25, no bonds", MET, AutoEngine(net, DRY), dry, resting)


def answer(engine: Engine, questions: list[Question]) -> list[Floats]:
    """Return the displacements (S, N, 3) of the inner nodes, per question."""
    out = []
    for bricks, grips in questions:
        moved = engine.solve(bricks, grips, Want.DISPLACEMENTS).displacement
        out.append(moved[:, engine.network.inner[:bricks].ravel()])
    return out


def _largest(values: Floats) -> Floats:
    return np.abs(values).max(axis=(1, 2))


def compare(pair: Pair, rounds: int) -> dict[str, object]:
    answers = (answer(engine, pair.questions) for engine in (pair.first, pair.second))
    errors = np.concatenate(
        [_largest(own - true) / _largest(true) for own, true in zip(*answers, strict=True)]
    )
    sets = sum(len(grips) for _, grips in pair.questions)
    times = []
    for _ in range(rounds):
        first = best(lambda: answer(pair.first, pair.questions), 3)
        start = time.perf_counter()
        answer(pair.second, pair.questions)
        times.append((first / sets, (time.perf_counter() - start) / sets))
    row = {"level": pair.level, "against": pair.against, "case": pair.case}
    row |= {"condition": pair.condition, "sets": sets, "error": errors.max()}
    row |= {"error_median": np.median(errors), "set_us": 1e6 * median(a for a, _ in times)}
    row |= {"against_us": 1e6 * median(b for _, b in times)}
    row |= {"ratio": median(b / a for a, b in times)}
    return row | {"ratio_lowest": min(b / a for a, b in times)}


def judge(table: pd.DataFrame) -> bool:
    met = table[table["condition"] == MET]
    limit = np.where(met["against"] == "frame", FRAME, EXACT)
    other = table[table["condition"] == NOT_MET]
    return bool((met["error"] <= limit).all() and (other["error"] > WRONG).all())


def cheaper(table: pd.DataFrame) -> bool:
    met = table[table["condition"] == MET]
    return bool((met["ratio"] > np.where(met["level"] == "auto", SAME, 1.0)).all())


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure, (left, right) = subplots(4.0, 1, 2, sharey=True, width_ratios=(1, 1.3))
    at = -np.arange(len(table))
    for y, (_, row) in zip(at, table.iterrows(), strict=True):
        color, marker = LOOKS[str(row["level"])]
        look = {"color": color, "ms": 7, "mfc": color if row["condition"] == MET else "white"}
        left.plot(max(float(row["error"]), 1e-16), y, marker, **look)
        times = [row["set_us"], row["against_us"]]
        right.plot(times, [y, y], color="#cccccc", lw=1, zorder=1)
        right.plot(times[1], y, "X", ms=6, color=GRAY)
        right.plot(times[0], y, marker, **look)
        note(right, f"{two(float(row['ratio']))} times", (max(times), y), (7, 0), va="center")
    left.set_yticks(at, table["level"] + " for " + table["against"] + ": " + table["case"])
    left.set(xscale="log", xlabel="error against the other model", xlim=(1e-17, 30))
    left.set_xticks([1e-16, 1e-12, 1e-8, 1e-4, 1], ["none", "1e-12", "1e-8", "1e-4", "1"])
    right.set(xscale="log", xlabel="time per set of grips [µs]", xlim=(0.7, 2e7))
    plain(right.xaxis)
    for axes in (left, right):
        dress(axes)
        axes.minorticks_off()
        axes.grid(visible=False, axis="y")
    names = {f"{name} bricks": look for name, look in LOOKS.items() if name != "auto"}
    names |= {"automatic choice": LOOKS["auto"], "its condition is not met": (GRAY, "o")}
    names |= {"the model that it stands for": (GRAY, "X")}
    for text, (color, marker) in names.items():
        face = "white" if "not met" in text else color
        left.plot([], [], marker, color=color, mfc=face, ms=6 if marker == "X" else 7, label=text)
    keys = left.get_legend_handles_labels()
    figure.legend(*keys, loc="outside lower center", ncols=5, columnspacing=1.2)
    return figure


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    table = pd.DataFrame(compare(pair, 1 if quick else 3) for pair in pairs(quick=quick))
    print(table.to_string(index=False, float_format="%.3g"))
    return Finding(judge(table) and (quick or cheaper(table)), tables={"fidelity_ladder": table})


CLAIM = Claim(
    experiment,
    digits=3,
    quick="few cases",
    pictures={"fidelity_ladder.png": drawn(chart, "fidelity_ladder")},
)
