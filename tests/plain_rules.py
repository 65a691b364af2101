"""The rules of a free schedule in plain words, state by state, for tables to agree with."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

from seqopt.sequence.rules import Ending, Newest, _RuleBook
from seqopt.sequence.schedule import islands
from seqopt.sequence.steps import Grips, StepKind


class PlainBook(_RuleBook):
    """The second book of rules with all steps that follow from a state, one by one."""

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


def _with(grips: Grips, robot: int, node: int | None) -> Grips:
    return (*grips[:robot], node, *grips[robot + 1 :])
