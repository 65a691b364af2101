"""Budgets in words, before there is the problem that they are for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.errors import ProblemError, did_you_mean
from seqopt.responses.quantities import robot_response
from seqopt.scene.checks import short

SHAPE = re.compile(
    r"(?P<kind>travel|steps_over:(?P<response>.+)|robot_use:(?P<robot>.+))"
    r"=((?P<level>[^:=]+):)?(?P<bound>[^:=]+?)(?P<unit>m|x|)"
)
CAP = re.compile(r"(?P<name>[^=]+)=(?P<bound>[^:=]+?)(?P<unit>m?)")
CAPS = "travel=3.5m, regrips=2, steps=50 or sum(T_max)=900, say"
FORMS = "travel=0.8, travel=3.5m, steps_over:F_largest=250:10 or robot_use:rob1=100:5"


@dataclass(frozen=True)
class AskedBudget:
    """A budget as it is asked for.

    ``response``: whose steps over a level are counted; empty for the way that robots go; ``level``:
    SI units; ``bound``: how much there is, or a share of what the optimum without budgets takes;
    ``share``: whether it is one.
    """

    words: str
    response: str
    level: float
    bound: float
    share: bool


def parse_budgets(texts: Sequence[str] | str) -> tuple[AskedBudget, ...]:
    """Return budgets from words.

    ``texts``: one or several, each ``travel=BOUND``, ``steps_over:RESPONSE=LEVEL:BOUND`` or
    ``robot_use:ROBOT=LEVEL:BOUND``, SI units. A bound of travel is a share of what the optimum
    without budgets travels, or in meters, as ``3.5m``; other bounds are numbers of steps, or
    shares, as ``0.8x``. Raises `ProblemError` if one has another form, or stands there twice.
    """
    texts = (texts,) if isinstance(texts, str) else texts
    if not isinstance(texts, Sequence) or not all(isinstance(text, str) for text in texts):
        raise ProblemError(f"budgets {short(texts)}: give {FORMS}, as words")
    found = tuple(_parse(text) for text in texts)
    for i, budget in enumerate(found):
        if any((b.response, b.level) == (budget.response, budget.level) for b in found[:i]):
            raise ProblemError(f"budget {budget.words}: it stands there twice; give one bound")
    return found


def _parse(text: str) -> AskedBudget:
    found = SHAPE.fullmatch(text)
    if found is None or (found["level"] is None) != (found["kind"] == "travel"):
        hint = did_you_mean(re.split("[=:]", text)[0], ("travel", "steps_over", "robot_use"))
        states = f", or with an aim {CAPS}" if CAP.fullmatch(text) else ""
        raise ProblemError(f"budget {text} does not exist{hint}; give {FORMS}{states}")
    is_travel = found["kind"] == "travel"
    if found["unit"] == "m" and not is_travel:
        raise ProblemError(f"budget {text}: steps have no meters; give a number of them")
    response = found["response"] or (robot_response(found["robot"]) if found["robot"] else "")
    level = 0.0 if is_travel else _positive(found["level"], text)
    share = found["unit"] == "x" or (is_travel and not found["unit"])
    return AskedBudget(text, response, level, _positive(found["bound"], text), share)


def parse_caps(texts: Sequence[str] | str) -> dict[str, float]:
    """Return caps on totals of states from words: ``travel=3.5m``, ``regrips=2``, ``sum(T_max)=9``.

    Raises `ProblemError` if one has another form, or stands there twice.
    """
    out: dict[str, float] = {}
    for text in (texts,) if isinstance(texts, str) else texts:
        found = CAP.fullmatch(text) if isinstance(text, str) else None
        if found is None or (found["name"] == "travel") != bool(found["unit"]):
            raise ProblemError(f"budget {short(text)} of states does not exist; give {CAPS}")
        if found["name"] in out:
            raise ProblemError(f"budget {text}: it stands there twice; give one bound")
        out[found["name"]] = _positive(found["bound"], text)
    return out


def _positive(text: str, words: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (np.isfinite(value) and value >= 0):
        raise ProblemError(f"budget {words}: {text!r} is not a number from 0; give {FORMS}")
    return value
