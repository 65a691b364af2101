"""The words of the free schedule and of Pareto sets on the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from seqopt.sequence.free_rules import FREE
from seqopt.sequence.three_robots import SCHEDULES

RULES = (
    "least_grips=N (2; from the second brick on), newest=either|placing|free (where the newest "
    "brick is held), regrips=N|any (between two bricks), placers=NAME,NAME|any, "
    "payload=kept|ignored, ending=held|released|one-by-one"
)
FOUR = "F_largest,M_sup,T_max,D_max"


def add_rules(command: argparse.ArgumentParser) -> None:
    """Add what a free schedule takes.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    command.add_argument(
        "--rule",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"with --schedule free: {RULES}; may be repeated",
    )

    _add_standing(command)


def _add_standing(command: argparse.ArgumentParser) -> None:
    """Add what demands that every state of a free schedule stands."""
    command.add_argument(
        "--stands",
        metavar="MORTAR",
        help="with --schedule free: every state must be proven to stand, robots within payload: "
        "dry, epoxy or bond=STRENGTH (Pa)",
    )
    command.add_argument("--friction", metavar="F", help="with --stands: coefficient of friction")
    command.add_argument(
        "--tilt", metavar="DEG", help="with --stands: tilt that every state must survive"
    )


def add_pareto(
    commands: argparse._SubParsersAction[Any],
    parents: Sequence[argparse.ArgumentParser],
    limit: Callable[[argparse.ArgumentParser], None],
) -> None:
    """Add the command ``pareto``.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    parents : sequence of argparse.ArgumentParser
        Whose arguments it has.
    limit : callable
        Adds the argument ``--limit``.
    """
    command = commands.add_parser(
        "pareto",
        parents=[*parents],
        help="all plans that no other beats in every response",
        description="Find every plan of the free schedule, or of a schedule with open grips, that "
        "no other one beats in all responses at once; check each; write table, plans and chart.",
        epilog="example: seqopt pareto arch25 --pick D_max --under F_largest=250 --out front",
    )
    command.add_argument(
        "--schedule",
        default=FREE,
        metavar="NAME|FILE",
        help=f"{FREE} (default), or one with open grips: {', '.join(SCHEDULES)}, or a CSV file",
    )
    command.add_argument(
        "--aim",
        default=FOUR,
        metavar="NAME,NAME",
        help="what is to be small: responses and, of the free schedule, steps and regrips "
        "(default: %(default)s)",
    )
    command.add_argument(
        "--robots",
        default="",
        metavar="N|NAME,NAME",
        help="how many robots (further ones are mobile), or which take part",
    )
    add_rules(command)
    limit(command)
    _add_choice(command)
    command.add_argument("--out", type=Path, metavar="DIR", required=True, help="folder to write")
    command.set_defaults(criteria=None, crown=None)


def _add_choice(command: argparse.ArgumentParser) -> None:
    """Add what says how finely plans are told apart, and which of them is picked."""
    command.add_argument(
        "--round",
        action="append",
        default=[],
        metavar="NAME=STEP",
        help="round a number up to multiples of a step (SI units); may be repeated",
    )
    command.add_argument(
        "--pick", metavar="NAME", help="also write the plan with the least of a column of the table"
    )
    command.add_argument(
        "--under",
        action="append",
        default=[],
        metavar="BOUND",
        help="for --pick: only plans below it: NAME=VALUE (SI units), or a method that is to be "
        "beaten in everything: sequential, cantilever, published; may be repeated",
    )
    command.add_argument(
        "--seconds", default="inf", type=float, metavar="S", help="end the search after so long"
    )
