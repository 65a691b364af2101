"""What the words of the command line say of criteria."""

from __future__ import annotations

import argparse
import re
from dataclasses import replace

from seqopt.cli.words.values import number_word, response_word, split_word
from seqopt.errors import ProblemError
from seqopt.problem.criteria import RankSum
from seqopt.problem.ranks import Among, Ranked
from seqopt.problem.requirements import Criterion
from seqopt.problem.scales import NEVER
from seqopt.study.presets import CRITERIA
from seqopt.workflow import DEFAULTS

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

    ``ranked``, ``among``: values of `seqopt.problem.ranks.Ranked` and
    `seqopt.problem.ranks.Among`. Raises `ProblemError` if either is given and the criterion has
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
