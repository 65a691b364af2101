"""Rules of the free schedule: any robot may release, hold or place next, as far as these allow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from numbers import Integral
from typing import ClassVar

import numpy as np

from seqopt.arrays import Bools, Ints
from seqopt.errors import ProblemError, StepError, did_you_mean
from seqopt.network.network import Network
from seqopt.scene._checks import settle, short
from seqopt.scene.scene import MOST_ROBOTS, Scene, _hang_free, _reachable, _too_heavy
from seqopt.sequence.methods import placing_node
from seqopt.sequence.schedule import Move, OpenStep, _near_nodes, islands, near_rule
from seqopt.sequence.steps import AnyStep, Grips, Site, Step, StepKind

FREE = "free"  # the schedule that is no list of steps


class Newest(Enum):
    """At which nodes the newest brick is held until the next one is placed."""

    EITHER = "either"  # at either of its free nodes
    PLACING = "placing"  # at the node at which its holder would place it
    FREE = "free"  # it is placed at either node, and may be let go at once


class Payload(Enum):
    """Whether the force of a grip may exceed the payload of its robot."""

    KEPT = "kept"
    IGNORED = "ignored"


class Direction(Enum):
    """Whether bricks are placed, or removed, the newest first."""

    BUILD = "build"
    TAKE_DOWN = "take-down"


class Ending(Enum):
    """How the build ends."""

    HELD = "held"  # with the last brick placed, and held
    RELEASED = "released"  # all robots let go at once
    ONE_BY_ONE = "one-by-one"  # one robot lets go after the other


@dataclass(frozen=True, kw_only=True)
class FreeRules:
    """The rules of a free schedule, in addition to reach and one robot per node.

    Parameters
    ----------
    robots : tuple of str
        Names of the robots that take part, one to five; by default all of the scene.
    placers : tuple of str
        Names of the robots that may place a brick; by default all that take part.
    least_grips : int or None
        Least number of nodes held, from the second brick on, by robots and props together; by
        default 2, or all robots that take part but one, if those are fewer: it places the next.
    newest : Newest or str
        Where the newest brick is held, unless a prop holds it.
    payload : Payload or str
        Whether payloads are kept: by every grip, and by the brick that a robot places or takes
        away, which it carries by itself, with its tool.
    regrips : int or None
        Most grips taken between two bricks, besides those that place; by default any number.
    ending : Ending or str
        How the build ends. One by one: with all bricks robots may release against the rules,
        and once a state violates them, only release; also if a build begins in such a state.
    candidates : str
        At which nodes placed bricks may be gripped: ``near:6``, as of
        `seqopt.sequence.schedule.thin`; by default wherever robots reach.
    begin : Site or None
        Where the build begins; by default with the empty site. This state need not keep rules or
        limits; until rules are kept for the first time, robots may only take grips, except where
        releases one by one have begun (see ``ending``).
    finish : Site or None
        Where it ends: with so many bricks, and grips, or as ``ending`` says; by default with all
        bricks. Robots of one kind may have changed places.
    direction : Direction or str
        Whether bricks are placed, or removed, the newest first, each by the only robot that holds
        it, at a node of the rule ``newest``. A take-down begins by default with all bricks and no
        grips, and ends with the empty site; states keep the same rules.

    Raises
    ------
    StepError
        If a rule is malformed; the message gives its value and what would be accepted.

    Examples
    --------
    >>> FreeRules(newest="placing").newest
    <Newest.PLACING: 'placing'>
    """

    robots: tuple[str, ...] = ()
    placers: tuple[str, ...] = ()
    least_grips: int | None = None
    newest: Newest = Newest.EITHER
    payload: Payload = Payload.KEPT
    regrips: int | None = None
    ending: Ending = Ending.RELEASED
    candidates: str = ""
    begin: Site | None = None
    finish: Site | None = None
    direction: Direction = Direction.BUILD

    def __post_init__(self) -> None:
        for name, kind in _CHOICES.items():
            given, known = getattr(self, name), [str(member.value) for member in kind]
            if given not in (*kind, *known):
                hint = did_you_mean(given, known)
                raise StepError(
                    f"rule {name}: {short(given)}{hint}; give one of {', '.join(known)}"
                )
            settle(self, **{name: kind(given)})
        for name in ("robots", "placers"):
            given = getattr(self, name)
            names = (given,) if isinstance(given, str) else given
            if not isinstance(names, tuple | list) or not all(isinstance(n, str) for n in names):
                raise StepError(f"rule {name}: {short(given)}; give names of robots")
            if twice := [n for n in names if names.count(n) > 1]:
                raise StepError(f"rule {name}: {twice[0]} occurs twice; name it once")
            settle(self, **{name: tuple(names)})
        for name in _COUNTS:
            count = getattr(self, name)
            whole = isinstance(count, Integral) and not isinstance(count, bool) and int(count) >= 0
            if not (count is None or whole):
                raise StepError(f"rule {name}: {short(count)}; give a whole number from 0 on")
            settle(self, **{name: None if count is None else int(count)})
        for name in ("begin", "finish"):
            if not isinstance(getattr(self, name), Site | None):
                raise StepError(f"rule {name}: {short(getattr(self, name))}; give a seqopt.Site")
        if self.candidates:
            settle(self, candidates=near_rule(self.candidates))

    def span(self, scene: Scene) -> tuple[int, int]:
        """Return the brick counts at the beginning and at the end of the build."""
        first, last = 0, len(scene.placed)
        if self.takes_down:
            first, last = last, first
        if self.begin is not None:
            held, first = self.begin.holds(scene), self.begin.bricks
            for i, node in enumerate(held):
                if node is not None and i not in self.team(scene):
                    raise StepError(
                        f"robot {scene.robots[i].name} holds node {node} where the build begins; "
                        "let it take part, or let it go first"
                    )
        if self.finish is not None:
            self.finish.holds(scene)
            last = self.finish.bricks
        if self.takes_down and last >= first:
            raise StepError(f"a take-down from {first} bricks cannot end with {last}; give fewer")
        if not self.takes_down and not max(first, 1) <= last:
            raise StepError(f"a build from {first} bricks cannot end with {last}; give more")
        return first, last

    @property
    def takes_down(self) -> bool:
        """Whether bricks are removed."""
        return self.direction is Direction.TAKE_DOWN

    def free(self) -> FreeRules:
        """Return these rules: who asks for the moves of a schedule gets an error from that."""
        return self

    def keeps_payloads(self, *, stands: bool) -> bool:
        """Return whether robots hold no more than their payloads, also where nothing limits it.

        ``stands``: whether it is asked where states must stand.
        """
        return self.payload is Payload.KEPT

    def relaxed(self, scene: Scene) -> tuple[str, ...]:
        """Return the default rule that is relaxed because few robots take part, in words."""
        team, least = len(self.team(scene)), self.fewest_grips(scene)
        if self.least_grips is not None or least == _usual_grips(MOST_ROBOTS):
            return ()
        robots = "1 robot takes" if team == 1 else f"{team} robots take"
        return (f"least_grips={least}, as {robots} part",)

    def places(self, before: Ints, after: Ints) -> Bools:
        """Return which moves from levels to levels, (m,), place a brick."""
        return np.asarray(after > before)

    def in_scene(self, scene: Scene) -> FreeRules:
        """Return the rules in a scene: where a take-down begins, by default without grips."""
        if not self.takes_down or self.begin is not None:
            return self
        bare = Site(len(scene.placed), (None,) * len(scene.robots), step=0)
        return replace(self, begin=bare)

    @property
    def how_it_ends(self) -> Ending:
        """How the build ends, also if grips at its end are given."""
        if self.takes_down and (self.finish is None or not self.finish.bricks):
            return Ending.ONE_BY_ONE  # who removes the last brick lets go by that
        if self.finish is None or self.finish.grips is None:
            return self.ending
        bare = self.ending if self.ending is not Ending.HELD else Ending.RELEASED
        return Ending.HELD if self.finish.held else bare

    def near(self, scene: Scene, bricks: int) -> frozenset[int]:
        """Return the nodes of the placed bricks that may be gripped."""
        nodes = scene.placed_nodes[: 2 * bricks]
        if self.candidates and nodes:
            nodes = _near_nodes(self.candidates, scene, bricks, nodes)
        return frozenset(nodes)

    def team(self, scene: Scene) -> tuple[int, ...]:
        """Return the indices of the participating robots of a scene, ascending."""
        known = [robot.name for robot in scene.robots]
        for name in (*self.robots, *self.placers):
            if name not in known:
                hint = did_you_mean(name, known)
                raise StepError(
                    f"robot {name!r} does not exist{hint}; give some of {', '.join(known)}"
                )
        team = {name: i for i, name in enumerate(known) if name in self.robots or not self.robots}
        if not 1 <= len(team) <= MOST_ROBOTS:
            raise StepError(
                f"the free schedule: {len(team)} robots take part; name one to {MOST_ROBOTS}"
            )
        outside = [name for name in self.placers if name not in team]
        if outside:
            raise StepError(
                f"rule placers: {outside[0]} takes no part; name some of {', '.join(team)}"
            )
        most = len(team) + len(scene.props)
        if self.least_grips is not None and self.least_grips > most:
            beside = f" and {len(scene.props)} props" if scene.props else ""
            raise StepError(
                f"rule least_grips: {self.least_grips} grips of {len(team)} robots{beside}; "
                f"give at most {most}"
            )
        return tuple(team.values())

    def fewest_grips(self, scene: Scene) -> int:
        """Return the least number of grips, from the second brick on."""
        if self.least_grips is not None:
            return self.least_grips
        return _usual_grips(len(self.team(scene)))

    def described(self, scene: Scene) -> dict[str, object]:
        """Return the rules with their values, ready for JSON. Result: by name."""
        names = [scene.robots[i].name for i in self.team(scene)]
        sites = {"begin": self.begin, "finish": self.finish}
        return {
            "robots": names,
            "placers": list(self.placers) or names,
            "least_grips": self.fewest_grips(scene),
            "newest": self.newest.value,
            "payload": self.payload.value,
            "regrips": "any" if self.regrips is None else self.regrips,
            "ending": self.ending.value,
            "candidates": self.candidates or "all",
            **({"direction": self.direction.value} if self.takes_down else {}),
            **{name: site.described(scene) for name, site in sites.items() if site is not None},
        }

    method, has_pairs = FREE, False  # it is no list of steps with open grips
    steps: ClassVar[tuple[OpenStep, ...]] = ()
    moves: ClassVar[tuple[Move, ...]] = ()

    @property
    def left_out(self) -> str:
        """How candidates are restricted, in words; empty if they are not."""
        return self.candidates

    def names_robots(self, *, in_pairs: bool = False) -> bool:
        """Return whether states say which robot holds: not of those that are alike."""
        return False

    def chosen(self, steps: Sequence[Step]) -> tuple[int, ...]:
        """Raise a `ProblemError`: there are no moves to be chosen."""
        raise ProblemError(
            "the plan has no moves to show: it was chosen from states, which have no candidates; "
            "take its steps"
        )

    def letting_go(self, scene: Scene, steps: Sequence[Step]) -> int:
        """Return the number of last steps that release, with fewer grips than rules require."""
        if self.how_it_ends is Ending.HELD:
            return 0
        count = 0
        for step in reversed(steps):
            grips = len(step.held) + len(scene.standing_props(step.bricks, held=bool(step.held)))
            if step.kind is not StepKind.RELEASE or grips >= self.fewest_grips(scene):
                break
            count += 1
        return count

    def loosened(self, scene: Scene) -> Iterator[tuple[str, FreeRules]]:
        """Yield the rules with one of them relaxed, and its command-line words."""
        for least in range(self.fewest_grips(scene) - 1, -1, -1):
            yield f"least_grips={least}", replace(self, least_grips=least)
        if self.newest is Newest.PLACING:
            yield "newest=either", replace(self, newest=Newest.EITHER)
        if self.newest is not Newest.FREE:
            yield "newest=free", replace(self, newest=Newest.FREE)
        if self.regrips is not None:
            yield f"regrips={self.regrips + 1}", replace(self, regrips=self.regrips + 1)
        for name, value, word in _LOOSEST:
            if getattr(self, name) != value:
                yield f"{name}={word}", replace(self, **{name: value})  # type: ignore[arg-type]


_CHOICES: dict[str, type[Enum]] = {
    "newest": Newest,
    "payload": Payload,
    "ending": Ending,
    "direction": Direction,
}  # rules of which one of a few is chosen

_LOOSEST = (
    ("regrips", None, "any"),
    ("candidates", "", "all"),
    ("placers", (), "any"),
    ("payload", Payload.IGNORED, "ignored"),
    ("ending", Ending.HELD, "held"),
)  # rules that are loosened as a whole, and how a user says so


def _usual_grips(robots: int) -> int:
    """Return the default least number of grips: two, but one robot stays free to place."""
    return max(0, min(2, robots - 1))


_COUNTS = ("least_grips", "regrips")
RULES = ("newest", "payload", "ending", "placers", "candidates", *_COUNTS)
"""Names of rules in words."""


def parse_rules(given: FreeRules | str | Sequence[FreeRules | str]) -> FreeRules:
    """Parse rules from words, ``least_grips=1``, or return given ones."""
    several = given if isinstance(given, list | tuple) else (given,)
    if {*map(type, several)} - {str, FreeRules}:
        raise StepError(f"rules {short(given)}: give a seqopt.FreeRules, or as least_grips=1")
    found, loosest = FreeRules(), {(name, word): value for name, value, word in _LOOSEST}
    for each in several:
        if not isinstance(each, str):
            found = each
            continue
        name, _, text = each.partition("=")
        if name not in RULES:
            hint, known = did_you_mean(name, RULES), ", ".join(RULES)
            raise StepError(f"rules {each} does not exist{hint}; give one of {known}")
        value: object = int(text) if name in _COUNTS and text.isdecimal() else text
        if name == "placers":
            value = tuple(part.strip() for part in text.split(","))
        found = replace(found, **{name: loosest.get((name, text), value)})  # type: ignore[arg-type]
    return found


def _require_buildable(network: Network, rules: FreeRules) -> None:
    """Raise a `StepError` without robots, or where a brick hangs free once they have let go.

    Props hold on until the last brick of the scene is there.
    """
    scene, last = network.scene, rules.span(network.scene)[1]
    if not scene.robots:
        raise StepError(f"scene {scene.name}: it has no robots; give at least one")
    if rules.takes_down or rules.how_it_ends is Ending.HELD:
        return
    on = scene.brick_of_node
    kept = {on[p.node].name for p in scene.props if last < len(scene.bricks)}
    for island in [part for part in islands(network, last) if not part & kept][:1]:
        raise StepError(
            f"scene {scene.name}: {_hang_free(island)}; tie it, or let robots hold on at the end "
            "(--rule ending=held)"
        )


def _unbearable(
    scenes: Sequence[Scene], steps: Sequence[AnyStep], begin: Site | None
) -> dict[int, str]:
    """Return the steps whose robot cannot carry its brick in some scene: reasons by number.

    ``steps``: checked, may have open grips; ``begin``: where they begin.
    """
    out: dict[int, str] = {}
    before: tuple[object, ...] = (begin or Site(0)).holds(scenes[0])
    for step in steps:
        pairs = zip(before, step.grips, strict=True)
        changed = [robot for robot, (old, new) in enumerate(pairs) if old != new]
        if step.kind in (StepKind.PLACE, StepKind.REMOVE):
            brick = step.bricks - (step.kind is StepKind.PLACE)  # its index in build order
            if why := _too_heavy(scenes, brick, changed):
                out[step.number] = why
        before = step.grips
    return out


def _check_carried(scene: Scene, steps: Sequence[Step], worlds: tuple[Scene, ...] = ()) -> None:
    """Require that robots can carry the bricks that they place or remove, also in scenarios."""
    for number, why in _unbearable((scene, *worlds), steps, None).items():
        raise StepError(f"step {number}: {why}")


@dataclass(frozen=True)
class _RuleBook:
    """The rules of a free schedule in a scene.

    ``worlds``: the scenes of scenarios, with other weights.
    """

    network: Network
    rules: FreeRules
    worlds: tuple[Scene, ...] = ()

    @cached_property
    def team(self) -> tuple[int, ...]:
        """Indices of the participating robots."""
        return self.rules.team(self.network.scene)

    @cached_property
    def span(self) -> tuple[int, int]:
        """Brick counts at the beginning and at the end of the build."""
        return self.rules.span(self.network.scene)

    @property
    def start(self) -> tuple[int, Grips, int]:
        """Bricks, grips, and regrips since the last brick, at the beginning of the build."""
        site = self.rules.in_scene(self.network.scene).begin
        if site is None:
            return 0, (None,) * len(self.network.scene.robots), 0
        return site.bricks, site.holds(self.network.scene), site.regrips

    @cached_property
    def reached(self) -> dict[tuple[int, int], tuple[int, ...]]:
        """By robot and brick count, the nodes that it may hold."""
        scene = self.network.scene
        counts = range(len(scene.placed) + 1)
        return {(r, b): _reachable(scene, scene.robots[r], b) for r in self.team for b in counts}

    @cached_property
    def takes(self) -> dict[tuple[int, int], tuple[int, ...]]:
        """By robot and brick count, the nodes of placed bricks that it may grip."""
        scene = self.network.scene
        near = [self.rules.near(scene, b) for b in range(len(scene.placed) + 1)]
        return {at: tuple(n for n in own if n in near[at[1]]) for at, own in self.reached.items()}

    @cached_property
    def newest_nodes(self) -> dict[tuple[int, int], tuple[int, ...]]:
        """By robot and brick count, the nodes at which it may hold the newest brick."""
        scene, out = self.network.scene, {}
        for r in self.team:
            for b, brick in enumerate(scene.placed, start=1):
                nodes = tuple(node for node in brick.nodes if node in self.reached[r, b])
                if self.rules.newest is Newest.PLACING and nodes:
                    nodes = (placing_node(self.network, scene.robots[r], brick),)
                out[r, b] = nodes
        return out

    def named(self, robot: int) -> bool:
        """Return whether a robot is among those that may place or remove bricks."""
        return not self.rules.placers or self.network.scene.robots[robot].name in self.rules.placers

    def too_heavy(self, bricks: int, robots: Sequence[int]) -> str:
        """Describe the robots that cannot carry the newest brick in a scenario; or empty."""
        if self.rules.payload is Payload.IGNORED:
            return ""
        return _too_heavy((self.network.scene, *self.worlds), bricks - 1, robots)

    def places(self, robot: int, bricks: int) -> bool:
        """Return whether a robot may place or remove the newest brick."""
        return self.named(robot) and not self.too_heavy(bricks, (robot,))
