"""How much a comparison depends on how stiff grips are, and where its conclusions turn.

Builds stay as they are, step by step; what varies is how robots give way where they hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import SceneError
from seqopt.graph.scenarios import engine_for
from seqopt.report.comparison import LARGEST
from seqopt.responses._blocks import Block
from seqopt.responses._grip_sets import solve_sets
from seqopt.responses.quantities import CHOSEN_BY
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.work.progress import Tell, with_progress

SHARE = "payload_share"  # column: the largest force of a grip over its robot's payload
_NAMES = [*LARGEST][1:]  # of responses beside the forces of robots
_UNITS = {name: CHOSEN_BY[name].scale for name in _NAMES}
_CLEAR = 0.01  # by how much one must be less than another to be said to be
_HALF = 0.5
_BETWEEN = 4  # stiffnesses that are looked at in each decade
WORDS = {
    "F_rob": "grip force",
    "M_sup": "support moment",
    "T_max": "tension",
    "D_max": "displacement",
}


def _grip_range(softest: float, stiffest: float) -> tuple[float, ...]:
    """Return stiffnesses of grips from the softest to the stiffest, evenly spaced, then rigid, N/m.

    >>> [f"{stiffness:.3g}" for stiffness in _grip_range(1e6, 1e7)]
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
    scene = engine.network.scene
    rows, robots = [], scene.robots
    for size in with_progress("grips", stiffness, progress):
        own = None if size == np.inf else size
        ways = ((robot, robot.arm and replace(robot.arm, joint_stiffness=())) for robot in robots)
        softer = engine_for(
            engine, scene.with_robots(*(replace(r, stiffness=own, arm=arm) for r, arm in ways))
        )
        found = _largest(softer, tables)
        rows += [{"build": name, "stiffness": size, **each} for name, each in found.items()]
    return pd.DataFrame(rows)


def _largest(engine: Engine, tables: Mapping[str, pd.DataFrame]) -> dict[str, dict[str, float]]:
    """Return the largest responses of builds, each grip set solved once for all of them."""
    scene = engine.network.scene
    out = {name: dict.fromkeys([*LARGEST, SHARE], 0.0) for name in tables}
    payload = np.array([robot.payload for robot in scene.robots])
    for (bricks, count), states in _states(scene, tables).items():
        grips = np.array([numbers for numbers, _ in states], dtype=np.int64).reshape(
            len(states), count
        )
        props = scene.prop_numbers(bricks, held=bool(count))
        solved = solve_sets(engine, Block(bricks, grips, tuple(_NAMES), screen=False, props=props))
        for row, ((_, robots), builds) in zip(solved, states.items(), strict=True):
            forces = row[len(_NAMES) :]
            found = {name: value * _UNITS[name] for name, value in zip(_NAMES, row, strict=False)}
            found["F_rob"] = float(forces.max(initial=0.0))
            found[SHARE] = float((forces / payload[list(robots)]).max(initial=0.0))
            for build in builds:
                out[build] = {key: max(value, found[key]) for key, value in out[build].items()}
    return out


_State = tuple[tuple[int, ...], tuple[int, ...]]  # numbers of grips, and which robots hold


def _states(
    scene: Scene, tables: Mapping[str, pd.DataFrame]
) -> dict[tuple[int, int], dict[_State, set[str]]]:
    """Return the builds that pass each grip set, by brick count and number of grips, ascending."""
    out: dict[tuple[int, int], dict[_State, set[str]]] = {}
    columns = [f"{robot.name}_node" for robot in scene.robots]
    for name, table in tables.items():
        pairs = zip(table["bricks"], table[columns].to_numpy(object), strict=True)
        for bricks, row in pairs:
            nodes = [int(node) if pd.notna(node) else None for node in row]
            robots = tuple(i for i, node in enumerate(nodes) if node is not None)
            state = scene.grip_numbers(nodes), robots
            level = out.setdefault((int(bricks), len(robots)), {})
            level.setdefault(state, set()).add(name)
    return dict(sorted(out.items()))


def turning_points(table: pd.DataFrame, fixed: Sequence[str] = ()) -> tuple[str, ...]:
    """Return where conclusions of the stiffest grips turn as they become softer, a line each.

    Which build has the least of a response; which has less than half of what another one has, of
    those named ``fixed`` and the best; and which robots carry more than their payload. Between
    stiffnesses of the table values are taken to follow a power of it.

    ``table``: of `held_softly`.

    >>> import pandas as pd
    >>> rows = [("a", 1e6, 8.0), ("b", 1e6, 9.0), ("a", 1e7, 2.0), ("b", 1e7, 9.0)]
    >>> table = pd.DataFrame(rows, columns=["build", "stiffness", "D_max"])
    >>> turning_points(table.assign(F_rob=1.0, M_sup=1.0, T_max=1.0, payload_share=0.5), ["a", "b"])
    ("displacement: below about 2.6e+06 N/m a has more than half of b's",)
    """
    lines: list[str] = []
    for response in LARGEST:
        wide = table.pivot_table(response, "stiffness", "build", sort=False).sort_index()
        wide = wide.iloc[::-1]  # from the stiffest
        best = str(wide.iloc[0].idxmin())
        lines += _no_longer_least(wide, best, WORDS[response])
        lines += _no_longer_half(wide, [best, *(name for name in fixed if name != best)], response)
    share = table.pivot_table(SHARE, "stiffness", "build", sort=False).sort_index().iloc[::-1]
    return (*dict.fromkeys(lines), *_payload_lines(share))


def _no_longer_least(wide: pd.DataFrame, best: str, word: str) -> Iterator[str]:
    """Yield where another build than the best of the stiffest grips has the least, if it does."""
    for before, after in pairwise(wide.index):
        other = str(wide.loc[after].idxmin())
        if wide.loc[after, other] < (1 - _CLEAR) * wide.loc[after, best]:
            at = _crossing(wide[best] / wide[other], 1.0, before, after)
            yield f"{word}: below about {at} N/m {other} has the least, not {best}"
            return


def _no_longer_half(wide: pd.DataFrame, names: Sequence[str], response: str) -> Iterator[str]:
    """Yield where a build no longer has less than half of what another one has."""
    for less in names:
        for more in names:
            ratio = wide[less] / wide[more].where(wide[more] > 0)
            if less == more or not ratio.iloc[0] <= _HALF:
                continue
            for before, after in pairwise(wide.index):
                if ratio[after] > _HALF:
                    at = _crossing(ratio, _HALF, before, after)
                    said = f"below about {at} N/m {less} has more than half of {more}'s"
                    yield f"{WORDS[response]}: {said}"
                    break


def _payload_lines(share: pd.DataFrame) -> Iterator[str]:
    """Yield from which stiffness on builds ask more than a payload of robots, or no longer do."""
    for name in share.columns:
        for before, after in pairwise(share.index):
            over = share.loc[[before, after], name] > 1
            if over[before] != over[after]:
                at = _crossing(share[name], 1.0, before, after)
                side = "above" if over[before] else "below"
                yield f"payload: {side} about {at} N/m {name} asks more of a robot than it carries"
                break


def _crossing(values: pd.Series[float], level: float, stiff: float, soft: float) -> str:
    """Return the stiffness at which values cross a level between two, two digits."""
    if stiff == np.inf:
        return f"{soft:.2g}"
    ends = np.log([values[stiff], values[soft]])
    share = (np.log(level) - ends[0]) / (ends[1] - ends[0])
    return f"{np.exp(np.log(stiff) + share * np.log(soft / stiff)):.2g}"


def _softness_lines(table: pd.DataFrame, builds: Sequence[str]) -> list[str]:
    """Return a table of some builds in text: the largest responses at every decade, 80 columns."""
    known = np.unique(table["stiffness"])
    finite = [float(k) for k in known if k < np.inf]
    whole = [k for k in finite if abs(np.log10(k) - round(np.log10(k))) < 1e-9] or finite
    step = -(-len(whole) // 6)
    shown = (*whole[::-1][::step][::-1], float(max(known)))
    lines = []
    for response, unit in LARGEST.items():
        wide = table.pivot_table(response, "build", "stiffness", sort=False)
        heads = ["rigid" if k == np.inf else _in_short(k) for k in shown]
        said = f"{WORDS[response]}, {unit}".replace("1e-3 mm", "µm")
        lines.append(f"{said:<24}" + "".join(f"{head:>8}" for head in heads))
        for name in builds:
            values = wide.loc[name, list(shown)].to_numpy(float)
            lines.append(
                f"  {name:<22}" + "".join(f"{_three(float(value)):>8}" for value in values)
            )
    return lines


def _three(value: float) -> str:
    """Return a number of three digits or more, written out."""
    return f"{value:.0f}" if 100 <= abs(value) < 1e7 else f"{value:.3g}"


def _in_short(stiffness: float) -> str:
    """Return a stiffness in a few letters, as 3e6."""
    return f"{stiffness:.0e}".replace("e+0", "e").replace("e+", "e")
