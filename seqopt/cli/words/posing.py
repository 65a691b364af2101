"""The problem that the words of the command line pose."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from typing import Any

from seqopt.cli.saying.outputs import require_out
from seqopt.cli.words.asked import asked_engine, asked_scene
from seqopt.cli.words.values import (
    asked_aim,
    asked_criterion,
    asked_scenarios,
    parse_criterion,
    parse_limits,
    parse_resources,
    parse_robots,
    parse_rules,
    parse_standing,
    require_no_scenarios,
)
from seqopt.errors import ProblemError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.calling.formulation import On, find_formulation
from seqopt.problem.problem import Orders, Problem, RobustAim, parse_budgets, parse_caps
from seqopt.problem.requirements import Criterion
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.free_rules import FREE, FreeRules, with_robots
from seqopt.sequence.schedule import Schedule, thin
from seqopt.sequence.schedule_file import find_schedule
from seqopt.workflow import SEARCH, posed


@dataclass(frozen=True, eq=False)
class Asked:
    """What a command is asked for: the problem, the scenarios, and those that judge the plan."""

    scene: Scene
    problem: Problem
    aim: RobustAim | None = None
    known: Scenarios | None = None
    unseen: Scenarios | None = None


def asked_problem(options: argparse.Namespace) -> Asked:
    """Return the problem that the command ``optimize`` or ``pareto`` is asked for.

    Raises `ProblemError` or `StepError` if words do not go together, naming one.
    """
    of_states = _wants_states(options)
    (_require_states if of_states else _require_candidates)(options)
    sought = options.order == SEARCH
    options.order = None if sought else options.order
    criterion = _criterion(options, of_states=of_states)
    scene = asked_scene(options)
    if options.robots.isdecimal():
        scene = with_robots(scene, int(options.robots))
    words: dict[str, Any] = {"limits": parse_limits(options.limit, scene)}
    budgets = getattr(options, "budget", [])
    (parse_caps if of_states else parse_budgets)(budgets)  # said before anything is built
    if options.command == "optimize":
        words["resources"] = parse_resources(options, None if of_states else options.tell)
        words["formulation"] = options.formulation
    aim = known = unseen = None
    if options.command == "optimize" and options.robust is not None:
        aim = asked_aim(options)
        known, unseen = asked_scenarios(options, scene)
        words |= {"scenarios": known, "over": aim}
    require_out(options)
    engine = asked_engine(options, build_network(scene))
    moves = _asked_moves(options, engine.network)
    words |= {"stands": parse_standing(options), "budgets": budgets}
    words |= {"orders": Orders.TIED} if sought else {}
    problem = posed(engine, moves, criterion, options.aim, **words)
    return Asked(scene, problem, aim, known, unseen)


def _wants_states(options: argparse.Namespace) -> bool:
    """Return whether states of the build are to be chosen, and not candidates of moves."""
    if options.schedule == FREE or options.aim or options.stands or options.order == SEARCH:
        return True
    named = getattr(options, "formulation", None)
    return named is not None and find_formulation(named).on in (On.STATES, On.ORDERS)


def _criterion(options: argparse.Namespace, *, of_states: bool) -> Criterion | None:
    """Return the criterion that is asked for; None leaves it to what is posed."""
    if of_states:
        asked = options.criteria is not None
        return parse_criterion(options.criteria, options.crown) if asked else None
    said = (options.criteria, options.crown, options.ranked, options.among)
    return None if said == (None,) * 4 else asked_criterion(options)


def _asked_moves(options: argparse.Namespace, network: Network) -> Schedule | FreeRules:
    """Return the open grips or the rules that a command is asked for."""
    if options.schedule != FREE:
        return _asked_schedule(options, network)
    names = () if options.robots.isdecimal() else parse_robots(options.robots)
    rules = parse_rules(options.rule, names)
    candidates = getattr(options, "candidates", None)
    return replace(rules, candidates=candidates) if candidates else rules


def _require_candidates(options: argparse.Namespace) -> None:
    """Raise an error if options are given that only states have."""
    require_no_scenarios(options)
    for name in ("rule", "tilt", "friction"):
        if getattr(options, name):
            also = "" if name == "rule" else " --stands MORTAR, or"
            raise ProblemError(f"--{name}: it needs more; give{also} --schedule {FREE}")
    if options.robots.isdecimal():
        raise StepError("--robots: a count of robots goes with --schedule free")


def _require_states(options: argparse.Namespace) -> None:
    """Raise an error if options are given that states do not have."""
    if options.command == "optimize":
        require_no_scenarios(options)
    free = options.schedule == FREE
    given = [name for name in ("ranked", "among") if getattr(options, name, None)]
    if given:
        said = "the free schedule has no such" if free else "aims and --stands have no such"
        raise ProblemError(f"--{given[0].replace('_', '-')}: {said}; leave it out")
    if not free and options.rule:
        raise ProblemError("--rule: aims and --stands have no such; leave it out")
    if not free and options.robots.isdecimal():
        raise StepError(f"--schedule {options.schedule}: a count of robots goes with free")


def _asked_schedule(options: argparse.Namespace, network: Network) -> Schedule:
    """Return the schedule with open grips that a command is asked for."""
    schedule = find_schedule(network, options.schedule, parse_robots(options.robots))
    rule = getattr(options, "candidates", None)
    return schedule if rule is None else thin(schedule, rule)
