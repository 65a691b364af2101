"""Claim: the free schedule is proven best soon; what a model leaves out costs more than a search.

On five scenes, the reference arch, with grips of 1e6 N/m, and laid dry, a barrel vault and a wall,
what README says to take proves that no plan of the free schedule has a lower worst step. With soft
grips other ways are sooner, and lose at least a percent, as a greedy choice of the loop's grips
does on the wall; plans that were chosen for rigid ones are at least twice as bad, and so are those
of the loop chosen by ranks. Laid dry, plans fall unless it is asked that they stand. Where a
stiff-bar frame answers, it takes at least five times as long as rigid bricks the same way. That six
digits decide where they can changes no plan, and on a large arch every search is sooner by it. If
earlier steps lock something in, the worst step of every plan is at least twice what it promised.

Method: what ``seqopt compare --speed`` measures, all ways in two minutes a scene, in processor time
from the scene to the plan. Every scene has a process of its own on one core. Nothing is random.
Beside it searches without proof in turn with an engine that gives all digits whatever is enough.
"""

import json
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import contextmanager

import pandas as pd

import seqopt
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import apart, drawn
from experiments.harness.scenes import barrel_vault, scene_named
from experiments.placement.parts.staged import staged_fields, worst_ratio
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.report._regret._chart import regret_chart
from seqopt.report._regret._measure import RIGID_GRIPS, Timer, measure_regret
from seqopt.report._regret._table import DONE, RegretTable
from seqopt.responses.scales import SceneFacts
from seqopt.sequence.rules import FREE, FreeRules
from seqopt.sequence.steps import Step, StepKind

ARCH, SOFT, DRY = "arch25", "arch25, soft grips", "arch25, laid dry"
STAGED = "arch25, staged"  # with what earlier steps lock in
BARREL = "barrel vault"  # the first of the tested vaults
WALL = "wall:columns=4,courses=3"
SCENES = (ARCH, SOFT, DRY, BARREL, WALL, STAGED)
GREEDY = "engine == 'compliance' and formulation == 'cascade' and without == 'no proof'"
QUICK = ("wall:columns=2,courses=2",)
LIMIT, QUICK_LIMIT = 120.0, 10.0  # s for all ways
GRIPS, CRITERION = 1e6, "equations-2-3"
ARCHES, ROUNDS = (25, 97), 2  # bricks, and runs each, of searches with six digits and with all
SEARCHES = {
    ("loop", CRITERION): ((), "overlap_dp"),
    ("loop", "worst-ratio"): (("minmax",), "overlap_dp"),
    (FREE, "worst-ratio"): (("minmax",), "schedule_search"),
}  # aim and formulation
ABOUT = ["scene", "bricks", "reference", "valued", "worst", "limit"]


@contextmanager
def within(seconds: float):
    """Raise a `TimeoutError` from a block that takes longer, in processor time."""
    signal.signal(signal.SIGPROF, signal.default_int_handler)  # no error of the block itself
    signal.setitimer(signal.ITIMER_PROF, max(seconds, 1e-3))
    try:
        yield
    except KeyboardInterrupt:
        raise TimeoutError from None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def measured(name: str, seconds: float) -> RegretTable:
    scene = barrel_vault(1) if name == BARREL else seqopt.load_scene(name.partition(", ")[0])
    scene = scene.with_grips(GRIPS) if name == SOFT else scene
    engine = seqopt.make_engine("auto", scene, "dry" if name == DRY else None)
    time.perf_counter = time.process_time  # limits are of this process, too, whoever else works
    timer = Timer(time.process_time, within)
    found = measure_regret(engine, seqopt.CRITERIA[CRITERION], seconds=seconds, timer=timer)
    if name != STAGED:
        return found
    network, limits = engine.network, tuple(SceneFacts(engine).reference.items())

    def worst(steps: Sequence[Step]) -> float:
        last = Step(len(steps) + 1, StepKind.RELEASE, steps[-1].bricks, (None,) * 3)
        fields = staged_fields(network, [*steps, last] if steps[-1].held else steps)
        return max(worst_ratio(network, each, limits) for each in fields)

    return found.valued_by("staged construction", worst)


class AllDigits(ComplianceEngine):
    """Rigid bricks whose answers have all digits, also where six are enough."""

    def solve(self, bricks, grips, want=Want.RESPONSES, moved=None):
        """Return fields of grip sets."""
        return super().solve(bricks, grips, want & ~Want.SCREEN, moved)

    def _extremes(self, bricks, grips, want, *, compiled=False):
        return super()._extremes(bricks, grips, want & ~Want.SCREEN, compiled=compiled)


def digits(bricks: int) -> list[dict[str, object]]:
    """Return what searches take on an arch that ask for six digits, and with all."""
    out = []
    for (schedule, criterion), (aim, formulation) in SEARCHES.items():
        times, plans = list[float](), list[seqopt.Plan]()
        for engine in (ComplianceEngine, AllDigits) * ROUNDS:
            start = time.process_time()
            made = engine(seqopt.build_network(scene_named(f"chain{bricks}")))
            moves = FreeRules() if schedule == FREE else seqopt.three_robot_loop(made.network)
            problem = seqopt.pose(made, moves, seqopt.CRITERIA[criterion], *aim)
            plans.append(seqopt.solve(problem, formulation, proof=False))
            times.append(time.process_time() - start)
        models = plans[0].spent["models"]
        row = {"bricks": bricks, "schedule": schedule, "criterion": criterion}
        row |= {"same": all(plan.steps == plans[0].steps for plan in plans)}
        row |= {"models": models["searched"], "six_digits": models["six_digits"]}
        out.append(row | {"six_s": min(times[::2]), "all_s": min(times[1::2])})
    return out


def tables(rows: pd.DataFrame) -> list[RegretTable]:
    """Return stored rows as what they were made from, a scene after the other."""
    texts = {name: rows[name].astype(object).fillna("") for name in ("why", "without")}
    return [
        RegretTable(*about, own.reset_index(drop=True))  # type: ignore[misc]
        for about, own in rows.assign(**texts).groupby(ABOUT, sort=False)
    ]


def holds(rows: pd.DataFrame, searches: pd.DataFrame) -> dict[str, bool]:
    """Return whether each part of the claim does."""
    found = {table.scene: table for table in tables(rows)}
    large = searches[searches["bricks"] == max(ARCHES)]
    parts = {
        "what README says to take is proven to be the best": all(
            each.is_proven and each.take["exact"] and each.take["regret"] == 0
            for name, each in found.items()
            if name != STAGED
        ),
        "the frame takes at least five times as long as rigid bricks the same way": all(
            (ratio.dropna() >= 5).all() for ratio in map(_frame_times, found.values())
        ),
        "six digits change no plan": bool(searches["same"].all()),
        "on a large arch every search is sooner by them": bool(
            (large["six_s"] <= large["all_s"]).all()
        ),
    }
    if SOFT in found:
        soft, dry = found[SOFT].table, found[DRY].table
        worse = soft[(soft["engine"] == RIGID_GRIPS) & (soft["without"] == "")]
        ranks = soft.loc[soft["without"] == "ranks", "regret"]
        parts |= {
            "a sooner way loses something with soft grips": bool(
                (found[SOFT].sooner["regret"] >= 0.01).any()
            ),
            "the loop's greedy choice loses something with them and on the wall": all(
                found[name].table.query(GREEDY)["regret"].min() >= 0.01 for name in (SOFT, WALL)
            ),
            "plans for rigid grips, and plans by ranks, are twice as bad with soft ones": bool(
                (worse["regret"] >= 1).all() and len(worse) == 2 and (ranks >= 1).all()
            ),
            "laid dry, plans fall unless it is asked that they stand": {
                *dry.loc[dry["status"] == DONE, "without"]
            }
            == {"stands"},
            "if steps lock something in, every plan is twice as bad as it promised": bool(
                (found[STAGED].table.eval("value / own").dropna() >= 2).all()
            ),
        }
    return parts


def _frame_times(table: RegretTable) -> pd.Series:
    """Return how many times as long as rigid bricks the frame takes, by way."""
    rows = table.table.set_index(["schedule", "formulation", "without"])
    frame, rigid = (rows[rows["engine"] == e]["seconds"] for e in ("frame", "compliance"))
    return frame / rigid.reindex(frame.index)


def experiment(options: Options) -> Finding:
    scenes, limit = (QUICK, QUICK_LIMIT) if options.quick else (SCENES, LIMIT)
    module = "experiments.placement.speed_accuracy"
    rows = pd.DataFrame([row for scene in scenes for row in apart(module, scene, limit)])
    print(rows.to_string(index=False, float_format="%.4g"))
    arches = (7,) if options.quick else ARCHES
    some = pd.DataFrame([row for bricks in arches for row in apart(module, "digits", bricks)])
    print(some.to_string(index=False, float_format="%.4g"))
    return Finding(holds(rows, some), tables={"regret": rows, "digits": some})


CLAIM = Claim(
    experiment,
    digits=6,
    quick="a small wall",
    timed=True,
    pictures={"speed_accuracy.png": drawn(lambda rows: regret_chart(*tables(rows)), "regret")},
)

if __name__ == "__main__" and sys.argv[1] == "digits":
    print(json.dumps(digits(int(sys.argv[2]))))
elif __name__ == "__main__":
    found = measured(sys.argv[1], float(sys.argv[2]))
    about = {name: getattr(found, name) for name in ABOUT} | {"scene": sys.argv[1]}
    print(json.dumps(found.table.assign(**about).to_dict("records")))
