"""The figure of `experiments.calibration.calibration`: errors, region, profiles."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.harness.charts import note, subplots, ticks
from seqopt.arrays import Floats
from seqopt.report._style import BLUE, GREEN, ORANGE, VERMILION, dress, name_panels, plain, styled

LOOKS = {"b t": (ORANGE, "--"), "b t2": (GREEN, ":"), "b t3/12": (BLUE, "-")}
TEXTS = {"b t": "$b\\,t$", "b t2": "$b\\,t^2$", "b t3/12": "$b\\,t^3/12$"}
MARKS = {"absolute": ("o", BLUE), "squares": ("s", VERMILION)}
Pairs = dict[str, list[tuple[float, float]]]
SERIES = {
    "paper_percent": ("Bruun et al.", {"color": "0.6"}),
    "fit_percent": ("fit, mean size least", {"color": BLUE}),
    "left_out_percent": ("fit without this test", {"fc": "w", "ec": VERMILION, "hatch": "/////"}),
}


@styled
def chart(
    bed: pd.DataFrame,
    fits: pd.DataFrame,
    *,
    region: tuple[Floats, Floats, Floats],
    levels: tuple[float, float],
    outs: Pairs,
    profiles: dict[str, tuple[Floats, Floats]],
) -> Figure:
    figure, grid = subplots(6.8, 2, 2)
    absolute = bed[bed["measure"] == "absolute"]
    _stiffness(grid[0, 0], absolute)
    _bars(grid[0, 1], absolute)
    _region(grid[1, 0], region, levels, outs, fits[fits["law"] == "b t3/12"])
    _profiles(grid[1, 1], profiles, levels[0])
    name_panels(*grid.ravel())
    return figure


def _stiffness(axes: Axes, table: pd.DataFrame) -> None:
    low, high = 28.0, 1300.0
    line = np.array([low, high])
    axes.fill_between(line, line / 1.2, line * 1.2, color="0.93", label="within 20 %")
    axes.loglog(line, line, color="k", lw=0.8)
    axes.loglog(table["k_e"], table["k_m"], "s", color="0.55", ms=6, label="Bruun et al.")
    axes.loglog(table["k_e"], table["k_fit"], "o", color=BLUE, ms=6, label="fit")
    for row in table.to_dict("records"):
        ends = sorted([float(row["k_m"]), float(row["k_fit"])])
        axes.plot([row["k_e"], row["k_e"]], ends, color="0.6", lw=0.8, zorder=1)
        shift = -9 if row["test"] == 8 else 9 if row["test"] == 6 else 0
        note(axes, str(row["test"]), (row["k_e"], ends[0]), (shift, -14), ha="center")
    ticks([50, 100, 200, 500, 1000], axes.xaxis, axes.yaxis)
    axes.set(xlim=(low, high), ylim=(low, high), xlabel="measured stiffness [kN/mm]")
    axes.set(ylabel="model [kN/mm]", title="stiffness, by test")
    axes.legend(loc="upper left")


def _bars(axes: Axes, table: pd.DataFrame) -> None:
    place = table["test"].to_numpy(float)
    for i, (column, (text, look)) in enumerate(SERIES.items()):
        label = f"{text}: mean {table[column].abs().mean():.1f} %"
        axes.bar(place + 0.27 * (i - 1), table[column], 0.25, label=label, **look)
    axes.axhline(0, color="k", lw=0.8)
    axes.set_xticks(place)
    axes.set_ylim(top=75)
    axes.set(xlabel="test", ylabel="error of stiffness [%]", title="error of each test")
    dress(axes)
    axes.grid(visible=False, axis="x")
    axes.legend(loc="upper right")


def _region(
    axes: Axes,
    region: tuple[Floats, Floats, Floats],
    levels: tuple[float, float],
    outs: Pairs,
    fits: pd.DataFrame,
) -> None:
    k_t, k_r, sums = region
    best = sums.min()
    x, y = k_t / 1e9, k_r / 1e9
    axes.contourf(x, y, sums.T / best, levels=[0, levels[1]], colors=["0.9"])
    axes.contour(x, y, sums.T / best, levels=[levels[1]], colors=["k"], linewidths=1.0)
    axes.plot(x, x, color="k", lw=0.8, ls=":")
    note(axes, "$k_r = k_t$", (118, 128), (0, 0), rotation=56, rotation_mode="anchor")
    for row in fits.to_dict("records"):
        mark, color = MARKS[str(row["measure"])]
        pairs = np.array(outs[str(row["measure"])]) / 1e9
        word = "mean absolute error" if row["measure"] == "absolute" else "sum of squares"
        pair = (float(row["k_t"]) / 1e9, float(row["k_r"]) / 1e9)
        axes.plot(*pair, mark, color=color, ms=9, ls="none", label=f"least {word}")
        look = {"mfc": "w", "color": color, "label": "the same without a test"}
        axes.plot(*pairs.T, mark, ms=4.5, **look)
        for i in np.flatnonzero(np.abs(np.log(pairs / pair)).max(axis=1) > 0.3):
            spot, shift = tuple(pairs[i]), (-5, 6) if row["measure"] == "absolute" else (4, 5)
            axes.annotate(str(i + 1), spot, shift, textcoords="offset points", color=color)
    axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    ticks([20, 50, 100, 200, 500, 1000], axes.xaxis)
    ticks([50, 100, 200, 500], axes.yaxis)
    axes.set(xlabel="$k_t$ [10⁶ kN/m³]", ylabel="$k_r$, per second moment\nof area [10⁶ kN/m³]")
    axes.set(title="95 % region (gray); numbers: test left out")
    axes.legend(loc="upper right", frameon=True, framealpha=1, edgecolor="none")


def _profiles(axes: Axes, profiles: dict[str, tuple[Floats, Floats]], level: float) -> None:
    for law, (turn, sums) in profiles.items():
        color, dashes = LOOKS[law]
        axes.plot(turn / 1e6, sums, color=color, ls=dashes, label=f"stiffness ∝ {TEXTS[law]}")
        axes.axhline(level * sums.min(), color=color, lw=0.8, ls=dashes)
    axes.set(xscale="log", xlim=(10, 1e4), ylim=(0, 3.6))
    plain(axes.xaxis)
    axes.set_xlabel("rotational stiffness of a joint\n215 mm thick [MN m/rad per m]")
    axes.set_ylabel("least sum of squared\nrelative errors")
    axes.set_title("profile of squares; level: 95 % limit")
    dress(axes)
    axes.legend(loc="upper right")
