"""Fewer candidates: only those near the working end, for builds too large to examine all.

The working end is where the two bricks are that were placed last. What is left out is not looked
at, so that whatever is found among the rest is a heuristic for the whole, however it is found.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

import networkx as nx

from seqopt.errors import StepError, did_you_mean
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Move, Schedule

RULE = re.compile(r"(near|within):([0-9]+\.?[0-9]*|\.[0-9]+)")
NEWEST = 2  # bricks that make the working end: a build from both ends has two of them
Distance = Callable[[Scene, int], dict[int, float]]


def thin(schedule: Schedule, rule: str) -> Schedule:
    """Return a schedule with the candidates near the working end alone.

    Parameters
    ----------
    schedule : Schedule
    rule : str
        ``near:12`` keeps the nodes of bricks that at most 12 joints part from the bricks placed
        last, ``within:1.5`` the nodes at most 1.5 m from these bricks' centroids. Where a rule
        keeps none, the nearest stay.

    Returns
    -------
    Schedule
        That says what was left out; the same where nothing is.

    Raises
    ------
    StepError
        If there is no such rule.

    Examples
    --------
    >>> import seqopt
    >>> schedule = seqopt.three_robot_loop(seqopt.load_scene("arch25"))
    >>> thin(schedule, "near:3").left_out
    'near:3 keeps 173 of 492 candidates'
    """
    found = RULE.fullmatch(rule.strip()) if isinstance(rule, str) else None
    if found is None:
        hint = did_you_mean(str(rule).partition(":")[0], ("near", "within"))
        raise StepError(f"candidates {rule!r}{hint}: give near:JOINTS or within:METERS, as near:12")
    distance = _joints_away if found[1] == "near" else _meters_away
    most, scene = float(found[2]), schedule.scene
    moves = tuple(_thinned(move, distance(scene, move.bricks), most) for move in schedule.moves)
    kept, all_ = (sum(len(m.candidates) for m in some) for some in (moves, schedule.moves))
    if kept == all_:
        return schedule
    said = f"{found[0]} keeps {kept:,} of {all_:,} candidates"
    return replace(schedule, moves=moves, left_out=said)


def _thinned(move: Move, away: dict[int, float], most: float) -> Move:
    """Return a move with the candidates that are near, or the nearest."""
    limit = max(most, min(away.get(node, math.inf) for node in move.candidates))
    near = tuple(node for node in move.candidates if away.get(node, math.inf) <= limit)
    return replace(move, candidates=near)


def _joints_away(scene: Scene, bricks: int) -> dict[int, float]:
    """Return how many joints part the nodes of placed bricks from the newest."""
    placed = scene.placed[:bricks]
    names = {brick.name for brick in placed}
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(names)
    graph.add_edges_from(joint.bricks for joint in scene.joints if names.issuperset(joint.bricks))
    newest = {brick.name for brick in placed[-NEWEST:]}
    away = nx.multi_source_dijkstra_path_length(graph, newest)
    return {n: float(away.get(b.name, math.inf)) for b in placed for n in b.nodes}


def _meters_away(scene: Scene, bricks: int) -> dict[int, float]:
    """Return how far the nodes of placed bricks are from the centroids of the newest, m."""
    placed = scene.placed[:bricks]
    ends = [brick.position for brick in placed[-NEWEST:]]
    return {
        n: min(math.dist(b.node_position(n), end) for end in ends) for b in placed for n in b.nodes
    }
