"""The closed sequence of steps that a command is asked for: by a method, or from a file."""

from __future__ import annotations

import argparse
from pathlib import Path

from seqopt.cli.words.common_arguments import Takes, robots_argument
from seqopt.cli.words.values import parse_robots
from seqopt.errors import SceneError, StepError
from seqopt.network.build import build_network
from seqopt.scene.scene import Scene
from seqopt.sequence.plan_file import read_plan
from seqopt.sequence.steps import Step
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import PUBLISHED, is_reference_arch, published_plan


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
