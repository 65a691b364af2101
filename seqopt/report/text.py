"""Methods and responses in the words of the field, and a build in one sentence."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from operator import attrgetter

import numpy as np
import pandas as pd

from seqopt.problem.requirements import _prop_faults, overloads, payload_uses
from seqopt.responses.quantities import _plain, length_text
from seqopt.responses.scales import _response_along
from seqopt.responses.table import OUTSIDE, Departure, _Columns
from seqopt.scene.scene import Scene
from seqopt.stability.failure_map import BuildVerdicts, _settlement_said
from seqopt.stability.verdict import Verdict

_NUMBERED = re.compile(r"rob(?:ot)?[ _-]?(\d+)")


def _robot_words(name: str) -> str:
    """Return the name of a robot on a page.

    >>> _robot_words("rob2"), _robot_words("left_arm")
    ('robot 2', 'left arm')
    """
    found = _NUMBERED.fullmatch(name)
    return f"robot {found[1]}" if found else name.replace("_", " ")


def _headline(scene: Scene, table: _Columns) -> str:
    """Return how much a robot holds, carries of its payload, and a node moves at most in a build.

    ``table``: of `seqopt.analyze`. Numbers have three digits.
    """
    along = [_response_along(scene, table, name) for name in ("F_largest", "D_max")]
    force, moved = (float(np.nanmax(each, initial=0.0)) for each in along)
    use = max(payload_uses(scene, table), key=attrgetter("share"))
    does = "" if use.brick is None else f" carries brick {use.brick}"
    text = f"largest force {_plain(force, 3)} N; payloads used up to {_plain(100 * use.share, 3)} %"
    text += f" ({use.robot}{does}, step {use.step})"
    return f"{text}; displacement {length_text(float(f'{moved:.3g}'))}"


def _deciding_step(
    scene: Scene,
    table: pd.DataFrame,
    verdicts: Sequence[BuildVerdicts],
    departures: Sequence[Departure] = (),
) -> int:
    """Return the place of the step that decides.

    It is the first that exceeds a payload or what props bear, leaves the linear range, or falls
    with the last mortar; where none does, that of the largest share of a payload.
    """
    over = (*overloads(scene, table), *_prop_faults(scene, table))
    wrong = [number for excess in over for number in excess.steps]
    wrong += [number for each in departures for number in each.steps]
    wrong += [each.first for each in verdicts[-1:] if each.first]
    if wrong:
        return min(wrong) - int(table["step"].iloc[0])
    most = max(payload_uses(scene, table), key=attrgetter("share"))
    return most.step - int(table["step"].iloc[0])


def _in_a_sentence(
    scene: Scene,
    table: pd.DataFrame,
    verdicts: Sequence[BuildVerdicts] = (),
    departures: Sequence[Departure] = (),
    faults: Sequence[str] = (),
) -> str:
    """Describe a build in one sentence; first, if so, that it leaves the linear range.

    ``faults``: why arms cannot be in steps.
    """
    used = [robot for robot in scene.robots if table[f"{robot.name}_node"].notna().any()]
    verb = ("take down", "takes down") if (table["type"] == "remove").any() else ("build", "builds")
    does = f"1 robot {verb[1]}" if len(used) == 1 else f"{len(used)} robots {verb[0]}"
    over = _overloaded(scene, table)
    fallen = [phrase for each in verdicts[-1:] if each.first for phrase in _falls(each)]
    wrong = [*over, *faults, *fallen]
    lines = [f"{does} {scene.name} in {len(table):,} steps"]
    if wrong:
        lines = [f"Not buildable: {'; '.join(wrong)}"]
    if not over:
        most = max(payload_uses(scene, table), key=attrgetter("share"))
        carries = "" if most.brick is None else f" carries brick {most.brick}"
        who = f"{_robot_words(most.robot)}{carries} in step {most.step}"
        lines.append(f"all within payload, {100 * most.share:.0f} % at most ({who})")
    moves = _settlement_said(scene) if verdicts else ""
    lines += [*_stands(verdicts[:-1] if fallen else verdicts), *([moves] if moves else [])] or (
        [] if verdicts else ["whether its steps stand was not asked"]
    )
    outside = f"{OUTSIDE.capitalize()}: {'; '.join(map(str, departures))}. Do not rely on it. "
    return (outside if departures else "") + "; ".join(lines) + "."


def _overloaded(scene: Scene, table: pd.DataFrame) -> list[str]:
    """Return which payloads are exceeded, and whether props bear too much, a phrase each."""
    out = []
    if over := overloads(scene, table):
        steps = sorted({number for excess in over for number in excess.steps})
        worst = max(over, key=lambda excess: excess.largest / excess.limit.bound)
        does = f"hold up to {worst.largest:,.0f} N"
        if worst.brick is not None:
            does = f"carry {worst.largest:,.0f} N (brick {worst.brick})"
        out.append(
            f"payload exceeded in {len(steps):,} of {len(table):,} steps, first in step {steps[0]} "
            f"({_robot_words(worst.robot)} would {does} and can hold {worst.limit.bound:,.4g} N)"
        )
    for excess in _prop_faults(scene, table):
        out.append(f"a prop bears more than it may in {len(excess.steps):,} steps")
    return out


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


UNITS = {"F_rob": "N", "M_sup": "N m", "T_max": "N", "D_max": "µm"}  # in which people read these
_WORDS = ("grip force", "support moment", "tension", "displacement")
IN_UNITS = {name: f"{words}, {UNITS[name]}" for name, words in zip(UNITS, _WORDS, strict=True)}
