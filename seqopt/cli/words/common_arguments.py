"""Arguments of the command line that several commands share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TypeAlias

from seqopt.cli.words.values import parse_robots
from seqopt.contact.mortar import MORTARS
from seqopt.engines.registry import ENGINES
from seqopt.errors import SceneError, StepError
from seqopt.network.build import build_network
from seqopt.problem.criteria import Among, Ranked
from seqopt.scene.scene import ORDERS, Scene
from seqopt.scene.scene_file import builtin_scenes
from seqopt.sequence.schedule_file import read_plan
from seqopt.sequence.steps import Step
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import CRITERIA, PUBLISHED, is_reference_arch, published_plan
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


RULES = (
    "least_grips=N (2; from the second brick on), newest=either|placing|free (where the newest "
    "brick is held), regrips=N|any (between two bricks), placers=NAME,NAME|any, "
    "payload=kept|ignored, ending=held|released|one-by-one (how robots leave the finished "
    "structure), candidates=near:JOINTS|within:METERS|all (as --candidates)"
)


def add_rules(takes: Takes) -> None:
    """Add what a free schedule takes."""
    takes.add_argument(
        "--rule",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"what robots may do: {RULES}; may be repeated",
    )


def add_standing(takes: Takes) -> None:
    """Add what demands that every state stands."""
    takes.add_argument(
        "--stands",
        metavar="MORTAR",
        help="every state must be proven to stand, robots within payload: "
        "dry, epoxy or bond=STRENGTH (Pa)",
    )
    takes.add_argument("--friction", metavar="F", help="with --stands: coefficient of friction")
    takes.add_argument(
        "--tilt", metavar="DEG", help="with --stands: tilt that every state must survive"
    )


def steps_arguments(takes: Takes) -> None:
    """Add the arguments that name a closed sequence of steps."""
    steps = takes.add_mutually_exclusive_group(required=True)
    steps.add_argument(
        "--method",
        choices=(*METHODS, PUBLISHED),
        help=f"how it is built: by two robots, or {PUBLISHED}, the three-robot plan that Bruun et "
        "al. print for arch25",
    )
    steps.add_argument(
        "--plan",
        type=Path,
        metavar="FILE",
        help="CSV file of the steps: step, type, bricks, and NAME_node for each robot",
    )
    robots_argument(takes, "--method")


def asked_steps(scene: Scene, options: argparse.Namespace) -> tuple[Step, ...]:
    """Return the closed sequence that a command is asked for.

    ``options``: with ``method``, ``plan`` and ``robots``. Raises `SceneError`, `StepError` if the
    method is not for the scene, or robots are named beside a plan.
    """
    robots = parse_robots(options.robots)
    if robots and options.method not in METHODS:
        raise StepError(
            f"--robots {options.robots}: a plan says itself who holds; leave it out, or give "
            f"--method {' or '.join(METHODS)}"
        )
    if options.plan is not None:
        return read_plan(scene, options.plan)
    if options.method != PUBLISHED:
        return METHODS[options.method](build_network(scene), robots)
    if not is_reference_arch(scene):
        raise SceneError(
            f"scene {scene.name}: --method {PUBLISHED} is the printed plan for arch25; "
            "give --plan FILE for another scene"
        )
    return published_plan(scene)
