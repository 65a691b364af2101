"""Arguments of the command line that several commands share."""

from __future__ import annotations

import argparse
from pathlib import Path

from seqopt.placement.ranks import Among, Ranked
from seqopt.study.presets import CRITERIA


def strict_argument(command: argparse.ArgumentParser) -> None:
    """Add the argument that asks for a status where a payload is exceeded.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    command.add_argument(
        "--strict",
        action="store_true",
        help="end with status 1 if a robot would exceed its payload in a step",
    )


def robots_argument(command: argparse.ArgumentParser, whose: str) -> None:
    """Add the argument that names robots.

    Parameters
    ----------
    command : argparse.ArgumentParser
    whose : str
        Which methods take them, for the help.
    """
    command.add_argument(
        "--robots",
        default="",
        metavar="NAME,NAME[,NAME]",
        help=f"with {whose} robots that take part, in the order of their roles (default: the first "
        "of the scene whose reach allows the build)",
    )


def criterion_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments that say what a step costs.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    command.add_argument(
        "--crown",
        metavar="BRICKS",
        help="for criteria of ranks: bricks placed at the crown, or none; by default derived from "
        "the scene",
    )
    command.add_argument(
        "--criteria",
        metavar="NAME",
        help=f"what a step costs: {', '.join(CRITERIA)}, or responses to rank with weights, as "
        "T_max,M_sup=2,F_move; equations (2) and (3) of Bruun et al. by default",
    )

    command.add_argument(
        "--ranked",
        choices=[ranked.value for ranked in Ranked],
        help="for criteria of ranks: those of a step that two moves share run over all pairs, or "
        "are conditional on the earlier choice (default: pairs)",
    )
    command.add_argument(
        "--among",
        choices=[among.value for among in Among],
        help="for criteria of ranks: candidates of a move are ranked among all, or among those "
        "possible after the choice before (default: all)",
    )


def limit_argument(command: argparse.ArgumentParser) -> None:
    """Add the argument that caps a response in every step.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    command.add_argument(
        "--limit",
        action="append",
        default=[],
        metavar="LIMIT",
        help="no open step may exceed it: payload, or as F_largest=300 (SI units); may be repeated",
    )


def resources_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments that say how much is looked at, and what a computation may use.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    command.add_argument(
        "--candidates",
        metavar="RULE",
        help="look at fewer: near:12 for nodes at most 12 joints from the newest bricks, "
        "within:1.5 for nodes at most 1.5 m from them; a heuristic",
    )
    command.add_argument(
        "--time-limit",
        metavar="SECONDS",
        help="stop choosing after it, with the best choice so far and a bound",
    )
    command.add_argument(
        "--workers",
        default="1",
        metavar="N",
        help="processes to share the work among; pays from some ten seconds (default: %(default)s)",
    )
    command.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="keep answers there and use what is there: a run that was ended goes on",
    )
    command.add_argument(
        "--max-memory",
        metavar="SIZE",
        help="what responses and costs may take, as 500MB or 2GB (default: four fifths of what is "
        "free)",
    )


def proof_argument(command: argparse.ArgumentParser) -> None:
    """Add the arguments that do without a proof, or prove with fewer models.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    command.add_argument(
        "--no-proof",
        action="store_true",
        help="with cascade or rank_search: solve only the models that the search meets, a fifth "
        "or so; how far the choice is from the optimum stays unknown",
    )
    command.add_argument(
        "--lazy",
        action="store_true",
        help="with an exact formulation: solve only the models that the proof needs; stopped "
        "before it is done, it leaves its best choice and a bound",
    )


def robust_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments that ask for a plan that is good in many scenarios.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    command.add_argument(
        "--robust",
        metavar="AIM",
        help="over scenarios, what is to be least: worst-peak (largest cost of any step), "
        "worst-total (largest total), or cvar=0.9 (mean total of the worst tenth); in the place of "
        "--formulation",
    )
    command.add_argument(
        "--scenarios",
        metavar="N",
        help="with --robust: how many samples of the scene it is good in (default: 30)",
    )
    command.add_argument(
        "--unseen",
        metavar="N",
        help="with --robust: how many others, of the next seed, it is judged on (default: as many)",
    )
    command.add_argument(
        "--seed", metavar="N", help="with --robust: which samples are drawn (default: 0)"
    )
    command.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="with --robust, how far samples are from the scene: stiffness=3 (of each joint, by a "
        "factor up to it, up or down), density=0.1 (of each brick, up to this share), "
        "position=0.002 (of each brick and joint, up to so many m); these are the defaults; may be "
        "repeated",
    )


def caps_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments that forbid choices.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    limit_argument(command)
    command.add_argument(
        "--budget",
        action="append",
        default=[],
        metavar="BUDGET",
        help="cap on a total over the build, with labels, lagrangian, overlap_mip or overlap_lp: "
        "travel=0.8 (of what the optimum without budgets travels), travel=3.5m, "
        "steps_over:F_largest=250:10 (at most 10 open steps over 250 N), robot_use:rob1=100:5; "
        "may be repeated",
    )
