"""The step of a build that decides, and the build in one sentence."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.problem.criteria import RankSum
from seqopt.problem.requirements import Criterion, _prop_faults, _response_along, overloads
from seqopt.responses.quantities import RESPONSES, length_text
from seqopt.responses.table import OUTSIDE, Departure, force_column
from seqopt.scene.scene import Scene
from seqopt.stability._builds import BuildVerdicts
from seqopt.stability.assessment import Verdict

_NUMBERED = re.compile(r"rob(?:ot)?[ _-]?(\d+)")
_SHORTEST = 1e-6  # m: below, a length is no tolerance that anybody keeps


def robot_words(name: str) -> str:
    """Return what a robot is called on a page.

    >>> robot_words("rob2"), robot_words("left_arm")
    ('robot 2', 'left arm')
    """
    found = _NUMBERED.fullmatch(name)
    return f"robot {found[1]}" if found else name.replace("_", " ")


def payload_shares(scene: Scene, table: pd.DataFrame) -> Floats:
    """Return the share of its payload that every robot uses in every step, (n, r)."""
    forces = table[[force_column(robot) for robot in scene.robots]].to_numpy(float)
    payloads = np.array([robot.payload for robot in scene.robots])
    return np.asarray(np.nan_to_num(np.abs(forces)) / payloads)


def worst_along(scene: Scene, table: pd.DataFrame, aim: str, criterion: Criterion) -> Floats | None:
    """Return the values (n,) of which an aim counts the largest; None where it is none of these."""
    if aim in RESPONSES or aim == "F_largest":
        return np.asarray(_response_along(scene, table, aim))
    if aim != "minmax" or isinstance(criterion, RankSum):
        return None
    out = np.zeros(len(table))
    for at, bricks in enumerate(table["bricks"].astype(int)):
        names = criterion.wanted(bricks)
        row = table.iloc[[at]]
        if bricks and "F_move" not in names:
            found = {name: _response_along(scene, row, name) for name in names}
            out[at] = float(criterion.costs(found, bricks, 1)[0])
    return out


def deciding_step(
    scene: Scene,
    table: pd.DataFrame,
    verdicts: Sequence[BuildVerdicts],
    along: Floats | None = None,
) -> int:
    """Return the place of the step that decides.

    It is the first that exceeds a payload, or what props bear, or falls with the last mortar; where
    none does, that of the largest value ``along`` the build, or of the largest share of a payload,
    among those in which a robot holds, if there are any.
    """
    over = (*overloads(scene, table), *_prop_faults(scene, table))
    wrong = [number for excess in over for number in excess.steps]
    wrong += [each.first for each in verdicts[-1:] if each.first]
    if wrong:
        return min(wrong) - int(table["step"].iloc[0])
    shares = payload_shares(scene, table).max(axis=1)
    values = shares if along is None else along
    asked = np.isfinite(values) & ((shares > 0) | (not shares.any()))
    return int(np.where(asked, values, -np.inf).argmax())


def in_a_sentence(
    scene: Scene,
    table: pd.DataFrame,
    verdicts: Sequence[BuildVerdicts] = (),
    departures: Sequence[Departure] = (),
    off: Floats | None = None,
    faults: Sequence[str] = (),
) -> str:
    """Return what a build is, as one sentence; first, if so, that it leaves the linear range.

    ``off``: how far grips may be off in every step, m; ``faults``: why arms cannot be in steps.
    """
    used = [robot for robot in scene.robots if table[f"{robot.name}_node"].notna().any()]
    verb = ("take down", "takes down") if (table["type"] == "remove").any() else ("build", "builds")
    does = f"1 robot {verb[1]}" if len(used) == 1 else f"{len(used)} robots {verb[0]}"
    over, fallen = _overloaded(scene, table), _fallen(verdicts)
    wrong = [*over, *faults, *fallen]
    outside = f"{OUTSIDE.capitalize()}: {'; '.join(map(str, departures))}. Do not rely on it. "
    said = [f"{does} {scene.name} in {len(table):,} steps"]
    if wrong:
        said = [f"Not buildable: {'; '.join(wrong)}"]
    held = verdicts[:-1] if fallen else verdicts
    said += [] if over else _carried(scene, table)
    said += [*_stands(held)] or ([] if verdicts else ["whether its steps stand was not asked"])
    said += [] if off is None or wrong else _off_said(scene, table, off)
    return (outside if departures else "") + "; ".join(said) + "."


def _overloaded(scene: Scene, table: pd.DataFrame) -> list[str]:
    """Return which payloads are exceeded, and whether props bear too much, a phrase each."""
    out = []
    if over := overloads(scene, table):
        steps = sorted({number for excess in over for number in excess.steps})
        worst = max(over, key=lambda excess: excess.largest / excess.limit.bound)
        where = f"{len(steps):,} of {len(table):,} steps"
        out.append(
            f"payload exceeded in {where}, first in step {steps[0]} ({robot_words(worst.robot)} "
            f"would hold up to {worst.largest:,.0f} N and can hold {worst.limit.bound:,.4g} N)"
        )
    for excess in _prop_faults(scene, table):
        out.append(f"a prop bears more than it may in {len(excess.steps):,} steps")
    return out


def _carried(scene: Scene, table: pd.DataFrame) -> list[str]:
    """Return how much of its payload the robot with the largest share of it uses."""
    shares = payload_shares(scene, table)
    step, robot = divmod(int(shares.argmax()), len(scene.robots))
    who, number = robot_words(scene.robots[robot].name), int(table["step"].iloc[step])
    return [f"all within payload, {100 * shares.max():.0f} % at most ({who} in step {number})"]


def _fallen(verdicts: Sequence[BuildVerdicts]) -> list[str]:
    """Return that steps fall with the last mortar, and what fails first; nothing if none does."""
    return [phrase for each in verdicts[-1:] if each.first for phrase in _falls(each)]


def _falls(each: BuildVerdicts) -> list[str]:
    falls, first = each.count(Verdict.FALLS), each.first_said
    if falls == 1:
        return [f"{each.how}, {first.replace(' (', ' falls (', 1)}"]
    return [f"{each.how}, {falls:,} of {len(each.verdicts):,} steps fall, the first is {first}"]


def _stands(verdicts: Sequence[BuildVerdicts]) -> Iterator[str]:
    """Yield whether steps stand with each mortar; only the first of several where all do."""
    for each in verdicts:
        open_ = each.count(Verdict.UNDECIDED)
        if each.first:
            yield from _falls(each)
        if open_:
            yield f"of {open_:,} steps it is not known whether they stand {each.how}"
        if not each.first and not open_:
            yield f"every step stands{',' if each.how == 'dry' else ''} {each.how}"
            return  # with more than this it stands too


def _off_said(scene: Scene, table: pd.DataFrame, off: Floats) -> list[str]:
    """Return how far grips may be off in every step, where robots hold."""
    least = float(off.min(initial=np.inf))
    gives = any(robot.stiffness or robot.arm for robot in scene.robots)
    where = f" in step {int(table['step'].iloc[off.argmin()])}" if least < _SHORTEST else ""
    said = f"{'' if gives else 'rigid '}grips {far_off(least)}{where}"
    return [said] if np.isfinite(least) else []


def far_off(length: float) -> str:
    """Return how far grips may be off, in words.

    >>> far_off(0.000312), far_off(2.7e-7), far_off(0.0)
    ('may be 310 µm off', 'may not even be 0.001 mm off', 'may not be off at all')
    """
    if length >= _SHORTEST:
        return f"may be {length_text(float(f'{length:.2g}'))} off"
    return "may not even be 0.001 mm off" if length > 0 else "may not be off at all"
