"""Options of the command line: how they are declared, and those that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from seqopt._cli.screens import question
from seqopt.engines.registry import ENGINES
from seqopt.problem.criteria import Among, Ranked
from seqopt.scene.scene_file import builtin_scenes
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import CRITERIA, PUBLISHED
from seqopt.workflow import Defaults

Takes: TypeAlias = argparse._ActionsContainer  # a parser, or a group of its arguments
PATHS = ("FILE", "DIR", "FOLDER", "PLAN_DIR")
MANY, AGAIN = " ...", "; may be repeated"
BUILT, MOVES = "What is built, and by whom?", "Which steps may a build have?"
BEST, HOLDS = "What counts as best?", "What must hold?"
COMPUTED, WRITTEN = "How are responses computed?", "What is written and printed?"
PROVES = "Who chooses and proves, and how long?"


def declare(takes: Takes, about: Mapping[str, str], **more: Any) -> None:
    """Add options, each as a usage line has it, with its help.

    One without a value is a switch, the value of `PATHS` is a path, and what ends in `MANY` may be
    repeated; the rest are text. ``more`` is of `argparse.ArgumentParser.add_argument`, for all.
    """
    for words, text in about.items():
        name, _, value = words.partition(" ")
        how: dict[str, Any] = {"metavar": value.removesuffix(MANY)}
        if not value:
            how = {"action": "store_true"}
        elif value.endswith(MANY):
            how |= {"action": "append", "default": []}
        elif value in PATHS:
            how["type"] = Path
        takes.add_argument(name, help=text + AGAIN * value.endswith(MANY), **how, **more)


LIMIT = {
    "--limit LIMIT ...": "what no step may exceed: payload (of every robot), or RESPONSE=VALUE in "
    "SI units, as F_largest=300; also where no grip is open. Plans keep the linear range wherever "
    "one does: linear_range=any lifts that, 0.5 asks for half of it in every step"
}
RULE = {
    "--rule NAME=VALUE ...": "what robots may do: least_grips=N (2, or 1 of two robots, from the "
    "second brick on), newest=either|placing|free (where the newest brick is held), regrips=N|any "
    "(between two bricks), placers=NAME,NAME|any, payload=kept|ignored, ending=held|released|"
    "one-by-one (how robots leave the finished structure), candidates=near:JOINTS|within:METERS|"
    "all (as --candidates)"
}
WHERE = {
    "--from PLAN:STEP|STATE|N": "where the build begins: after a step of a plan (its folder or CSV "
    "file); in a state of a JSON file (bricks that stand, by names or how many, grips by robot, "
    "ages of bricks in s where mortar cures, else just placed); or with so many bricks that nobody "
    "holds",
    "--to PLAN:STEP|STATE|N": "where it ends, said in the same ways; a number of bricks leaves "
    "grips to the rule ending",
    "--direction build|take-down": "with --schedule free: take-down removes bricks, the newest "
    "first, from the whole structure to the empty site, if nothing else is said",
    "--keep BRICK,BRICK": "with --direction take-down: bricks that stay, as 1..12",
}
STANDING = {
    "--stands MORTAR": "every state must be proven to stand, robots within payload: dry, epoxy or "
    "bond=STRENGTH (Pa)",
    "--friction F": "with --stands: coefficient of friction",
    "--tilt DEG": "with --stands: tilt that every state must survive",
}
CURING = {
    "--curing WORDS ...": "with --stands: which share of its bond mortar has at an age: 15min (in "
    "proportion, full then), 0s=0.005,5min=0.4,15min=1 (what is reached when), never; of one joint "
    "with its name before, as 5-6:30min. What is let go waits for it (default: full at once)"
}
STRICT = {
    "--strict": "end with exit status 1 if a robot would exceed its payload in a step, or results "
    "leave the linear range"
}
DURATIONS = {
    "--durations WORDS ...": "how long robots take, s: "
    "fetch=30,place=10,approach=10,grip=5,release=5 or speed=0.2 (m/s, of ways between grips); "
    "that is to bring the next brick, to place it, to come to one that stands, to grip it, to let "
    "go; who is free fetches and approaches while others act; of one robot with its name before, "
    "as rob3:fetch=75 or rob3:slower=2.5 (default: as the scene says)"
}
STEPS_USAGE = (
    "[SCENE] [--method NAME] [--out FILE] [other options]",
    "[SCENE] --plan FILE [--out FILE] [other options]",
    "PLAN_DIR [--out FILE] [other options]",
)
STABILITY = {
    "--no-stability": "do not prove which steps stand, dry and with epoxy (or the mortar of "
    "--stands or --mortar): quicker"
}
POSTURES = {
    "--cache DIR": "where robots have arms: keep their postures there, and use what is there"
}
CSV_OUT = {"--out FILE": "CSV file to write (default: standard output)"}


def scene_options(takes: Takes) -> None:
    """Add what says what is built, and in which order."""
    known = f"a built-in scene ({', '.join(builtin_scenes())}), a JSON file, a plan's folder, or "
    how = "words as arch:span=2,rise=0.8 (default: %(default)s); seqopt scene --list shows all"
    declare(takes, {"scene SCENE": known + how}, nargs="?", default="arch25")
    order = (
        "in which order bricks are placed, if not in the scene's own: "
        "reversed, ends (from all ground ends at once), sides (course by course, from both ends of "
        "each to its middle), or the names of all bricks, as 1..12,25..13"
    )
    grips = (
        "how stiff the grips of all robots are, if not as the scene says: rigid, or N/m, as 1e6, "
        "or three along its axes, as 1e6x1e6x5e5; turning=N m/rad after a comma keeps held bricks "
        "from turning"
    )
    props = (
        "nodes that props hold beside the robots, if not as the scene says, until the finished "
        "structure is let go: as 13,27, or every, one at each brick as centering has; N/m after "
        "a colon if they are not rigid, as every:1e6; then push for such as only push up, and "
        "capacity=N"
    )
    payload = (
        "what every robot may carry, N, if not as the scene says; of one robot with its name "
        "before, as rob1=250"
    )
    said = {"--order ORDER": order, "--grips STIFFNESS": grips, "--props NODES": props}
    declare(takes, said | {"--payload NEWTON ...": payload})


def engine_options(command: argparse.ArgumentParser) -> Takes:
    """Return the group of what says what computes responses, added to a command."""
    takes = question(command, COMPUTED)
    takes.add_argument(
        "--engine",
        choices=tuple(ENGINES),
        help=f"what computes responses (default: {Defaults.engine}): compliance: exactly rigid "
        "bricks, fast; planar: the same with three unknowns per brick, where all lies in a plane; "
        "frame: stiff bars, a slow independent check; discrete: joints that open and slip; auto: "
        "the cheapest of planar, compliance and discrete that is enough",
    )
    takes.add_argument(
        "--mortar",
        help="what holds the joints, in verdicts and in the engines auto and discrete: epoxy, that "
        "of Bruun et al. (default), dry, nothing, or bond=STRENGTH (Pa)",
    )
    return takes


def form_options(
    command: argparse.ArgumentParser, *, strict: bool = False, builds: bool = False
) -> None:
    """Add what says in which form the answer is printed, and what is said of builds in it.

    ``strict``, ``builds``: whether ``--strict`` is taken, and ``--no-stability``.
    """
    takes = question(command, WRITTEN)
    declare(takes, STABILITY if builds else {})
    declare(takes, STRICT if strict else {})
    forms = {
        "--quiet": "print errors and the paths of what is written, nothing else",
        "--json": "print one JSON document, for scripts",
    }
    declare(takes.add_mutually_exclusive_group(), forms, default=argparse.SUPPRESS)


def robots_option(takes: Takes, whose: str) -> None:
    """Add the option that names robots; the help says what they take part in."""
    said = (
        "how many robots there are (those of the scene first, further ones reach every node), or "
        f"the names of those that take part in {whose}; in the order in which they place their "
        "first bricks (default: the first of the scene whose reach allows the build)"
    )
    declare(takes, {"--robots N|NAME,NAME": said}, default="")


def criterion_options(command: argparse.ArgumentParser) -> None:
    """Add what says what a step costs."""
    takes = question(command, BEST)
    about = {
        "--criteria NAME": "what a step costs: equations-2-3 (of Bruun et al.), worst-ratio (over "
        "the least worst of fixed methods), or responses to rank with weights, as "
        f"T_max,M_sup=2,F_move; all names: {', '.join(CRITERIA)} (default: equations-2-3; with "
        "--aim, --stands or --schedule free worst-ratio)",
        "--crown BRICKS": "for criteria of ranks: how many bricks are placed at the crown of an "
        "arch, or none (default: derived from the scene)",
    }
    declare(takes, about)
    takes.add_argument(
        "--ranked",
        choices=[ranked.value for ranked in Ranked],
        help="for criteria of ranks: where two open grips meet in a step, rank all pairs of their "
        "nodes together, or only the pairs with the node chosen before (default: pairs)",
    )
    takes.add_argument(
        "--among",
        choices=[among.value for among in Among],
        help="for criteria of ranks: rank candidates of a move among all, or among those possible "
        "after the choice before (default: all)",
    )


def steps_options(takes: Takes) -> None:
    """Add what names a closed sequence of steps."""
    steps = takes.add_mutually_exclusive_group()
    steps.add_argument(
        "--method",
        choices=(*METHODS, PUBLISHED),
        help=f"how it is built: by two robots, or {PUBLISHED}, the three-robot plan that Bruun et "
        f"al. print for arch25 (default: the first of {', '.join(METHODS)} that fits, or the "
        "steps of a plan's folder)",
    )
    plan = "a plan's folder, or a CSV file of steps: step, type, bricks, NAME_node of each robot"
    declare(steps, {"--plan FILE": plan})
    robots_option(takes, "--method")


def speed_option(takes: Takes) -> None:
    """Add what asks for speed against accuracy."""
    takes.add_argument(
        "--speed",
        metavar="SECONDS",
        nargs="?",
        const="10",
        help="also chart speed against accuracy: the loop by every engine and formulation, each "
        "within so many seconds (10); errors are those beside the engine that --engine names",
    )
