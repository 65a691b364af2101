"""How much a comparison depends on how stiff grips are, and where its conclusions turn.

Builds stay as they are, step by step; what varies is how robots give way where they hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from seqopt.engines.interface import Engine
from seqopt.engines.registry import engine_for
from seqopt.errors import SceneError
from seqopt.report._style import GRAY, dress, looks, new_figure, plain, styled
from seqopt.report.comparison import LARGEST
from seqopt.report.text import QUANTITIES, UNITS
from seqopt.responses._blocks import Block
from seqopt.responses._grip_sets import solve_sets
from seqopt.responses.quantities import CHOSEN_BY
from seqopt.responses.table import _steps_in_table
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.work.progress import Tell, with_progress

SHARE = "payload_share"  # column: the largest force of a grip over its robot's payload
_CLEAR = 0.01  # by how much one must be less than another to be said to be
_HALF = 0.5
_BETWEEN = 4  # stiffnesses that are looked at in each decade


def grip_range(softest: float, stiffest: float) -> tuple[float, ...]:
    """Return stiffnesses of grips from the softest to the stiffest, evenly spaced, then rigid, N/m.

    >>> [f"{stiffness:.3g}" for stiffness in grip_range(1e6, 1e7)]
    ['1e+06', '1.78e+06', '3.16e+06', '5.62e+06', '1e+07', 'inf']
    """
    if not 0 < softest < stiffest < np.inf:
        raise SceneError(
            f"grips from {short(softest)} to {short(stiffest)} N/m: give two stiffnesses, the "
            "softer one first"
        )
    steps = max(1, round(_BETWEEN * np.log10(stiffest / softest)))
    return (*np.geomspace(softest, stiffest, steps + 1).tolist(), np.inf)


def held_softly(
    engine: Engine,
    tables: Mapping[str, pd.DataFrame],
    stiffness: Sequence[float],
    progress: Tell = lambda _: None,
) -> pd.DataFrame:
    """Return the largest responses of builds for grips of several stiffnesses.

    ``engine``: made by name; engines of its kind compute the scene with other grips. ``tables``:
    the builds, as `seqopt.analyze` tells of them. ``stiffness``: of the grips of all robots, N/m,
    infinite if rigid, instead of that of hands and joints of arms; how they resist turning stays. A
    row for every ``build`` and ``stiffness``: largest ``F_rob`` [N], ``M_sup`` [N m], ``T_max`` [N]
    and ``D_max`` [1e-3 mm] of any step, and ``payload_share``: the largest force of a grip over its
    robot's payload.

    >>> import seqopt
    >>> engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
    >>> tables = {"cantilever": seqopt.analyze(engine, seqopt.cantilever(engine.network))}
    >>> held_softly(engine, tables, [1e6, float("inf")])["D_max"].round(1).tolist()
    [380.6, 15.7]
    """
    scene, rows = engine.network.scene, []
    for size in with_progress("grips", stiffness, progress):
        robots = [
            replace(
                robot,
                stiffness=None if size == np.inf else size,
                arm=robot.arm and replace(robot.arm, joint_stiffness=()),
            )
            for robot in scene.robots
        ]
        largest = {name: dict.fromkeys([*LARGEST, SHARE], 0.0) for name in tables}
        softer = scene.with_robots(*robots)
        states = _states(softer, tables)  # numbers of grips are those of its kinds
        for builds, found in _responses(engine_for(engine, softer), states):
            for build in builds:
                largest[build] = {key: max(v, found[key]) for key, v in largest[build].items()}
        rows += [{"build": name, "stiffness": size, **each} for name, each in largest.items()]
    return pd.DataFrame(rows)


_State = tuple[tuple[int, ...], tuple[int, ...]]  # numbers of grips, and which robots hold
_States = dict[tuple[int, int], dict[_State, set[str]]]  # builds, by brick and grip count, by state


def _states(scene: Scene, tables: Mapping[str, pd.DataFrame]) -> _States:
    """Return the builds that pass each grip set, by brick count and number of grips, ascending."""
    out: _States = {}
    for name, table in tables.items():
        for step in _steps_in_table(scene, table):
            robots = tuple(i for i, node in enumerate(step.grips) if node is not None)
            level = out.setdefault((step.bricks, len(robots)), {})
            level.setdefault((scene.grip_numbers(step.grips), robots), set()).add(name)
    return dict(sorted(out.items()))


def _responses(engine: Engine, states: _States) -> Iterator[tuple[set[str], dict[str, float]]]:
    """Yield builds and what they have in a state, each grip set solved once for all of them."""
    scene, names = engine.network.scene, [*LARGEST][1:]
    payload = np.array([robot.payload for robot in scene.robots])
    for (bricks, count), own in states.items():
        grips = np.array([numbers for numbers, _ in own], dtype=np.int64).reshape(len(own), count)
        props = scene.prop_numbers(bricks, held=bool(count))
        block = Block(bricks, grips, tuple(names), screen=False, props=props)
        for row, ((_, robots), builds) in zip(solve_sets(engine, block), own.items(), strict=True):
            forces = row[len(names) :]
            values = zip(names, row, strict=False)
            found = {name: float(value) * CHOSEN_BY[name].scale for name, value in values}
            found["F_rob"] = float(forces.max(initial=0.0))
            found[SHARE] = float((forces / payload[list(robots)]).max(initial=0.0))
            yield builds, found


def turning_points(table: pd.DataFrame, fixed: Sequence[str] = ()) -> tuple[str, ...]:
    """Return where conclusions of the stiffest grips turn as they become softer, a line each.

    Which build has the least of a response; which has less than half of what another one has, of
    those named ``fixed`` and the best; and which robots carry more than their payload.

    ``table``: of `held_softly`.

    >>> import pandas as pd
    >>> rows = [("a", 1e6, 8.0), ("b", 1e6, 9.0), ("a", 1e7, 2.0), ("b", 1e7, 9.0)]
    >>> table = pd.DataFrame(rows, columns=["build", "stiffness", "D_max"])
    >>> turning_points(table.assign(F_rob=1.0, M_sup=1.0, T_max=1.0, payload_share=0.5), ["a", "b"])
    ("displacement: below about 2.6e+06 N/m a has more than half of b's",)
    """
    lines: list[str] = []
    for response, word in QUANTITIES.items():
        wide = _from_stiffest(table, response)
        best = str(wide.iloc[0].idxmin())
        less = wide.min(axis=1) < (1 - _CLEAR) * wide[best]
        if less.any():
            other = str(wide.iloc[int(less.argmax())].idxmin())
            at = _crossing(wide[best] / wide[other], 1.0, less)
            lines.append(f"{word}: below about {at} N/m {other} has the least, not {best}")
        for one, more in permutations([best, *(name for name in fixed if name != best)], 2):
            ratio = wide[one] / wide[more].where(wide[more] > 0)
            if ratio.iloc[0] <= _HALF and (ratio > _HALF).any():
                at = _crossing(ratio, _HALF, ratio > _HALF)
                lines.append(f"{word}: below about {at} N/m {one} has more than half of {more}'s")
    for name, share in _from_stiffest(table, SHARE).items():
        over = share > 1
        if (turns := over != over.iloc[0]).any():
            side = f"{'above' if over.iloc[0] else 'below'} about {_crossing(share, 1.0, turns)}"
            lines.append(f"payload: {side} N/m {name} asks more of a robot than it carries")
    return tuple(dict.fromkeys(lines))


def _from_stiffest(table: pd.DataFrame, column: str) -> pd.DataFrame:
    """Return a column with a row for every stiffness, the stiffest first, and a build a column."""
    return table.pivot_table(column, "stiffness", "build", sort=False).sort_index().iloc[::-1]


def _crossing(values: pd.Series[float], level: float, beyond: pd.Series[bool]) -> str:
    """Return the stiffness at which values cross a level, before the first beyond it, two digits.

    Between stiffnesses they follow a power of it.
    """
    k = int(beyond.to_numpy().argmax())
    stiff, soft = (float(values.index[at]) for at in (k - 1, k))
    if stiff == np.inf:
        return f"{soft:.2g}"
    ends = np.log(values.to_numpy(float)[[k - 1, k]])
    share = (np.log(level) - ends[0]) / (ends[1] - ends[0])
    return f"{np.exp(np.log(stiff) + share * np.log(soft / stiff)):.2g}"


TITLES = {
    "F_rob": "robot force",
    "M_sup": "support moment",
    "T_max": "edge tension",
    "D_max": "node displacement",
}


@styled
def softness_chart(
    table: pd.DataFrame, builds: Sequence[str], band: tuple[float, float] | None = None
) -> Figure:
    """Return the largest responses of builds over the stiffness of grips, from `held_softly`.

    ``band``: stiffnesses between which industrial arms lie, N/m.
    """
    figure = new_figure(5.2)
    panels = figure.subplots(2, 2, sharex=True).ravel()
    finite, rigid = (table[np.isfinite(table["stiffness"]) == each] for each in (True, False))
    end = 4 * float(finite["stiffness"].max())
    for panel, (response, unit) in zip(panels, UNITS.items(), strict=True):
        if band is not None:
            panel.axvspan(*band, color=GRAY, alpha=0.2, lw=0, zorder=0, label="industrial arms")
        for name, style in looks(builds).items():
            own = finite[finite["build"] == name].sort_values("stiffness")
            line = style.line() | {"markevery": 4, "label": name}
            panel.plot(own["stiffness"], own[response], **line)
            last = rigid.loc[rigid["build"] == name, response]
            panel.plot([end] * len(last), last, style.marker, color=style.color)
        panel.set(xscale="log", yscale="log", title=f"{TITLES[response]} [{unit}]")
        plain(panel.yaxis)
    dress(*panels)
    for panel in panels[2:]:
        panel.set_xlabel("stiffness of grips [N/m]; marks on the right: rigid")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
