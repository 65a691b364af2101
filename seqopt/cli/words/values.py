"""What the words of the command line stand for: robots, limits, numbers, options, mortars."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import radians
from typing import Any

from seqopt.contact.mortar import MORTARS, Mortar, find_mortar
from seqopt.errors import ProblemError, StepError, did_you_mean
from seqopt.plan.calling.formulation import Formulation, as_formulation
from seqopt.problem.requirements import Limit, payload_limits
from seqopt.problem.standing import Standing
from seqopt.responses.choices import CHOICE_RESPONSES
from seqopt.scene.scene import Scene
from seqopt.sequence.free_rules import FreeRules
from seqopt.study.presets import CRITERIA

BETWEEN = re.compile(r",(?![^\[]*\])")  # a comma that is not in brackets
SIZE = re.compile(r"([0-9]*\.?[0-9]+(?:e[0-9]+)?) *((?:[kmgt]i?)?b?)", re.IGNORECASE)
MOST_WORKERS = 1024
LARGEST = 1e100  # number: products of larger ones overflow
RESPONSES = (*CHOICE_RESPONSES, "F_each")


def parse_robots(text: str) -> tuple[str, ...]:
    """Return names of robots from words.

    ``text``: names with commas between them; nothing for none.
    """
    return tuple(name.strip() for name in text.split(",")) if text else ()


def parse_limits(texts: Sequence[str], scene: Scene) -> tuple[Limit, ...]:
    """Return limits from words.

    ``texts``: each ``payload`` or ``RESPONSE=VALUE``, SI units; ``scene``: whose robots have the
    payloads. Raises `ProblemError` if there is no such response, or a value is not positive.
    """
    out: list[Limit] = []
    for text in texts:
        name, value = split_word(text)
        if text == "payload":
            out += payload_limits(scene)
        else:
            out.append(Limit(response_word(name, "--limit"), number_word(value, f"--limit {text}")))
    return tuple(out)


def parse_time_limit(text: str | None) -> float:
    """Return seconds from words.

    Result: infinite where none are given. Raises `ProblemError` if it is no number from 0.
    """
    return math.inf if text is None else number_word(text, "--time-limit", zero="allowed")


def parse_numbers(
    where: str, texts: Sequence[str], known: Mapping[str, object] | None = None
) -> dict[str, float]:
    """Return positive numbers by name from words.

    ``where``: the argument, for messages; ``texts``: each ``NAME=VALUE``; ``known``: names that
    there are; any by default. Raises `ProblemError` if there is no such name, or a value is not
    positive.
    """
    out: dict[str, float] = {}
    for text in texts:
        name, value = split_word(text)
        if known is not None and name not in known:
            why = f"does not exist{did_you_mean(name, known)}; give one of {', '.join(known)}"
            raise ProblemError(f"{where} {text} {why}")
        out[name] = number_word(value, f"{where} {text}")
    return out


def parse_options(formulation: Formulation | str, texts: Sequence[str]) -> dict[str, Any]:
    """Return the options of a formulation from words.

    ``formulation``: whose ``solve`` says which options there are and of which type; ``texts``: each
    ``NAME=VALUE``. Result (dict of str to (int or str)). Raises `ProblemError` if there is no such
    option, or a value is not of its type.
    """
    formulation = as_formulation(formulation)
    known = formulation.options
    out: dict[str, Any] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in known:
            hint = did_you_mean(name, known)
            raise ProblemError(
                f"--option {text}: {formulation.name} has {', '.join(known) or 'no options'}{hint}"
            )
        kind = type(known[name])
        try:
            out[name] = kind(value)
        except ValueError as error:
            raise ProblemError(
                f"--option {text}: {name} is {value!r}; give an {kind.__name__}"
            ) from error
    return out


def parse_mortar(options: argparse.Namespace) -> Mortar:
    """Return the named mortar with the numbers that are given instead of its own.

    ``options``: with ``mortar``, and ``friction`` (no unit), ``tensile_strength`` and ``cohesion``
    (Pa) as text, or None. Raises `ProblemError` if a number is negative, or none.
    """
    base = MORTARS[options.mortar]
    given = {
        name: number_word(text, f"--{name.replace('_', '-')}", zero="allowed")
        for name in ("friction", "tensile_strength", "cohesion")
        if (text := getattr(options, name)) is not None
    }
    return replace(base, **given)


def split_word(text: str) -> tuple[str, str]:
    """Return a response, whose brackets may hold anything, and the number after it.

    ``text``: as ``NAME=VALUE``, or a name alone. Result (str, str).
    """
    end = text.rfind("]") + 1
    name, _, number = text[end:].partition("=")
    return text[:end] + name, number


def response_word(name: str, where: str) -> str:
    """Return the name of a response if there is one of it.

    ``where``: the argument, for messages. Raises `ProblemError` if there is none.
    """
    if name not in RESPONSES and not name.startswith("F_"):
        names = (*CRITERIA, *RESPONSES) if where == "--criteria" else ("payload", *CHOICE_RESPONSES)
        known = ", ".join((*names, "F_ROBOT"))
        hint = did_you_mean(name, names)
        raise ProblemError(f"{where} {name} does not exist{hint}; give {known}")
    return name


def number_word(text: str, where: str, zero: str = "") -> float:
    """Return a positive number from a word.

    ``text``, ``where``: the word; the argument, for messages; ``zero``: anything where zero is a
    number too. Raises `ProblemError` if it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value <= LARGEST and not (zero and value == 0):
        raise ProblemError(
            f"{where}: {text!r} is not a positive number"
            + (" or zero" if zero else "")
            + (f" up to {LARGEST:g}" if value > LARGEST else "")
        )
    return value


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
