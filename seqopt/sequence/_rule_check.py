"""A second implementation of the rules of holding, placing and carrying, for the judge.

It is independent of `seqopt.sequence._rule_space`, whose results it checks: the moves of
`seqopt.judge._rule_moves` follow from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot

from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.scene._armed import reachable
from seqopt.scene.scene import Scene
from seqopt.sequence.methods import placing_node
from seqopt.sequence.rules import FreeRules, Newest, Payload
from seqopt.sequence.steps import AnyStep, Grips, Site, Step, StepKind


def too_heavy(scenes: Sequence[Scene], place: int, robots: Sequence[int]) -> str:
    """Describe the robots that cannot carry a brick and their tool in a scene; or empty.

    ``place``: index of the brick in build order, may be negative.
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
    """Return the steps whose robot cannot carry its brick in some scene: reasons by number.

    ``steps``: checked, may have open grips; ``begin``: where they begin.
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


def check_carried(scene: Scene, steps: Sequence[Step], worlds: tuple[Scene, ...] = ()) -> None:
    """Require that robots can carry the bricks that they place or remove, also in scenarios."""
    for number, why in unbearable((scene, *worlds), steps, None).items():
        raise StepError(f"step {number}: {why}")


@dataclass(frozen=True)
class RuleBook:
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
        return too_heavy((self.network.scene, *self.worlds), bricks - 1, robots)

    def places(self, robot: int, bricks: int) -> bool:
        """Return whether a robot may place or remove the newest brick."""
        return self.named(robot) and not self.too_heavy(bricks, (robot,))
