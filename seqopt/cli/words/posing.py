"""The problem that the words of the command line pose."""

from __future__ import annotations

import argparse

from seqopt.cli.saying.outputs import require_out
from seqopt.cli.words.asked import asked_engine, asked_scene
from seqopt.cli.words.criteria import asked_criterion
from seqopt.cli.words.means import parse_resources
from seqopt.cli.words.values import parse_limits, parse_robots
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.problem.budgets import parse_budgets
from seqopt.sequence.schedule import Schedule, thin
from seqopt.sequence.schedule_file import find_schedule
from seqopt.workflow import posed


def asked_problem(options: argparse.Namespace) -> Layers:
    """Return the problem that the command ``optimize`` is asked for.

    ``options``: of the command.
    """
    criterion = asked_criterion(options)
    scene = asked_scene(options)
    limits = parse_limits(options.limit, scene)
    resources = parse_resources(options, options.tell)
    parse_budgets(options.budget)  # what is wrong is said before anything is built
    require_out(options)
    engine = asked_engine(options, build_network(scene))
    schedule = asked_schedule(options, engine.network)
    return posed(engine, schedule, criterion, limits, options.budget, resources)


def asked_schedule(options: argparse.Namespace, network: Network) -> Schedule:
    """Return the schedule with open grips that a command is asked for."""
    schedule = find_schedule(network, options.schedule, parse_robots(options.robots))
    rule = getattr(options, "candidates", None)
    return schedule if rule is None else thin(schedule, rule)
