"""The rules of a free schedule, one state after the other, in plain words.

A second route to what `seqopt.sequence._rule_space` does for many states at a time: it shares
nothing with it, and judges what was found there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot

from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.scene._armed import reachable
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import Ending, FreeRules, Newest, Payload
from seqopt.sequence.schedule import Schedule, islands
from seqopt.sequence.site import Site
from seqopt.sequence.steps import AnyStep, Grips, Step, StepKind
from seqopt.sequence.two_robots import placing_node


def too_heavy(scenes: Sequence[Scene], place: int, robots: Sequence[int]) -> str:
    """Return which robots cannot bear a brick and their tool by themselves in a scene; or nothing.

    ``place``: of the brick in build order, from 0, or from the end.
    """
    for scene in scenes:
        brick, pull = scene.placed[place], hypot(*scene.gravity) * scene.weight_factor
        weak = []
        for robot in (scene.robots[r] for r in robots):
            tool = 0.0 if robot.arm is None else robot.arm.tool_mass * pull
            if brick.mass * pull + tool > robot.payload * (1 + 1e-9):
                beside = f", its tool weighs {tool:.1f} N" if tool else ""
                weak.append(f"{robot.name} ({robot.payload:g} N{beside})")
        if weak:
            weight = f"brick {brick.name} weighs {brick.mass * pull:.1f} N"
            return f"{weight}, more than the payload of {', '.join(weak)}"
    return ""


def unbearable(
    scenes: Sequence[Scene], steps: Sequence[AnyStep], begin: Site | None
) -> dict[int, str]:
    """Return in which steps who carries a brick cannot bear it in some scene: why, by number.

    ``steps``: checked, some of their grips perhaps open; ``begin``: where they begin.
    """
    out: dict[int, str] = {}
    before: tuple[object, ...] = (None,) * len(scenes[0].robots)
    before = before if begin is None else begin.holds(scenes[0])
    for step in steps:
        moves = {StepKind.PLACE: -1, StepKind.REMOVE: 0}  # where the brick is among those placed
        changed = [
            r for r, pair in enumerate(zip(before, step.grips, strict=True)) if len({*pair}) > 1
        ]
        if step.kind in moves and (
            why := too_heavy(scenes, step.bricks + moves[step.kind], changed)
        ):
            out[step.number] = why
        before = step.grips
    return out


def check_carried(
    scene: Scene, schedule: Schedule, steps: Sequence[Step], worlds: tuple[Scene, ...] = ()
) -> None:
    """Require that robots bear the bricks that they place or take away, in scenarios as well."""
    for number, why in unbearable((scene, *worlds), steps, schedule.begin).items():
        raise StepError(f"step {number}: {why}")


@dataclass(frozen=True)
class RuleBook:
    """The rules of a free schedule in a scene.

    ``worlds``: the scenes of scenarios, in which bricks weigh more.
    """

    network: Network
    rules: FreeRules
    worlds: tuple[Scene, ...] = ()

    @cached_property
    def team(self) -> tuple[int, ...]:
        """Indices of the robots that take part."""
        return self.rules.team(self.network.scene)

    @cached_property
    def span(self) -> tuple[int, int]:
        """How many bricks stand where the build begins, and where it ends."""
        return self.rules.span(self.network.scene)

    @property
    def start(self) -> tuple[int, Grips, int]:
        """Bricks, grips, and regrips since the last brick, where the build begins."""
        site = self.rules.begun(self.network.scene).begin
        if site is None:
            return 0, (None,) * len(self.network.scene.robots), 0
        return site.bricks, site.holds(self.network.scene), site.regrips

    @cached_property
    def reached(self) -> dict[tuple[int, int], tuple[int, ...]]:
        """By robot and brick count, the nodes that it may hold."""
        scene = self.network.scene
        counts = range(len(scene.placed) + 1)
        return {(r, b): reachable(scene, scene.robots[r], b) for r in self.team for b in counts}

    @cached_property
    def takes(self) -> dict[tuple[int, int], tuple[int, ...]]:
        """By robot and brick count, the nodes of bricks that stand that it may take hold of."""
        scene = self.network.scene
        near = [self.rules.near(scene, b) for b in range(len(scene.placed) + 1)]
        return {at: tuple(n for n in own if n in near[at[1]]) for at, own in self.reached.items()}

    @cached_property
    def newest_nodes(self) -> dict[tuple[int, int], tuple[int, ...]]:
        """By robot and brick count, at which nodes it holds the newest brick."""
        scene, out = self.network.scene, {}
        for r in self.team:
            for b, brick in enumerate(scene.placed, start=1):
                nodes = tuple(node for node in brick.nodes if node in self.reached[r, b])
                if self.rules.newest is Newest.PLACING and nodes:
                    nodes = (placing_node(self.network, scene.robots[r], brick),)
                out[r, b] = nodes
        return out

    def named(self, robot: int) -> bool:
        """Return whether a robot is one of those that may place or take away bricks."""
        return not self.rules.placers or self.network.scene.robots[robot].name in self.rules.placers

    def too_heavy(self, bricks: int, robots: Sequence[int]) -> str:
        """Return which robots cannot bear the newest brick in a scenario, in words; or nothing."""
        if self.rules.payload is Payload.IGNORED:
            return ""
        return too_heavy((self.network.scene, *self.worlds), bricks - 1, robots)

    def places(self, robot: int, bricks: int) -> bool:
        """Return whether a robot may place the newest brick, or take it away."""
        return self.named(robot) and not self.too_heavy(bricks, (robot,))

    @cached_property
    def _islands(self) -> dict[int, tuple[frozenset[int], ...]]:
        counts = range(1, len(self.network.scene.placed) + 1)
        return {b: islands(self.network, b) for b in counts}

    def fault(self, bricks: int, grips: Grips) -> str:
        """Return which rule a state breaks, in a few words, the ending aside; empty if none."""
        if not bricks:
            return ""
        scene = self.network.scene
        stand = {brick.name for brick in scene.placed[:bricks]}
        if len(stand) == len(scene.placed) and all(node is None for node in grips):
            stand.clear()  # props are struck
        propped = [n for p in scene.props if (n := scene.brick_of_node[p.node].name) in stand]
        held = [scene.brick_of_node[node].name for node in grips if node is not None] + propped
        if bricks > 1 and len(held) < (least := self.rules.fewest_grips(scene)):
            return f"{len(held)} grips, fewer than least_grips={least}"
        on = any(grips[r] in self.newest_nodes[r, bricks] for r in self.team)
        on |= bricks > 0 and scene.placed[bricks - 1].name in propped
        if not on and self.rules.newest is not Newest.FREE:
            return f"nobody holds the newest brick (newest={self.rules.newest.value})"
        if any(not {*held} & island for island in self._islands[bricks]):
            return "a part that no joint ties to the ground is held by nobody"
        return ""

    def follow(
        self, bricks: int, grips: Grips, regrips: int
    ) -> Iterator[tuple[StepKind, int, Grips, int]]:
        """Yield every step that is possible from a state; regrips count since the last brick."""
        first, last = self.span
        keeps = bricks > 0 and not self.fault(bricks, grips)
        told = self.rules.begin is not None or self.rules.takes_down
        letting_go = bricks == last and self.rules.how_it_ends is Ending.ONE_BY_ONE
        begins = told and 0 < bricks == first and not letting_go
        able = keeps or begins  # what stands at first need not keep rules, and may be held
        if able and (self.rules.regrips is None or regrips < self.rules.regrips):
            for after in self._held(bricks, grips):
                yield StepKind.REPOSITION, bricks, after, regrips + 1
        for after in self._released(bricks, grips):
            yield StepKind.RELEASE, bricks, after, regrips
        if bricks > last and keeps and self.rules.takes_down:
            for after in self._removed(bricks, grips):
                yield StepKind.REMOVE, bricks - 1, after, 0
        if bricks < last and (keeps or not bricks):
            for after in self._placed(bricks + 1, grips):
                yield StepKind.PLACE, bricks + 1, after, 0

    def _held(self, bricks: int, grips: Grips) -> Iterator[Grips]:
        """Yield the grips after one more is taken, which breaks no rule."""
        for robot in self.team:
            for node in self.takes[robot, bricks] if grips[robot] is None else ():
                if node not in grips:
                    yield _with(grips, robot, node)

    def _released(self, bricks: int, grips: Grips) -> Iterator[Grips]:
        """Yield the grips after one is let go, or at the end all."""
        ends, ending = bricks == self.span[1], self.rules.how_it_ends
        letting_go = ends and ending is Ending.ONE_BY_ONE
        for robot in self.team:
            if grips[robot] is not None:
                after = _with(grips, robot, None)
                if letting_go or not self.fault(bricks, after):
                    yield after
        if ends and ending is Ending.RELEASED and any(n is not None for n in grips):
            yield (None,) * len(grips)

    def _placed(self, bricks: int, grips: Grips) -> Iterator[Grips]:
        """Yield the grips after the next brick is placed."""
        for robot in self.team:
            able = grips[robot] is None and self.places(robot, bricks)
            for node in self.newest_nodes[robot, bricks] if able else ():
                after = _with(grips, robot, node)
                if not self.fault(bricks, after):
                    yield after

    def _removed(self, bricks: int, grips: Grips) -> Iterator[Grips]:
        """Yield the grips after the newest brick is taken away by who alone holds it."""
        scene = self.network.scene
        newest = scene.placed[bricks - 1]
        holders = [robot for robot, node in enumerate(grips) if node in newest.nodes]
        if len(holders) != 1:
            return
        robot = holders[0]
        after = _with(grips, robot, None)
        able = self.places(robot, bricks)
        allowed = able and grips[robot] in self.newest_nodes[robot, bricks]
        if allowed and not self.fault(bricks - 1, after):
            yield after

    def ends(self, bricks: int, grips: Grips) -> bool:
        """Return whether a state ends the build."""
        if bricks != self.span[1]:
            return False
        if self.rules.how_it_ends is not Ending.HELD:
            return all(node is None for node in grips)
        if self.rules.finish is None or self.rules.finish.grips is None:
            return not self.fault(bricks, grips)
        return self._holding(grips) == self._holding(self.rules.finish.grips)

    def _holding(self, grips: Grips) -> dict[int, object]:
        """Return what kind of robot holds each node: robots that are alike could change places."""
        placers = self.rules.placers
        pairs = zip(self.network.scene.robots, grips, strict=True)
        return {
            node: (replace(robot, name="-"), not placers or robot.name in placers)
            for robot, node in pairs
            if node is not None
        }


def check_free(
    network: Network, rules: FreeRules, steps: Sequence[Step], worlds: tuple[Scene, ...] = ()
) -> None:
    """Require that a checked sequence keeps the rules of a free schedule, forces of grips aside."""
    book = RuleBook(network, rules, worlds)
    state, heavy = book.start, dict[int, str]()
    if rules.payload is Payload.KEPT:
        heavy = unbearable((network.scene, *worlds), steps, rules.begun(network.scene).begin)
    for step in steps:
        if step.number in heavy:
            raise StepError(f"step {step.number} ({step.kind.value}): {heavy[step.number]}")
        found = [
            (bricks, grips, regrips)
            for kind, bricks, grips, regrips in book.follow(*state)
            if (kind, bricks, grips) == (step.kind, step.bricks, step.grips)
        ]
        if not found:
            why = book.fault(step.bricks, step.grips) or "no rule allows it after the one before"
            raise StepError(f"step {step.number} ({step.kind.value}) of a free schedule: {why}")
        state = found[0]
    if not book.ends(*state[:2]):
        raise StepError(
            f"step {len(steps)}: the build does not end there (ending={rules.ending.value})"
        )


def _with(grips: Grips, robot: int, node: int | None) -> Grips:
    return (*grips[:robot], node, *grips[robot + 1 :])
