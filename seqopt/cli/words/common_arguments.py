"""Arguments of the command line that several commands share."""

from __future__ import annotations

import argparse
from typing import TypeAlias

from seqopt.contact.mortar import MORTARS
from seqopt.engines.registry import ENGINES
from seqopt.problem.ranks import Among, Ranked
from seqopt.scene.orders import ORDERS
from seqopt.scene.scene_file import builtin_scenes
from seqopt.study.presets import CRITERIA
from seqopt.workflow import Defaults

Takes: TypeAlias = argparse._ActionsContainer  # a parser, or a group of its arguments


def group(command: argparse.ArgumentParser, title: str, about: str | None = None) -> Takes:
    """Return a group of arguments, which help shows under a title.

    ``about``: a sentence below it.
    """
    return command.add_argument_group(title, about)


def scene_argument(takes: Takes) -> None:
    """Add the arguments that say what is built, and in which order."""
    takes.add_argument(
        "scene",
        nargs="?",
        default="arch25",
        metavar="SCENE",
        help=f"a built-in scene ({', '.join(builtin_scenes())}), a JSON file, or a few words such "
        "as arch:span=2,rise=0.8 (seqopt scene --list shows all; default: %(default)s)",
    )
    takes.add_argument(
        "--order",
        metavar="ORDER",
        help="in which order bricks are placed, if not in the scene's own: "
        f"{', '.join(ORDERS)} (from all ground ends at once), or the names of all bricks, as "
        "1..12,25..13",
    )


def engine_arguments(takes: Takes) -> None:
    """Add the arguments that say what computes responses."""
    takes.add_argument(
        "--engine",
        choices=tuple(ENGINES),
        default=Defaults.engine,
        help="what computes responses (default: %(default)s): compliance: exactly rigid bricks, "
        "fast; planar: the same with three unknowns per brick, where all lies in a plane; frame: "
        "stiff bars, a slow independent check; discrete: joints that open and slip; auto: the "
        "cheapest of planar, compliance and discrete that is enough",
    )
    takes.add_argument(
        "--mortar",
        choices=tuple(MORTARS),
        help="what holds the joints of the engines auto and discrete: the epoxy of Bruun et al. "
        "(default), or dry, nothing",
    )


def form_arguments(takes: Takes) -> None:
    """Add the arguments that say in which form the answer is printed."""
    form = takes.add_mutually_exclusive_group()
    form.add_argument(
        "--quiet",
        action="store_true",
        default=argparse.SUPPRESS,
        help="print errors and the paths of what is written, nothing else",
    )
    form.add_argument(
        "--json",
        action="store_true",
        default=argparse.SUPPRESS,
        help="print one JSON document, for scripts",
    )


def strict_argument(takes: Takes) -> None:
    """Add the argument that asks for a status where a payload is exceeded."""
    takes.add_argument(
        "--strict",
        action="store_true",
        help="end with exit status 1 if a robot would exceed its payload in a step, or results "
        "leave the linear range",
    )


def time_argument(takes: Takes, said: str) -> None:
    """Add the argument that says when a command ends.

    ``said``: what it leaves.
    """
    takes.add_argument("--time-limit", metavar="SECONDS", help=said)


def robots_argument(takes: Takes, whose: str) -> None:
    """Add the argument that names robots.

    ``whose``: what they take part in, for the help.
    """
    takes.add_argument(
        "--robots",
        default="",
        metavar="NAME,NAME[,NAME]",
        help=f"robots that take part in {whose}, in the order in which they place their first "
        "bricks (default: the first of the scene whose reach allows the build)",
    )


def criterion_arguments(takes: Takes) -> None:
    """Add the arguments that say what a step costs."""
    takes.add_argument(
        "--criteria",
        metavar="NAME",
        help=f"what a step costs: {', '.join(CRITERIA)}, or responses to rank with weights, as "
        "T_max,M_sup=2,F_move (default: equations (2) and (3) of Bruun et al.)",
    )
    takes.add_argument(
        "--crown",
        metavar="BRICKS",
        help="for criteria of ranks: how many bricks are placed at the crown of an arch, or none "
        "(default: derived from the scene)",
    )
    takes.add_argument(
        "--ranked",
        choices=[ranked.value for ranked in Ranked],
        help="for criteria of ranks: rank a step that two moves share over all pairs of their "
        "candidates, or only over those that go with the earlier choice (default: pairs)",
    )
    takes.add_argument(
        "--among",
        choices=[among.value for among in Among],
        help="for criteria of ranks: rank candidates of a move among all, or among those possible "
        "after the choice before (default: all)",
    )


def limit_argument(takes: Takes) -> None:
    """Add the argument that caps a response in every step."""
    takes.add_argument(
        "--limit",
        action="append",
        default=[],
        metavar="LIMIT",
        help="no step may exceed it, whether or not a grip is open in it: payload (of every "
        "robot), or RESPONSE=VALUE in SI units, as F_largest=300; may be repeated",
    )
