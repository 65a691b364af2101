"""Rules of a free schedule, and what must stand, from words of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from math import radians

from seqopt.cli.words.values import number_word, parse_robots
from seqopt.contact.mortar import find_mortar
from seqopt.errors import ProblemError, StepError, did_you_mean
from seqopt.problem.standing import Standing
from seqopt.sequence.free_rules import FreeRules

COUNTS = ("least_grips", "regrips")
RULES = ("newest", "payload", "ending", "placers", "candidates", *COUNTS)


def parse_standing(options: argparse.Namespace) -> Standing | None:
    """Return what is demanded of the stability of states.

    ``options``: with ``stands``, ``tilt`` (degrees) and ``friction``. Raises `ProblemError`,
    `SceneError` if there is no such mortar, or a number is none.
    """
    if options.stands is None:
        given = [name for name in ("tilt", "friction") if getattr(options, name) is not None]
        if given:
            raise ProblemError(f"--{given[0]}: it goes with --stands; give --stands dry, say")
        return None
    mortar = find_mortar(options.stands)
    if options.friction is not None:
        friction = number_word(options.friction, "--friction", zero="allowed")
        mortar = replace(mortar, friction=friction)
    tilt = 0.0 if options.tilt is None else number_word(options.tilt, "--tilt", zero="allowed")
    return Standing(mortar, radians(tilt))


def parse_rules(texts: Sequence[str], robots: tuple[str, ...]) -> FreeRules:
    """Return rules from words.

    ``texts``: each ``NAME=VALUE``; ``robots``: those that take part; none for all. Raises
    `StepError` if there is no such rule, or its value is none.
    """
    given: dict[str, object] = {"robots": robots}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in RULES:
            why = f"does not exist{did_you_mean(name, RULES)}; give one of {', '.join(RULES)}"
            raise StepError(f"--rule {text} {why}")
        if name in COUNTS:
            given[name] = int(value) if value.isdecimal() else value
            if name == "regrips" and value == "any":
                given[name] = None
        elif name == "placers":
            given[name] = () if value == "any" else parse_robots(value)
        elif name == "candidates":
            given[name] = "" if value == "all" else value
        else:
            given[name] = value
    return FreeRules(**given)  # type: ignore[arg-type]
