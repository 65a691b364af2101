"""Scenarios in words: how many, how far from the scene, and what counts over them."""

from __future__ import annotations

import argparse

from seqopt.cli.words.values import number_word, split_word
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.aims import RobustAim, parse_robust
from seqopt.scene.scenarios import MOST, Scenarios, scenarios
from seqopt.scene.scene import Scene

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
