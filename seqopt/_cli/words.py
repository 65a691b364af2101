"""Words of the command line: those for options, and values that several options make.

`SPREAD` says which parameters are made of several words. An option that a table names has one
meaning in all commands.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from seqopt.contact.mortar import MORTARS, Mortar, _find_curing, find_mortar
from seqopt.engines.registry import ENGINES
from seqopt.errors import FileError, ProblemError, SceneError, StepError, did_you_mean
from seqopt.graph.formulation import formulation_names
from seqopt.problem.requirements import number_word
from seqopt.problem.standing import Standing
from seqopt.scene._checks import short
from seqopt.scene.parts import Prop
from seqopt.scene.scenarios import MOST
from seqopt.scene.scene import Scene, in_order
from seqopt.scene.scene_file import builtin_scenes, load_scene
from seqopt.sequence.methods import METHODS, SCHEDULES
from seqopt.sequence.rules import with_robots
from seqopt.stability.assessment import MARGINS
from seqopt.study.published import CRITERIA, PUBLISHED
from seqopt.workflow import Part, Robust, Search

File: TypeAlias = Annotated[Path | None, ("value", "FILE")]
Folder: TypeAlias = Annotated[Path | None, ("value", "DIR")]

MOST_WORKERS = 1024
QUESTIONS = {
    "What is built, and by whom?": "scene folder list export order grips props payload "
    "durations robots",
    "Which steps may a build have?": "schedule method plan begin to direction rules reassign",
    "What has changed?": "at lost missing measured",
    "What counts as best?": "criterion aim rounding speed reference",
    "What must hold?": "stands friction tilt curing limits budgets",
    "What is asked beside verdicts?": "margins map holds",
    "In which scenarios is it good?": "measure count seed vary",
    "Who chooses and proves, and how long?": "formulation candidates options proof time_limit "
    "workers max_memory",
    "How are responses computed?": "engine mortar tolerance cache",
    "What does the file not say?": "unit up density supports",
    "Which joints are made?": "stiffness gap accept_overlaps",
    "What is written and printed?": "out name below figures stability quiet json",
}
"""Options by the question that they answer, in the order in which help asks them."""
PROPS = "give nodes, as 13,27, or every; then as 13:1e6 (N/m), and after a comma push, capacity=300"
FLAGS = {
    "begin": "from",
    "budgets": "budget",
    "count": "scenarios",
    "criterion": "criteria",
    "limits": "limit",
    "measure": "robust",
    "options": "option",
    "rounding": "round",
    "rules": "rule",
}  # words for options that are not their names
VALUES = dict(
    re.findall(
        r"(\w+)=(\S+)",
        """
        grips=STIFFNESS props=NODES payload=NEWTON durations=WORDS curing=WORDS robots=N|NAME,NAME
        criterion=NAME formulation=NAME name=NAME format=NAME margins=NAMES holds=NAMES
        aim=NAME,NAME rules=NAME=VALUE vary=NAME=VALUE options=NAME=VALUE over=NAME=VALUES
        rounding=NAME=STEP limits=LIMIT budgets=BUDGET stands=MORTAR friction=F tilt=DEG
        schedule=NAME|FILE begin=PLAN:STEP|N
        to=PLAN:STEP|N direction=build|take-down measure=AIM count=N seed=N workers=N
        candidates=RULE time_limit=SECONDS max_memory=SIZE plan=FILE source=FILE bound=FILE
        cache=DIR at=STEP lost=ROBOT missing=BRICK
        """,
    )
)
"""Words for the values of options, if not their names."""
HOW: dict[str, dict[str, Any]] = {
    "engine": {"choices": lambda: ENGINES},
    "method": {"choices": (*METHODS, PUBLISHED)},
    "friction": {"zero": True},
    "tilt": {"zero": True},
    "robots": {"parse": lambda text: int(text) if text.isdecimal() else named(text)},
    "time_limit": {"zero": True},
    "count": {"most": MOST},
    "seed": {"least": 0, "most": MOST},
    "scene": {"names": builtin_scenes},
    "schedule": {"names": lambda: SCHEDULES},
    "criterion": {"names": lambda: CRITERIA},
    "formulation": {"names": formulation_names},
    "margins": {"names": lambda: MARGINS},
}  # what a parser knows of options beside their types; names are what help lists
HIDDEN = ("also", "executor", "made_by", "scenes")  # that Python alone says


@dataclass(frozen=True, kw_only=True)
class Built:
    """A scene, and what is other than it says.

    Parameters
    ----------
    scene : str
        A built-in scene, a JSON file, a plan's folder, or words as arch:span=2,rise=0.8 (default:
        arch25); seqopt scene --list shows all.
    order : str
        In which order bricks are placed, if not in the scene's own: reversed, ends (from all ground
        ends at once), or the names of all bricks, as 1..12,25..13.
    grips : float or str
        How stiff the grips of all robots are, if not as the scene says: rigid, or N/m, as 1e6, or
        three along its axes, as 1e6x1e6x5e5; turning=N m/rad after a comma keeps held bricks from
        turning.
    props : str
        Nodes that props hold beside the robots, if not as the scene says, until the finished
        structure is let go: as 13,27, or every, one at each brick as centering has; N/m after a
        colon if they are not rigid, as every:1e6; then push for such as only push up, and
        capacity=N.
    payload : float or str
        What every robot may carry, N, if not as the scene says; of one robot with its name before,
        as rob1=250.
    durations : sequence of str
        How long robots take, s: fetch=30,place=10,approach=10,grip=5,release=5 or speed=0.2 (m/s,
        of ways between grips); that is to bring the next brick, to place it, to come to one that
        stands, to grip it, to let go; who is free fetches and approaches while others act; of one
        robot with its name before, as rob3:fetch=75 (default: as the scene says).
    """

    scene: Any = "arch25"
    order: str | None = None
    grips: str | None = None
    props: str | None = None
    payload: Sequence[str] = ()
    durations: Sequence[str] = ()

    @property
    def folder(self) -> Path | None:
        """The folder of a plan that stands for its scene."""
        if isinstance(self.scene, Scene) or not (path := Path(self.scene)).is_dir():
            return None
        for name in ("scene.json", "plan.csv"):
            if not (path / name).is_file():
                raise FileError(f"{path}: it has no {name}; give a folder of seqopt optimize --out")
        return path

    def parse(self, robots: int | Sequence[str] | None = None) -> Scene:
        """Return the scene; ``robots``: how many there are, or names, which change nothing."""
        folder, scene = self.folder, self.scene
        if not isinstance(scene, Scene):
            scene = load_scene(scene if folder is None else folder / "scene.json")
        scene = in_order(scene, self.order)
        for text in self.payload:
            scene = with_payload(text, scene)
        if isinstance(robots, int):
            scene = with_robots(scene, robots)
        if self.props is not None:
            scene = scene.with_props(*parse_props(self.props, scene))
        scene = scene if self.grips is None else with_grips(self.grips, scene)
        return in_seconds(scene, self.durations)


ARCH25 = Built()


def named(text: str) -> tuple[str, ...]:
    """Return names with commas between them."""
    return tuple(name.strip() for name in text.split(","))


def in_seconds(scene: Scene, durations: Sequence[str]) -> Scene:
    """Return a scene with durations, if any."""
    try:
        return scene.with_durations(*durations) if durations else scene
    except SceneError as error:
        raise SceneError(f"--{error}") from None


@dataclass(frozen=True, kw_only=True)
class Stands:
    """The demand that every state stands.

    Parameters
    ----------
    stands : str
        Every state must be proven to stand, robots within payload: dry, epoxy or bond=STRENGTH
        (Pa).
    friction : float
        With ``stands``: coefficient of friction.
    tilt : float
        With ``stands``: tilt that every state must survive.
    curing : sequence of str
        With ``stands``: which share of its bond mortar has at an age: 15min (in proportion, full
        then), 0s=0.005,5min=0.4,15min=1 (what is reached when), never.
        What is let go waits for it (default: full at once).
    """

    stands: str | None = None
    friction: float | None = None
    tilt: float | None = None
    curing: Sequence[str] = ()

    def parse(self) -> Standing | None:
        """Return the requirement of stability, None if there is none."""
        said = {"tilt": self.tilt, "friction": self.friction, "curing": self.curing}
        names = [name for name, value in said.items() if value not in (None, ())]
        if self.stands is None:
            if names:
                raise ProblemError(f"--{names[0]}: it goes with --stands; give --stands dry, say")
            return None
        mortar = parse_mortar(self.stands, "--stands")
        mortar = mortar if self.friction is None else replace(mortar, friction=self.friction)
        try:
            cures = _find_curing(" ".join(self.curing)) if self.curing else None
        except SceneError as error:
            raise ProblemError(f"--{error}") from error
        return Standing(mortar, radians(self.tilt or 0.0), cures)


def parse_count(text: str, where: str, most: int, least: int = 1) -> int:
    """Parse an integer within bounds; ``where``: argument, for messages."""
    if not (text.isascii() and text.isdecimal()) or not least <= int(text[:12]) <= most:
        raise ProblemError(f"{where} {text}: give a whole number from {least} to {most}")
    return int(text)


def with_payload(text: str, scene: Scene) -> Scene:
    """Return a scene with payloads from words: ``250``, N each, or ``rob1=250``."""
    name, equals, value = text.rpartition("=")
    names = [robot.name for robot in scene.robots]
    if equals and name not in names:
        hint = did_you_mean(name, names)
        raise StepError(f"--payload {text}{hint}: give ROBOT=NEWTON, of {', '.join(names)}")
    most = number_word(value, f"--payload {text}")
    said = (replace(r, payload=most) if name in ("", r.name) else r for r in scene.robots)
    return scene.with_robots(*said)


def with_grips(grips: str, scene: Scene) -> Scene:
    """Return a scene with grip stiffness from a word: ``rigid``, ``1e6`` or ``1e6x1e6x5e5``, N/m.

    ``turning=1e4`` after a comma is the rotational stiffness.
    """
    where = f"--grips {short(grips)[1:-1]}"
    shift, comma, rest = grips.partition(",")
    turning = rest.removeprefix("turning=")
    if comma and (turning == rest or "," in rest):
        raise SceneError(f"{where}: give a stiffness, and after a comma turning=STIFFNESS")
    ways: list[Any] = []
    for word in (shift, turning):
        try:
            numbers = [] if word in ("", "rigid") else [float(one) for one in word.split("x")]
        except ValueError:
            said = f"{word!r} is no stiffness; give rigid, 1e6 or 1e6x1e6x5e5"
            raise SceneError(f"{where}: {said}") from None
        ways.append(None if not numbers else numbers[0] if len(numbers) == 1 else tuple(numbers))
    try:
        return scene.with_grips(*ways)
    except SceneError as error:
        raise SceneError(f"{where}: {str(error).partition(': ')[2]}") from None


def parse_mortar(text: str, where: str) -> Mortar:
    """Parse a mortar; ``where``: argument, for messages."""
    try:
        return find_mortar(text)
    except SceneError as error:
        hint = did_you_mean(text.partition("=")[0], (*MORTARS, "bond"))
        known = f"give {', '.join(MORTARS)}, or bond=STRENGTH (Pa), zero or more"
        raise ProblemError(f"{where} {text}{hint}: {known}") from error


def parse_props(text: str, scene: Scene) -> tuple[Prop, ...]:
    """Parse props, as ``13,27:1e6,push,capacity=300`` or ``every:1e6``.

    ``every`` is a node of each brick; ``push`` and ``capacity`` are of all that are named.
    """
    props, common = list[Prop](), dict[str, object]()
    where = f"--props {short(text)[1:-1]}"
    for word in text.split(","):
        name, equals, value = word.strip().partition("=")
        if name == "capacity" and equals:
            common["capacity"] = number_word(value, where)
        elif word.strip() == "push":
            common["direction"] = scene.up
        else:
            props += _placed(word.strip(), scene, where)
    try:
        scene.with_props(*props)
        return tuple(replace(prop, **common) for prop in props)  # type: ignore[arg-type]
    except SceneError as error:
        raise SceneError(f"{where}: {error}") from error


def _placed(word: str, scene: Scene, where: str) -> Sequence[Prop]:
    place, colon, stiffness = word.partition(":")
    own = number_word(stiffness, where) if colon else None
    if place == "every":
        return scene.with_centering(own).props
    if not (place.isascii() and place.isdecimal()):
        hint = did_you_mean(place, ("every", "push"))
        raise SceneError(f"{where}: {place!r} is no node{hint}; {PROPS}")
    return [Prop(node=int(place), stiffness=own)]


SPREAD: dict[str, type] = {
    "scene": Built,
    "schedule": Part,
    "stands": Stands,
    "robust": Robust,
    "search": Search,
}
"""By parameter, the class of a value that several words make."""
