"""The problem that the words of the command line pose."""

from __future__ import annotations

import argparse

from seqopt.cli.asked import asked_engine, asked_scene
from seqopt.cli.budgets import parse_budgets, with_budgets
from seqopt.cli.criteria import asked_criterion
from seqopt.cli.means import parse_resources
from seqopt.cli.values import parse_limits, parse_robots
from seqopt.files import require_folder
from seqopt.network.build import build_network
from seqopt.placement.problem import Problem, pose
from seqopt.sequence.schedule_file import find_schedule
from seqopt.sequence.thinning import thin


def asked_problem(options: argparse.Namespace) -> Problem:
    """Return the problem that the command ``optimize`` is asked for.

    Parameters
    ----------
    options : argparse.Namespace
        Of the command.

    Returns
    -------
    Problem
    """
    criterion = asked_criterion(options)
    scene = asked_scene(options)
    limits = parse_limits(options.limit, scene)
    resources = parse_resources(options, options.tell)
    budgets = parse_budgets(options.budget)
    require_folder(options.out)
    network = build_network(scene)
    engine = asked_engine(options, network)
    schedule = find_schedule(network, options.schedule, parse_robots(options.robots))
    if options.candidates is not None:
        schedule = thin(schedule, options.candidates)
    counted = [budget.response for budget in budgets if budget.response]
    return with_budgets(pose(engine, schedule, criterion, limits, counted, resources), budgets)
