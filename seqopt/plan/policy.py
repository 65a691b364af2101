"""The best next move from every state of a free schedule, as a table to look it up."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seqopt._archives import Archive
from seqopt._files import parse_json, read_bytes, write_bytes
from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import FileError, ProblemError, StepError
from seqopt.graph._explore import Explorer, Visited
from seqopt.graph.paths import _to_go
from seqopt.graph.states._visits import barred, explore
from seqopt.graph.states.states import States
from seqopt.judge._policy import check_policy
from seqopt.plan._infeasible import confirmed
from seqopt.plan.solving import states_of
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import LINEAR_RANGE
from seqopt.responses.table import OUTSIDE
from seqopt.scene._checks import short
from seqopt.sequence._robot_kinds import node_numbers
from seqopt.sequence.site import Site
from seqopt.sequence.steps import StepKind

FILE = "policy.npz"
FACTS = ("goals", "robots", "kinds", "checked", "keeps_range")
ARRAYS = ("order", "nodes", "bricks", "held", "values", "following")


class Advice(NamedTuple):
    """The best next move from a state.

    ``kind``: what it does; None where the build has ended. ``robots``, ``nodes``: who moves,
    several where all let go at once, and what they take or let go. ``site``: where the build stands
    then. ``values``: the least that every goal takes of the rest of the build, this move included.
    ``brick``: the brick that is placed, or removed; zero where none is.
    """

    kind: StepKind | None
    robots: tuple[str, ...]
    nodes: tuple[int, ...]
    site: Site
    values: Mapping[str, float]
    brick: int = 0

    def __str__(self) -> str:
        who, what = ", ".join(self.robots), ", ".join(map(str, self.nodes))
        if self.kind is None:
            return "the build has ended"
        if self.kind is StepKind.RELEASE:
            return f"{who} {'lets' if len(self.robots) == 1 else 'let'} go of node {what}"
        if self.kind is StepKind.REMOVE:
            return f"{who} takes brick {self.brick} away, which it holds at node {what}"
        if self.kind is StepKind.PLACE:
            return f"{who} places brick {self.brick} and holds it at node {what}"
        return f"{who} takes hold of node {what}"


@dataclass(frozen=True, eq=False, repr=False)
class Policy(FrozenValue):
    """Optimal policy over all reachable states of a free schedule.

    Attributes
    ----------
    goals : tuple of str
        What is to be small, the most important first.
    robots : tuple of str
        The scene's robots.
    kinds : tuple of tuple of int
        Indices of the robots of every column, by kind: robots of a kind could change places.
    order : (B,) int
        The bricks in build order.
    nodes : (2B,) int
        The nodes in build order; states have their places in it, from 1.
    bricks : (n,) int
        How many bricks stand in every state.
    held : (n, c) int
        Places of the nodes that robots hold, 0 for a robot that is free, -n for one that was last
        at n where travel counts; then the grips since the last brick where a rule counts them.
    values : (n, g) float
        The least that goals take of the rest of a build; infinite where no end is reached.
    following : (n,) int
        The state that the best move leads to; -1 where the build has ended, or cannot end.
    checked : int
        How many moves the judge compared with the values of the first goal, which they prove.
    keeps_range : bool
        Whether all states are within the linear range; also where that limit is lifted. Otherwise
        no build keeps it.
    """

    goals: tuple[str, ...]
    robots: tuple[str, ...]
    kinds: tuple[tuple[int, ...], ...]
    order: Ints
    nodes: Ints
    bricks: Ints
    held: Ints
    values: Floats
    following: Ints
    checked: int = 0
    keeps_range: bool = True

    def __repr__(self) -> str:
        stuck = f", {self.dead_ends} without an end" if self.dead_ends else ""
        outside = "" if self.keeps_range else f"{OUTSIDE}: "
        return f"<Policy: {outside}{len(self.bricks)} states{stuck}, {', '.join(self.goals)}>"

    @property
    def dead_ends(self) -> int:
        """From how many states no end is reached: robots must not go there."""
        return int(np.isinf(self.values[:, 0]).sum())

    def best(self, site: Site) -> Advice:
        """Return the best next move from a site.

        Raises `StepError` if no build reaches it by the rules, or no end is reached from it.
        """
        row = self._row_of(site)
        values = dict(zip(self.goals, self.values[row].tolist(), strict=True))
        after = int(self.following[row])
        if after < 0 and np.isinf(self.values[row, 0]):
            raise StepError("site: no end is reached from it; let robots go elsewhere, or replan")
        if after < 0:
            return Advice(None, (), (), site, values)
        try:
            return self._move(site, row, after, values)
        except (IndexError, StopIteration):  # of another scene, or damaged
            raise StepError(
                "site: no move leads to the state that follows; write it again"
            ) from None

    def _move(self, site: Site, row: int, after: int, values: Mapping[str, float]) -> Advice:
        nobody = (None,) * len(self.robots)
        grips, stays = list(site.grips or nobody), list(site.stays or nobody)
        moved: list[tuple[int, int]] = []
        taken = False
        for kind, column in zip(self.kinds, self._columns, strict=True):
            old, new = self.held[row, column], self.held[after, column]
            for place in {*old[old > 0].tolist()} - {*new[new > 0].tolist()}:
                node = int(self.nodes[place - 1])
                robot = next(r for r in kind if grips[r] == node)
                grips[robot], stays[robot] = None, node
                moved.append((robot, node))
            for place in {*new[new > 0].tolist()} - {*old[old > 0].tolist()}:
                left = [*new[new <= 0].tolist()]
                robot = self._taker(kind, (grips, stays), left)
                grips[robot], taken = int(self.nodes[place - 1]), True
                moved.append((robot, int(self.nodes[place - 1])))
        bricks = int(self.bricks[after])
        regrips = site.regrips + taken if bricks == site.bricks else 0
        kept = tuple(s if g is None else None for s, g in zip(stays, grips, strict=True))
        then = Site(bricks, tuple(grips), kept, regrips, site.step + 1)
        kind_of = StepKind.PLACE if bricks > site.bricks else StepKind.REPOSITION
        let_go = StepKind.REMOVE if bricks < site.bricks else StepKind.RELEASE
        names, nodes = tuple(self.robots[r] for r, _ in moved), tuple(node for _, node in moved)
        changed = bricks != site.bricks
        brick = int(self.order[max(bricks, site.bricks) - 1]) if changed else 0
        return Advice(kind_of if taken else let_go, names, nodes, then, values, brick)

    def _taker(
        self, kind: tuple[int, ...], now: tuple[list[Any], list[Any]], left: list[int]
    ) -> int:
        """Return which free robot of a kind takes a grip: one that is not seen to stay free."""
        free = [r for r in kind if now[0][r] is None]
        for robot in reversed(free):
            stay = -self._place.get(now[1][robot], 0)
            if stay in left and len(free) > 1:
                left.remove(stay)
                free.remove(robot)
        return free[0]

    @cached_property
    def _columns(self) -> tuple[slice, ...]:
        ends = np.cumsum([0, *map(len, self.kinds)]).tolist()
        return tuple(slice(a, b) for a, b in pairwise(ends))

    @cached_property
    def _rows(self) -> dict[bytes, int]:
        keys = np.column_stack([self.bricks, self.held]).astype(np.int32)
        return {key.tobytes(): i for i, key in enumerate(keys)}

    @cached_property
    def _place(self) -> dict[int | None, int]:
        return {int(node): i for i, node in enumerate(self.nodes, start=1)}

    def _row_of(self, site: Site) -> int:
        nobody = (None,) * len(self.robots)
        grips, stays = site.grips or nobody, site.stays or nobody
        key, parks = [site.bricks], (self.held < 0).any()  # whether it counts where they held last
        for kind in self.kinds:
            places = [
                self._place.get(grips[r], -self._place.get(stays[r], 0) if parks else 0)
                for r in kind
            ]
            key += sorted(places, reverse=True)
        if self.held.shape[1] > self._columns[-1].stop:
            key.append(site.regrips)
        row = self._rows.get(np.array(key, dtype=np.int32).tobytes())
        if row is None:
            raise StepError(
                "site: no build by these rules and limits reaches it; plan from it with "
                "optimize --from"
            )
        return row

    def save(self, path: str | Path) -> Path:
        """Write the table to an npz file; see `load`."""
        write_bytes(Path(path), self.content())
        return Path(path)

    def content(self) -> bytes:
        """Return what `save` writes."""
        told = {name: getattr(self, name) for name in FACTS}
        arrays = {name: getattr(self, name) for name in ARRAYS}
        least = min(int(self.held.min(initial=0)), -int(self.held.max()) - 1)
        arrays["held"] = self.held.astype(np.min_scalar_type(least))
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, told=json.dumps(told), **arrays)
        return buffer.getvalue()

    @classmethod
    def load(cls, path: str | Path) -> Policy:
        """Return the policy of a file."""
        try:
            archive = Archive(read_bytes(Path(path)), str(path))
            archive.require(f"{name}.npy" for name in ("told", *ARRAYS))
            told = parse_json(str(archive.array("told", "U", ())), f"{path}: told")
            return _checked(told, archive, str(path))
        except (FileError, ValueError) as error:  # text that is no text is a ValueError
            raise FileError(f"{error}; it is no policy: write one with --policy") from None


def _checked(told: Any, archive: Archive, where: str) -> Policy:
    """Return a policy whose arrays go together; a `FileError` names one that does not."""
    if not isinstance(told, dict) or {*told} != {*FACTS}:
        raise FileError(f"{where}: told is {short(told)}; {', '.join(FACTS)} belong there")
    goals, robots, kinds = (told[name] for name in FACTS[:3])
    words = [*goals, *robots] if isinstance(goals, list) and isinstance(robots, list) else [None]
    lists = isinstance(kinds, list) and all(isinstance(kind, list) for kind in kinds)
    every = [*chain.from_iterable(kinds)] if lists else []
    right = goals and all(isinstance(word, str) for word in words)
    right = right and all(type(each) is int and 0 <= each < len(robots) for each in every)
    if not right or not every or len({*every}) < len(every):
        raise FileError(f"{where}: told is {short(told)}; name goals, robots, and these by kind")
    bricks = archive.array("bricks", "iu", (None,))
    order, nodes = (archive.array(name, "iu", (None,)) for name in ("order", "nodes"))
    held = archive.array("held", "iu", (len(bricks), None))
    values = archive.array("values", "f", (len(bricks), len(goals)))
    following = archive.array("following", "iu", (len(bricks),))
    limits = {  # what numbers stand for: robots hold one of the nodes, or were last at it
        "bricks": (bricks, 0, len(order)),
        "held": (held[:, : len(every)], -len(nodes), len(nodes)),
        "following": (following, -1, len(bricks) - 1),
    }
    for name, (numbers, least, most) in limits.items():
        if numbers.size and not least <= int(numbers.min()) <= int(numbers.max()) <= most:
            raise FileError(f"{where}: {name} goes beyond {least} to {most}")
    columns = held.shape[1] - len(every)
    kept = (type(told["checked"]), type(told["keeps_range"])) == (int, bool)
    if columns not in (0, 1) or np.isnan(values).any() or not kept:
        raise FileError(f"{where}: held, values or checked are not of {len(every)} robots")
    named = tuple(goals), tuple(robots), tuple(map(tuple, kinds))
    arrays = order, nodes, bricks, held, values, following
    return Policy(*named, *arrays, told["checked"], told["keeps_range"])


def find_policy(
    problem: Problem, tell: Callable[[object], object] = lambda _: None, *, proof: bool = True
) -> Policy:
    """Return the optimal policy over all reachable states of a free schedule.

    The aims of ``problem`` have at most one worst step, which totals may precede and follow. States
    are within the linear range if any build is, unless a limit on it says otherwise. With
    ``proof`` a second version of the rules and responses computed anew check every move. Raises
    `ProblemError` if aims are margins or totals over scenarios, or there are budgets;
    `InfeasibleError`, with why, if no build reaches an end; `SolverError` if the check finds a move
    that leads to less than the table says.

    >>> import seqopt
    >>> from seqopt.plan.policy import find_policy
    >>> scene = seqopt.load_scene("wall:columns=2,courses=2")
    >>> engine = seqopt.make_engine("compliance", scene)
    >>> worst = seqopt.CRITERIA["worst-ratio"]
    >>> problem = seqopt.pose(engine, seqopt.FreeRules(), worst, "minmax,steps")
    >>> policy = find_policy(problem)
    >>> str(policy.best(seqopt.Site(0)))
    'rob1 places brick 1 and holds it at node 2'
    """
    tell("looking at every state")
    within = problem if problem.says_range else problem.within_range(1.0)
    states, found = _explored(within)
    if found is None and within is not problem:
        states, found = _explored(problem)
    if found is None:
        raise confirmed(replace(states), "the policy")
    found.refine()
    visited = found.graph()
    kept = any(limit.label == LINEAR_RANGE for limit in states.limits)
    policy = replace(_of_graph(states, visited), keeps_range=kept or problem.lifts_range)
    if not proof:
        return policy
    tell("proving that no move is better")
    levels = np.concatenate([np.full(len(rows), level) for level, _, rows in visited.states])
    table = levels, policy.held, policy.values[:, 0], policy.following
    return replace(policy, checked=check_policy(states, *table))


def _explored(problem: Problem) -> tuple[States, Explorer | None]:
    """Return the states of a problem, and those that builds reach; None where none ends.

    Raises a `ProblemError` where what is best depends on what was before.
    """
    states = states_of(problem)
    why = {
        "budgets": states.budgets,
        "margins as aims": any(goal.of_margins for goal in states.goals),
        "totals over scenarios": states.totals,
        "all orders": problem.orders is not None,
    }
    for name in (name for name, asked in why.items() if asked):
        raise ProblemError(f"a policy has no {name}: what is best depends on what was before")
    _ = states.free_rules  # a schedule has no policy, and says so
    found = None if barred(states) is not None else explore(states)
    return states, found if found is not None and found.whole else None


def _of_graph(states: States, visited: Visited) -> Policy:
    graph, space = visited.graph, states.space
    left = _to_go(graph)
    after = np.where(left.move < 0, -1, graph.target[left.move])
    bricks = [np.full(len(rows), space.bricks_at(level)) for level, _, rows in visited.states]
    return Policy(
        states.names,
        tuple(robot.name for robot in states.network.scene.robots),
        tuple(kind.robots for kind in space.kinds),
        np.array(states.network.scene.build_order),
        np.array(node_numbers(states.network)),
        np.concatenate(bricks).astype(np.int16),
        np.concatenate([rows for *_, rows in visited.states]),
        left.values,
        after.astype(np.int32),
    )
