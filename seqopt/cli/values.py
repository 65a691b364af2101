"""What the words of the command line stand for: criteria, limits, options, mortars."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from seqopt.contact.mortar import MORTARS, Mortar
from seqopt.errors import ProblemError
from seqopt.placement.criteria import RankSum
from seqopt.placement.formulation import Formulation, as_formulation
from seqopt.placement.requirements import Criterion, Limit, payload_limits
from seqopt.placement.scales import NEVER
from seqopt.responses.choices import CHOICE_RESPONSES
from seqopt.scene.scene import Scene
from seqopt.study.presets import CRITERIA

BETWEEN = re.compile(r",(?![^\[]*\])")  # a comma that is not in brackets
LARGEST = 1e100  # number: products of larger ones overflow
RESPONSES = (*CHOICE_RESPONSES, "F_each")


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


def parse_numbers(
    where: str, texts: Sequence[str], known: Mapping[str, object] | None = None
) -> dict[str, float]:
    """Return positive numbers by name from words.

    Parameters
    ----------
    where : str
        The argument, for messages.
    texts : sequence of str
        Each ``NAME=VALUE``.
    known : mapping of str to object, optional
        Names that there are; any by default.

    Returns
    -------
    dict of str to float

    Raises
    ------
    ProblemError
        If there is no such name, or a value is not positive.
    """
    out: dict[str, float] = {}
    for text in texts:
        name, value = _split(text)
        if known is not None and name not in known:
            raise ProblemError(f"{where} {text}: there is no such; give one of {', '.join(known)}")
        out[name] = _number(value, f"{where} {text}")
    return out


def parse_options(formulation: Formulation | str, texts: Sequence[str]) -> dict[str, int | str]:
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
    out: dict[str, int | str] = {}
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
