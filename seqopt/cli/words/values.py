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
from seqopt.problem.criteria import Among, Ranked, RankSum
from seqopt.problem.problem import RobustAim, parse_robust
from seqopt.problem.requirements import NEVER, Criterion, Limit, payload_limits
from seqopt.problem.standing import Standing
from seqopt.responses.choices import CHOICE_RESPONSES
from seqopt.responses.resources import Resources
from seqopt.scene.scenarios import MOST, Scenarios, scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.free_rules import FreeRules
from seqopt.study.published import CRITERIA
from seqopt.work.progress import Tell
from seqopt.workflow import DEFAULTS

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


ALONE = ("scenarios", "unseen", "seed", "vary")  # options that mean something with --robust alone
COUNT = 30
SPREADS = ("stiffness", "density", "position")


def require_no_scenarios(options: argparse.Namespace) -> None:
    """Raise an error if options of scenarios are given without an aim over them.

    ``options``: of the command ``optimize``. Raises `ProblemError`, naming the option.
    """
    for name in ALONE:
        if options.robust is None and getattr(options, name):
            raise ProblemError(
                f"--{name}: plans over scenarios alone have it; give --robust worst-peak, "
                "worst-total or as cvar=0.9"
            )


def asked_scenarios(options: argparse.Namespace, scene: Scene) -> tuple[Scenarios, Scenarios]:
    """Return the scenarios to choose by, and those that judge."""
    (count, other), seed = _counts(options)
    return _drawn(scene, options, count, seed), _drawn(scene, options, other, seed + 1)


def _counts(options: argparse.Namespace) -> tuple[tuple[int, int], int]:
    """Return how many scenarios are asked for, known and unseen, and the seed of the former."""
    count = _count("--scenarios", options.scenarios, COUNT)
    other = _count("--unseen", options.unseen, count)
    return (count, other), _count("--seed", options.seed, 0, least=0)


def asked_aim(options: argparse.Namespace) -> RobustAim:
    """Return the aim over scenarios."""
    try:
        return parse_robust(options.robust)
    except ProblemError as error:
        raise ProblemError(f"--robust: {error}") from error


def _count(name: str, text: str | None, otherwise: int, least: int = 1) -> int:
    """Return a whole number from words."""
    if text is None:
        return otherwise
    if not (text.isascii() and text.isdecimal()) or not least <= int(text[:12]) <= MOST:
        raise ProblemError(f"{name} {text}: give a whole number from {least} to {MOST}")
    return int(text)


def _drawn(scene: Scene, options: argparse.Namespace, count: int, seed: int) -> Scenarios:
    """Return the scenarios that are asked for."""
    asked: dict[str, float] = {}
    for text in options.vary:
        name, value = split_word(text)
        if name not in SPREADS:
            raise ProblemError(
                f"--vary {text} does not exist{did_you_mean(name, SPREADS)}; give one of "
                f"{', '.join(SPREADS)}, as stiffness=3"
            )
        asked[name] = number_word(value, f"--vary {text}", zero="allowed")
    factor = asked.pop("stiffness", 3.0)
    if factor < 1:
        raise ProblemError(f"--vary stiffness={factor:g}: give a factor from 1")
    return scenarios(scene, stiffness=(1 / factor, factor), count=count, seed=seed, **asked)


BETWEEN = re.compile(r",(?![^\[]*\])")  # a comma that is not in brackets


def asked_criterion(options: argparse.Namespace) -> Criterion:
    """Return the criterion that a command is asked for.

    ``options``: with ``criteria``, ``crown``, ``ranked`` and ``among``.
    """
    usual = DEFAULTS["any other"].criterion.name
    criterion = parse_criterion(options.criteria or usual, options.crown)
    return _rank_otherwise(criterion, options.ranked, options.among)


def parse_criterion(text: str, crown: str | None = None) -> Criterion:
    """Return a criterion by name, or a rank sum of named responses with weights.

    ``text``: a name of `seqopt.CRITERIA`, or responses as ``T_max,M_sup=2``; a weight is 1 by
    default; ``crown``: bricks placed at the crown, or ``none``. Raises `ProblemError` if there is
    no such criterion or response, a weight is not positive, or the criterion has no crown.
    """
    if crown is not None:
        named = CRITERIA.get(text)
        if not isinstance(named, RankSum):
            raise ProblemError(f"--crown {crown}: {text} has none; leave it out")
        return replace(named, crown=NEVER if crown == "none" else number_word(crown, "--crown"))
    if text in CRITERIA:
        return CRITERIA[text]
    terms = []
    for part in BETWEEN.split(text):
        name, weight = split_word(part)
        terms.append(
            (response_word(name, "--criteria"), number_word(weight or "1", f"--criteria {part}"))
        )
    return RankSum(text, tuple(terms), tuple(terms))


def _rank_otherwise(criterion: Criterion, ranked: str | None, among: str | None) -> Criterion:
    """Return a criterion of ranks with what it ranks among.

    ``ranked``, ``among``: values of `seqopt.problem.criteria.Ranked` and
    `seqopt.problem.criteria.Among`. Raises `ProblemError` if either is given and the criterion has
    no ranks.
    """
    if ranked is None and among is None:
        return criterion
    if not isinstance(criterion, RankSum):
        flag = f"--ranked {ranked}" if ranked else f"--among {among}"
        raise ProblemError(f"{flag}: {criterion.name} has no ranks; leave it out")
    return replace(
        criterion,
        ranked=criterion.ranked if ranked is None else Ranked(ranked),
        among=criterion.among if among is None else Among(among),
    )


SIZE = re.compile(r"([0-9]*\.?[0-9]+(?:e[0-9]+)?) *((?:[kmgt]i?)?b?)", re.IGNORECASE)
MOST_WORKERS = 1024


def parse_resources(options: argparse.Namespace, progress: Tell | None = None) -> Resources:
    """Return what a computation may use.

    ``options``: with ``workers``, ``cache`` and ``max_memory``; ``progress``: told how far it is.
    Raises `ProblemError` if a number is none that can be meant.
    """
    if not options.workers.isdecimal() or not 1 <= int(options.workers) <= MOST_WORKERS:
        raise ProblemError(
            f"--workers {options.workers}: give a whole number from 1 to {MOST_WORKERS}"
        )
    most = None if options.max_memory is None else parse_size(options.max_memory)
    return Resources(int(options.workers), None, options.cache, most, progress)


def parse_size(text: str) -> float:
    """Return a number of bytes.

    ``text``: as ``2GB``, ``500 MB`` or ``1.5GiB``; bytes without a unit. Raises `ProblemError` if
    it is none.

    Examples
    --------
    >>> parse_size("1.5GB")
    1500000000.0
    """
    found = SIZE.fullmatch(text.strip())
    if found is None or not 0 < float(found[1]) < LARGEST:
        raise ProblemError(f"--max-memory {text}: give a size, as 500MB or 2GB")
    unit = found[2].upper()
    power = "KMGT".find(unit[:1]) + 1 if unit[:1] in "KMGT" and unit[:1] else 0
    return float(found[1]) * float(1024 if "I" in unit else 1000) ** power
