"""Which nodes are near the working end of a build: a rule in words, to look at fewer of them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import networkx as nx

from seqopt.errors import StepError, did_you_mean
from seqopt.scene.scene import Scene

_RULE = re.compile(r"(near|within):([0-9]+\.?[0-9]*|\.[0-9]+)")
_NEWEST = 2  # bricks that make the working end: a build from both ends has two of them


@dataclass(frozen=True)
class Near:
    """A rule that keeps nodes near the working end of a build.

    ``rule``: ``near:12`` keeps the nodes of bricks that at most 12 joints part from the bricks
    placed last, ``within:1.5`` the nodes at most 1.5 m from these bricks' centroids. Raises
    `StepError` if there is no such rule.
    """

    rule: str

    def __post_init__(self) -> None:
        text = self.rule.strip() if isinstance(self.rule, str) else ""
        if _RULE.fullmatch(text) is None:
            hint = did_you_mean(str(self.rule).partition(":")[0], ("near", "within"))
            raise StepError(
                f"candidates {self.rule!r}{hint}: give near:JOINTS or within:METERS, as near:12"
            )
        object.__setattr__(self, "rule", text)

    def nodes(self, scene: Scene, bricks: int, nodes: Sequence[int]) -> tuple[int, ...]:
        """Return those of some nodes that are near with so many bricks, or the nearest of them."""
        if not nodes:
            return ()
        name, _, most = self.rule.partition(":")
        away = (_joints_away if name == "near" else _meters_away)(scene, bricks)
        limit = max(float(most), min(away.get(n, math.inf) for n in nodes))
        return tuple(node for node in nodes if away.get(node, math.inf) <= limit)


def _joints_away(scene: Scene, bricks: int) -> dict[int, float]:
    """Return how many joints part the nodes of placed bricks from the newest."""
    placed = scene.placed[:bricks]
    names = {brick.name for brick in placed}
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(names)
    graph.add_edges_from(joint.bricks for joint in scene.joints if names.issuperset(joint.bricks))
    newest = {brick.name for brick in placed[-_NEWEST:]}
    away = nx.multi_source_dijkstra_path_length(graph, newest)
    return {n: float(away.get(b.name, math.inf)) for b in placed for n in b.nodes}


def _meters_away(scene: Scene, bricks: int) -> dict[int, float]:
    """Return how far the nodes of placed bricks are from the centroids of the newest, m."""
    placed = scene.placed[:bricks]
    ends = [brick.position for brick in placed[-_NEWEST:]]
    return {
        n: min(math.dist(b.node_position(n), end) for end in ends) for b in placed for n in b.nodes
    }
