"""The picture of what the witnesses say."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from experiments.harness.charts import note
from experiments.harness.results import stored, two
from experiments.stability.parts.witness_cra import SOUND, TORN
from seqopt.report._style import SMALL, dress, name_panels, new_figure, styled
from seqopt.stability.assessment import Verdict
from seqopt.stability.limit_analysis import EXACT

STANDS, FALLS, OPEN = (verdict.value for verdict in Verdict)
COLOURS = {STANDS: "#0072B2", FALLS: "#D55E00", OPEN: "0.45"}
GROUPS = {"sample": ("o", 5e-10), "stack": ("s", 8e-9), "incline": ("D", 1.2e-7)}
GROUPS |= {"arch": ("^", 2e-6)}  # marker, and where those that stand are drawn
CRA = {"optimal": STANDS, "acceptable": STANDS, "infeasible": FALLS}  # anything else: open
LEFT, RIGHT, BOTTOM, TOP = 5e-11, 40.0, 1e-9, 10.0


@styled
def chart(table: pd.DataFrame, times: pd.DataFrame, differ: set[str]) -> Figure:
    figure = new_figure(6.8)
    panels = figure.subplot_mosaic(
        [["all", "all"], ["times", "density"]], height_ratios=[2.1, 1], width_ratios=[1, 1.1]
    )
    _scatter(panels["all"], table[table["group"] != "density"], differ)
    _bars(panels["times"], times)
    density = table[table["group"] == "density"]
    if len(density):
        _density(panels["density"], density)
    name_panels(*panels.values())
    return figure


def _scatter(axes: Axes, table: pd.DataFrame, differ: set[str]) -> None:
    axes.axhspan(SOUND, TORN, color="0.9", lw=0)
    middle = np.sqrt(SOUND * TORN)
    axes.text(RIGHT / 2, middle, "RBE decides nothing", ha="right", va="center", fontsize=SMALL)
    axes.axvline(10 * EXACT, color="0.4", lw=0.8)
    for group, (marker, none) in GROUPS.items():
        part = table[table["group"] == group]
        x = part["lacking_bond"].where(part["lacking_bond"] > EXACT, none).clip(upper=TOP)
        y = part["tension"].clip(BOTTOM, TOP)
        odd, twice = part["case"].isin(differ), part["lmgc90"] == part["ours"]
        for chosen, edge in ((~odd & ~twice, "none"), (~odd & twice, "k")):
            colour = part.loc[chosen, "ours"].map(COLOURS)
            axes.scatter(x[chosen], y[chosen], 32, c=colour, marker=marker, ec=edge, lw=0.9)
        edge = part.loc[odd, "ours"].map(COLOURS)
        axes.scatter(x[odd], y[odd], 44, c="w", marker=marker, ec=edge, lw=1.8)
        for name, *at in zip(part.loc[odd, "case"], x[odd], y[odd], strict=True):
            note(axes, name, at, (8, 0), va="center")
        axes.scatter([], [], 32, c="0.5", marker=marker, lw=0, label=group)
    for name, face, edge, width in (
        ("LMGC90 agrees too (black edge)", "0.5", "k", 0.9),
        ("a witness differs (hollow)", "w", "0.5", 1.8),
    ):
        axes.scatter([], [], 32, c=face, marker="o", ec=edge, lw=width, label=name)
    for verdict in (STANDS, FALLS):
        axes.scatter([], [], 32, c=COLOURS[verdict], marker="s", lw=0, label=f"seqopt: {verdict}")
    axes.set(xscale="log", yscale="log", xlim=(LEFT, RIGHT), ylim=(BOTTOM / 3, 3 * TOP))
    powers = {f"$10^{{{k}}}$": 10.0**k for k in range(-4, 2)}
    axes.set_xticks([3e-8, *powers.values()], ["none", *powers])
    axes.minorticks_off()
    axes.set_xlabel("bond that is lacking, by seqopt (heaviest weight over mean face)")
    axes.set_ylabel("tension that is left, by RBE (mean weight of a block)")
    axes.set_title("verdicts of seqopt and of rigid-block equilibrium (RBE of compas_cra)")
    dress(axes)
    axes.legend(loc="upper left", ncols=2)


def _bars(axes: Axes, times: pd.DataFrame) -> None:
    rows = np.arange(len(times))
    for shift, column, name, look in (
        (-0.2, "seconds", "seqopt", {"color": COLOURS[STANDS]}),
        (0.2, "rbe_seconds", "RBE", {"fc": "w", "ec": "0.45", "hatch": "////"}),
    ):
        bars = axes.barh(rows + shift, times[column], 0.36, **look)
        axes.bar_label(bars, [f" {name} {two(x)} s" for x in times[column]], fontsize=SMALL)
    axes.set_yticks(rows, [str(case).replace("_", "\n", 1) for case in times["case"]])
    axes.invert_yaxis()
    axes.set(xlabel="time to a verdict [s]", title="two samples, in turns")
    axes.set_xlim(0, 1.6 * times["rbe_seconds"].max())
    axes.spines[["top", "right"]].set_visible(False)


def _density(axes: Axes, table: pd.DataFrame) -> None:
    words = {
        "seqopt": table["ours"],
        "RBE": table["rbe"],
        "CRA": table["cra"].map(lambda word: CRA.get(word, OPEN)),
    }
    short = {STANDS: "stands", FALLS: "falls", OPEN: "open"}
    for row, word in enumerate(words.values()):
        for column, verdict in enumerate(word):
            corner = (column - 0.48, row - 0.44)
            axes.add_patch(Rectangle(corner, 0.96, 0.88, color=COLOURS[verdict], lw=0))
            look = {"ha": "center", "va": "center", "color": "w", "fontsize": SMALL}
            axes.text(column, row, short[verdict], **look)
    axes.set_yticks(range(len(words)), list(words))
    axes.set_xticks(range(len(table)), [f"{x:g}" for x in table["density"]])
    axes.set(xlim=(-0.5, len(table) - 0.5), ylim=(len(words) - 0.5, -0.5), xlabel="density [kg/m³]")
    axes.set_title("one arch of 25 blocks")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


LARGEST = "armadillo_cra"


def words(table: pd.DataFrame, witness: str) -> pd.Series:
    """Return a witness's verdicts; RBE's open ones as its constraints without tension have it."""
    if witness != "rbe":
        return table[witness].replace("", OPEN)
    return table["rbe"].where(table["rbe"] != OPEN, table["no_tension"])


def differing(table: pd.DataFrame, witness: str) -> set[tuple[str, str]]:
    """Return where a witness decides otherwise than we."""
    word = words(table, witness)
    return {(case, witness) for case in table.loc[(word != OPEN) & (word != table["ours"]), "case"]}


def picture() -> Figure:
    table = stored("witnesses")
    words_of = ["rbe", "no_tension", "cra", "lmgc90"]
    table[words_of] = table[words_of].fillna("")
    times = table[table["case"].isin([LARGEST, "bridge"])]
    differ = set().union(*(differing(table, witness) for witness in ("rbe", "lmgc90")))
    return chart(table, times, {case for case, _ in differ})
