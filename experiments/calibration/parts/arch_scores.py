"""How near an identified arch comes to the printed tables, and to the shipped one.

Tables A.1 and A.2 are fitted; Table B.1 takes no part and says how far a fit predicts.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.harness.plotting import RESULTS
from experiments.harness.yardstick import ROUNDING, errors, percentiles, tension_share
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.responses.table import analyze
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import PUBLISHED, as_printed, published_plan
from seqopt.study.tables import printed_steps

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
    far = [
        {"what": f"{name}, largest difference", "unit": unit, "difference": value}
        for (name, unit), value in gap.items()
    ]
    return pd.concat([table, pd.DataFrame(far)], ignore_index=True)


def holds(table: pd.DataFrame, *, quick: bool) -> bool:
    """Return whether the shipped fit is within its limits, and the new one not worse than it."""
    part = table.set_index("what")
    unseen = [BESIDE + name for name in PERCENTILES]
    good = all(
        bool((part.loc[names, "shipped"].to_numpy(float) <= LIMITS).all())
        for names in (PERCENTILES, unseen)
    )
    return good and (quick or bool((part.loc[PERCENTILES, "difference"] <= ROUNDING).all()))
