"""What the words of the command line stand for: criteria, limits, options, mortars, analyses."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from seqopt.contact.mortar import MORTARS, Mortar
from seqopt.engines.interface import Engine, Fields
from seqopt.errors import ProblemError, SceneError
from seqopt.placement.criteria import RankSum
from seqopt.placement.formulation import Formulation, as_formulation
from seqopt.placement.ranks import Among, Ranked
from seqopt.placement.requirements import Criterion, Limit, payload_limits
from seqopt.placement.scales import NEVER
from seqopt.responses.choices import CHOICE_RESPONSES
from seqopt.responses.resources import Resources
from seqopt.responses.staged import staged_fields
from seqopt.responses.table import step_fields
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step
from seqopt.study.presets import CRITERIA

BETWEEN = re.compile(r",(?![^\[]*\])")  # a comma that is not in brackets
SIZE = re.compile(r"([0-9]*\.?[0-9]+(?:e[0-9]+)?) *((?:[kmgt]i?)?b?)", re.IGNORECASE)
MOST_WORKERS = 1024
LARGEST = 1e100  # number: products of larger ones overflow
RESPONSES = (*CHOICE_RESPONSES, "F_each")


def asked_criterion(options: argparse.Namespace) -> Criterion:
    """Return the criterion that a command is asked for.

    Parameters
    ----------
    options : argparse.Namespace
        With ``criteria``, ``crown``, ``ranked`` and ``among``.

    Returns
    -------
    Criterion
    """
    criterion = parse_criterion(options.criteria, options.crown)
    return rank_otherwise(criterion, options.ranked, options.among)


def parse_criterion(text: str, crown: str | None = None) -> Criterion:
    """Return a criterion by name, or a rank sum of named responses with weights.

    Parameters
    ----------
    text : str
        A name of `seqopt.CRITERIA`, or responses as ``T_max,M_sup=2``; a weight is 1 by default.
    crown : str, optional
        Bricks placed at the crown, or ``none``.

    Returns
    -------
    Criterion

    Raises
    ------
    ProblemError
        If there is no such criterion or response, a weight is not positive, or the criterion has
        no crown.
    """
    if crown is not None:
        named = CRITERIA.get(text)
        if not isinstance(named, RankSum):
            raise ProblemError(f"--crown {crown}: {text} has none; leave it out")
        return replace(named, crown=NEVER if crown == "none" else _number(crown, "--crown"))
    if text in CRITERIA:
        return CRITERIA[text]
    terms = []
    for part in BETWEEN.split(text):
        name, weight = _split(part)
        terms.append((_response(name, "--criteria"), _number(weight or "1", f"--criteria {part}")))
    return RankSum(text, tuple(terms), tuple(terms))


def parse_resources(
    options: argparse.Namespace, progress: Callable[[str], None] | None = None
) -> Resources:
    """Return what a computation may use.

    Parameters
    ----------
    options : argparse.Namespace
        With ``workers``, ``cache`` and ``max_memory``.
    progress : callable, optional
        Told how far it is.

    Returns
    -------
    Resources

    Raises
    ------
    ProblemError
        If a number is none that can be meant.
    """
    if not options.workers.isdecimal() or not 1 <= int(options.workers) <= MOST_WORKERS:
        raise ProblemError(
            f"--workers {options.workers}: give a whole number from 1 to {MOST_WORKERS}"
        )
    most = None if options.max_memory is None else parse_size(options.max_memory)
    return Resources(int(options.workers), None, options.cache, most, progress)


def parse_size(text: str) -> float:
    """Return a number of bytes.

    Parameters
    ----------
    text : str
        As ``2GB``, ``500 MB`` or ``1.5GiB``; bytes without a unit.

    Returns
    -------
    float

    Raises
    ------
    ProblemError
        If it is none.

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


def rank_otherwise(criterion: Criterion, ranked: str | None, among: str | None) -> Criterion:
    """Return a criterion of ranks with what it ranks among.

    Parameters
    ----------
    criterion : Criterion
    ranked, among : str, optional
        Values of `seqopt.placement.ranks.Ranked` and `seqopt.placement.ranks.Among`.

    Returns
    -------
    Criterion

    Raises
    ------
    ProblemError
        If either is given and the criterion has no ranks.
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


def parse_robots(text: str) -> tuple[str, ...]:
    """Return names of robots from words.

    Parameters
    ----------
    text : str
        Names with commas between them; nothing for none.

    Returns
    -------
    tuple of str
    """
    return tuple(name.strip() for name in text.split(",")) if text else ()


def parse_limits(texts: Sequence[str], scene: Scene) -> tuple[Limit, ...]:
    """Return limits from words.

    Parameters
    ----------
    texts : sequence of str
        Each ``payload`` or ``RESPONSE=VALUE``, SI units.
    scene : Scene
        Whose robots have the payloads.

    Returns
    -------
    tuple of Limit

    Raises
    ------
    ProblemError
        If there is no such response, or a value is not positive.
    """
    out: list[Limit] = []
    for text in texts:
        name, value = _split(text)
        if text == "payload":
            out += payload_limits(scene)
        else:
            out.append(Limit(_response(name, "--limit"), _number(value, f"--limit {text}")))
    return tuple(out)


def parse_time_limit(text: str | None) -> float:
    """Return seconds from words.

    Parameters
    ----------
    text : str, optional

    Returns
    -------
    float
        Infinite where none are given.

    Raises
    ------
    ProblemError
        If it is no number from 0.
    """
    return math.inf if text is None else _number(text, "--time-limit", zero="allowed")


def parse_options(formulation: Formulation | str, texts: Sequence[str]) -> dict[str, Any]:
    """Return the options of a formulation from words.

    Parameters
    ----------
    formulation : Formulation or str
        Whose ``solve`` says which options there are and of which type.
    texts : sequence of str
        Each ``NAME=VALUE``.

    Returns
    -------
    dict of str to (int or str)

    Raises
    ------
    ProblemError
        If there is no such option, or a value is not of its type.
    """
    formulation = as_formulation(formulation)
    known = formulation.options
    out: dict[str, Any] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in known:
            raise ProblemError(
                f"--option {text}: {formulation.name} has {', '.join(known) or 'no options'}"
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

    Parameters
    ----------
    options : argparse.Namespace
        With ``mortar``, and ``friction`` (no unit), ``tensile_strength`` and ``cohesion`` (Pa) as
        text, or None.

    Returns
    -------
    Mortar

    Raises
    ------
    ProblemError
        If a number is negative, or none.
    """
    base = MORTARS[options.mortar]
    given = {
        name: _number(text, f"--{name.replace('_', '-')}", zero="allowed")
        for name in ("friction", "tensile_strength", "cohesion")
        if (text := getattr(options, name)) is not None
    }
    return replace(base, **given)


def _split(text: str) -> tuple[str, str]:
    """Return a response, whose brackets may hold anything, and the number after it."""
    end = text.rfind("]") + 1
    name, _, number = text[end:].partition("=")
    return text[:end] + name, number


def _response(name: str, where: str) -> str:
    if name not in RESPONSES and not name.startswith("F_"):
        names = (*CRITERIA, *RESPONSES) if where == "--criteria" else ("payload", *CHOICE_RESPONSES)
        known = ", ".join((*names, "F_ROBOT"))
        raise ProblemError(f"{where} {name}: there is no such; give {known}")
    return name


def _number(text: str, where: str, zero: str = "") -> float:
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


def step_answers(
    options: argparse.Namespace, engine: Engine, steps: Sequence[Step]
) -> Iterator[tuple[Step, Fields]]:
    """Return steps with their fields, each from scratch or with what earlier ones lock in.

    Parameters
    ----------
    options : argparse.Namespace
        With ``staged``, where bricks are set down or None, and ``engine``.
    engine : Engine
    steps : sequence of Step

    Returns
    -------
    iterator of (Step, Fields)

    Raises
    ------
    SceneError
        If a staged analysis is asked of another engine than the one of rigid bricks.
    """
    if options.staged is None:
        return ((step, step_fields(engine, step)) for step in steps)
    if options.engine != "compliance":
        raise SceneError(
            f"--engine {options.engine}: --staged goes with exactly rigid bricks alone; "
            "give --engine compliance"
        )
    return zip(steps, staged_fields(engine.network, steps, options.staged), strict=True)
