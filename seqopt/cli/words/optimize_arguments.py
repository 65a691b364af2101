"""The arguments of the command ``optimize``, those of a first use before those of an expert."""

from __future__ import annotations

import argparse
from pathlib import Path

from seqopt.cli.words.common_arguments import (
    Takes,
    add_rules,
    add_standing,
    criterion_arguments,
    engine_arguments,
    form_arguments,
    group,
    limit_argument,
    robots_argument,
    scene_argument,
    strict_argument,
    time_argument,
)
from seqopt.plan.calling.formulation import formulation_names
from seqopt.sequence.free_rules import FREE
from seqopt.sequence.three_robots import SCHEDULES


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``optimize``."""
    _basic(group(command, "what is built, and how grips are chosen"))
    limits = group(command, "what is allowed")
    limit_argument(limits)
    _budget(limits)
    form = group(command, "what is printed")
    strict_argument(form)
    form_arguments(form)
    _states(group(command, "what plans are compared by, state after state, with any schedule"))
    add_rules(group(command, "with --schedule free"))
    criterion_arguments(group(command, "what a step costs (advanced)"))
    engine_arguments(group(command, "how responses are computed (advanced)"))
    _search(group(command, "how far the search goes (advanced)"))
    _robust(group(command, "a plan that is good in many scenarios (advanced)"))
    _resources(group(command, "time and memory (advanced)"))


def _basic(takes: Takes) -> None:
    scene_argument(takes)
    takes.add_argument(
        "--formulation",
        metavar="NAME",
        help=f"which mathematical program chooses: {', '.join(formulation_names())} (default: "
        "overlap_dp, which is exact and the fastest, labels with --budget, minimax with --robust "
        "worst-peak, scenario_search with other aims over scenarios; schedule_search with --aim, "
        "--stands or --schedule free, order_search with --order search)",
    )
    takes.add_argument(
        "--schedule",
        metavar="NAME|FILE",
        help=f"which sequence has the open grips: {', '.join(SCHEDULES)} (of all robots), a CSV "
        "file of steps in which open grips are marked ?, or "
        f"{FREE}: any robot may release, hold or place next (default: the loop of three robots, or "
        "of two where there is no third)",
    )
    robots_argument(takes, "a loop, or a schedule that is named")
    takes.add_argument(
        "--out", type=Path, metavar="DIR", help="folder to write plan, tables, summary and page to"
    )


def _budget(takes: Takes) -> None:
    takes.add_argument(
        "--budget",
        action="append",
        default=[],
        metavar="BUDGET",
        help="cap on a total over the build, with the formulations labels, lagrangian, overlap_mip "
        "and overlap_lp: travel=0.8 (of what the optimum without budgets travels), travel=3.5m, "
        "steps_over:F_largest=250:10 (at most 10 open steps over 250 N), robot_use:rob1=100:5 (at "
        "most 5 in which rob1 carries over 100 N); with --aim or --schedule free: steps=N, "
        "regrips=N, travel=METERS or sum(RESPONSE)=VALUE; may be repeated",
    )


def _states(takes: Takes) -> None:
    takes.add_argument(
        "--aim",
        metavar="NAME,NAME",
        help="what is to be as small as possible, the most important first: minmax (the worst step "
        "by the criterion, by default worst-ratio), sum, steps, regrips, travel, bond, friction, "
        "tilt, a response, or sum(RESPONSE) (free: by default minmax; other schedules: by default "
        "the total of what their moves cost); with --order search, the best order of the bricks is "
        "found too",
    )
    add_standing(takes)


def _search(takes: Takes) -> None:
    takes.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="option of the formulation, as horizon=2 or width=10; may be repeated",
    )
    takes.add_argument(
        "--no-proof",
        action="store_true",
        help="with cascade or rank_search: compute only the responses that the search meets, about "
        "a fifth; how far the choice is from the optimum stays unknown",
    )
    takes.add_argument(
        "--lazy",
        action="store_true",
        help="with an exact formulation: compute only the responses that the proof needs; stopped "
        "before it is done, it leaves its best choice and a bound; with --aim or --schedule free "
        "it is done at any rate",
    )
    takes.add_argument(
        "--candidates",
        metavar="RULE",
        help="look at fewer nodes per move: near:12 for those at most 12 joints from the newest "
        "bricks, within:1.5 for those at most 1.5 m from them; makes any formulation a heuristic "
        "(free: of grips on bricks that stand; what is proven holds among these)",
    )


def _robust(takes: Takes) -> None:
    takes.add_argument(
        "--robust",
        metavar="AIM",
        help="what is to be as small as possible over all scenarios, in place of --formulation: "
        "worst-peak (the largest cost of any step), worst-total (the largest total), or cvar=0.9 "
        "(the mean total of the worst tenth)",
    )
    takes.add_argument(
        "--scenarios", metavar="N", help="how many samples of the scene (default: 30)"
    )
    takes.add_argument(
        "--unseen",
        metavar="N",
        help="how many other samples, of the next seed, judge the plan (default: as many)",
    )
    takes.add_argument("--seed", metavar="N", help="which samples are drawn (default: 0)")
    takes.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="how far samples are from the scene: stiffness=3 (of each joint, by a factor up to "
        "it, up or down), density=0.1 (of each brick, up to this share), position=0.002 (of each "
        "brick and joint, up to so many m); these are the defaults; may be repeated",
    )


def _resources(takes: Takes) -> None:
    time_argument(
        takes,
        "stop choosing after it, with the best choice so far and a bound; with --no-proof, "
        "where choosing and computing are one, with the moves that were chosen by then",
    )
    takes.add_argument(
        "--workers",
        default="1",
        metavar="N",
        help="processes to share the work among; pays from about ten seconds (default: "
        "%(default)s)",
    )
    takes.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="keep answers there and use what is there: a run that was ended goes on",
    )
    takes.add_argument(
        "--max-memory",
        metavar="SIZE",
        help="what responses and costs may take, as 500MB or 2GB (default: four fifths of what is "
        "free); of a free schedule states and moves, with a bound where it ends",
    )
