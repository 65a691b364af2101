"""The problem of finding the build order whose best plan is best."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from itertools import combinations

import numpy as np

from seqopt._showing import Shown
from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.engines.interface import Engine
from seqopt.engines.registry import recipe_of
from seqopt.errors import ProblemError
from seqopt.graph._explore import Moves
from seqopt.graph.paths import keep_best
from seqopt.graph.states._visits import FreeStates, ScenarioSums, explore, move_amounts
from seqopt.graph.states.states import States
from seqopt.network.build import build_network
from seqopt.problem.amounts import LARGEST, StateArrays
from seqopt.problem.problem import Orders
from seqopt.problem.requirements import pickled
from seqopt.responses._blocks import packed, unpacked
from seqopt.scene._armed import can_hold
from seqopt.scene.scene import Order, Scene
from seqopt.sequence._robot_kinds import node_numbers
from seqopt.sequence._rule_space import sort_entries
from seqopt.sequence.rules import Direction, Ending, FreeRules


@dataclass(frozen=True, repr=False)
class AllOrders(Shown):
    """The free schedule of a scene whose build order is free too.

    The value of an order is the first goal of its best plan; the criterion keeps the numbers that
    it has in the scene's own order.

    ``states``: in the scene's own order. Raises `ProblemError` if the engine was not made by name,
    or there are no such orders.
    """

    states: States
    among: Orders = Orders.TIED
    down: FreeRules | None = None  # of a take-down, whose build in reverse has its order searched
    stands: Order = field(init=False)  # names of the bricks with which builds begin

    def __post_init__(self) -> None:
        object.__setattr__(self, "among", Orders.of(self.among))
        if self.states.free_rules.takes_down:
            object.__setattr__(self, "down", self.states.free_rules)
            object.__setattr__(self, "states", _built(self.states))
        first, last = self.states.free_rules.span(self.scene)
        if last < len(self.scene.bricks):
            raise ProblemError(
                f"orders to {last} of {len(self.scene.bricks)} bricks: which of them is not said; "
                "give an order, or go on to the last brick"
            )
        object.__setattr__(self, "stands", self.scene.build_order[:first])
        if recipe_of(self.states.engine) is None:
            raise ProblemError(
                f"engine {type(self.states.engine).__name__}: orders need engines of their own; "
                "take one of seqopt.make_engine"
            )

    def __repr__(self) -> str:
        return f"AllOrders({self.scene.name!r}, {self.states.names[0]}, {self.among.value} orders)"

    @property
    def scene(self) -> Scene:
        """What is built."""
        return self.states.network.scene

    @cached_property
    def ties(self) -> dict[int, frozenset[int]]:
        """By brick, those that a joint ties to it; zero joints tie nothing."""
        out: dict[int, set[int]] = {name: set() for name in self.scene.build_order}
        for joint in self.scene.joints:
            if any((*joint.translational_stiffness, *joint.rotational_stiffness)):
                first, second = joint.bricks
                out[first].add(second)
                out[second].add(first)
        return {name: frozenset(others) for name, others in out.items()}

    def next_bricks(self, placed: frozenset[int]) -> tuple[int, ...]:
        """Return the bricks that may be placed next; ``placed``: names of those that stand."""
        left = [name for name in self.scene.build_order if name not in placed]
        if self.among is Orders.ANY:
            return tuple(left)
        grounds = self.scene.grounds
        founded = {g.brick for g in grounds if g.closes_with in {None, *placed, g.brick}}
        return tuple(b for b in left if self.ties[b] & placed or b in founded)

    def allows(self, order: Sequence[int]) -> bool:
        """Return whether an order of all bricks' names is one of those that are sought in."""
        first = len(self.stands)
        pairs = [*enumerate(order)][first:]
        follow = all(b in self.next_bricks(frozenset(order[:k])) for k, b in pairs)
        return follow and {*order[:first]} == {*self.stands}

    def order_of(self, found: Sequence[tuple[int, Key, Ints]]) -> Order:
        """Return the order of a path: level, part and state (c,) of all its states."""
        return tuple(dict.fromkeys((*self.stands, *(part[1] for _, part, _ in found))))

    def judging(self, order: Order) -> States:
        """Return the free schedule of one order with the goal that orders are judged by alone."""
        alone = self.states.resources.alone()  # orders are shared out, not their grip sets
        goals = self.states.goals[:1]
        return replace(self.at(order), goals=goals, budgets=(), resources=alone)

    def planned(self, order: Order) -> States:
        """Return the free schedule of one order that is asked for: the take-down of it, if any."""
        found = self.at(order)
        return found if self.down is None else replace(found, rules=self.down, spares=False)

    def at(self, order: Order) -> States:
        """Return the free schedule of one order."""
        made = list[Engine]()
        for engine in (self.states.engine, *self.states.scenarios):
            recipe = recipe_of(engine)
            assert recipe is not None  # as was required
            made.append(recipe.make(build_network(engine.network.scene, order)))
        return replace(self.states, engine=made[0], scenarios=tuple(made[1:]))


def _built(states: States) -> States:
    """Return the build that passes, in reverse, the states of a take-down, which begins free."""
    rules, scene = states.free_rules, states.network.scene
    if rules.begin != replace(rules, begin=None).begun(scene).begin or rules.finish is not None:
        raise ProblemError(
            "orders of a take-down from or to a part: which bricks those are is not said; give an "
            "order, or take all down from where nobody holds"
        )
    first = states.goals[0]
    plain = first.is_peak and not first.margins and rules.regrips is None
    if not plain or states.budgets or states.totals:
        raise ProblemError(
            f"orders of a take-down are searched for its worst state, not for {first} or "
            "within budgets and regrips; give an order, or put minmax first"
        )
    up = replace(rules, direction=Direction.BUILD, begin=None, ending=Ending.ONE_BY_ONE)
    return replace(states, rules=up, spares=True)


@dataclass(frozen=True, eq=False, repr=False)
class OrderSelection(FrozenValue):
    """An order, and what its formulation claims of it.

    ``order``: names of all bricks; ``objective``: claimed value of the first goal of its best plan;
    ``bound``: claimed lower bound over all orders; the value itself where it is proven the least;
    ``evaluated``: how many orders, or sets of bricks with a newest one, were looked at;
    ``stopped``: why the search ended before all was proven: ``size``, ``time`` or ``interrupt``;
    empty if it did not; ``weights``: by scenario, that prove a bound on a total over them.
    """

    order: Order
    objective: float
    bound: float
    evaluated: int
    stopped: str = ""
    weights: tuple[float, ...] = ()


MOST_PARTS = 5000  # sets of bricks with a newest one, where all are looked at
MOST_SETS = 200_000  # grip sets of the whole structure that are looked at


def whole_bound(problem: AllOrders) -> float:
    """Return the lower bound from the finished structure: the least value over all grips.

    Every plan of every order passes such a state, and the one in which nobody holds if it ends so.

    Result: minus infinity where there are too many grip sets to look at.
    """
    free = problem.judging(problem.scene.build_order)
    if not free.goals[0].is_peak:
        return -np.inf
    numbers, scene, least = node_numbers(free.network), problem.scene, -np.inf
    taken = {*scene.blocked_nodes, *(prop.node for prop in scene.props)}
    every = [  # whoever holds them
        place + k * len(numbers)
        for k in sorted({*scene.grip_kinds.of_robot[: len(scene.robots)].tolist()})
        for place, node in enumerate(numbers, start=1)
        if node not in taken and can_hold(scene, k, node)
    ]
    fewest = max(1, free.free_rules.fewest_grips(scene) - len(scene.props))
    sets = _sets(every, fewest, free.space.robots, len(numbers))
    if len(sets):
        least = float(_values(free, sets).min())
    if free.free_rules.how_it_ends is not Ending.HELD and not free.spares:
        least = max(least, float(_values(free, np.zeros((1, free.space.robots), int))[0]))
    return least


def _sets(places: list[int], fewest: int, robots: int, nodes: int) -> Ints:
    """Return all grip sets, zeros for robots that are free first; none if they are too many.

    ``nodes``: how many there are; places beyond that are the same nodes, held by others.
    """
    rows: list[tuple[int, ...]] = []
    for count in range(fewest, robots + 1):
        for held in combinations(places, count):
            if len({place % nodes for place in held}) == count:
                rows.append((*[0] * (robots - count), *held))
            if len(rows) > MOST_SETS:
                return np.zeros((0, robots), dtype=np.int64)
    return np.array(rows, dtype=np.int64).reshape(-1, robots)


def _values(free: States, held: Ints) -> Floats:
    """Return what the goal takes of grip sets of the whole; infinite where something is loose."""
    bricks, goal = len(free.network.inner), free.goals[0]
    answers, forces = free.sets.answers(bricks, held)
    names = [name for name in free.named if name != LARGEST]
    found = dict(zip(names, answers.T, strict=True)) | {LARGEST: forces.max(axis=1, initial=0.0)}
    whole = np.isfinite(answers).all(axis=1)
    finite = {name: np.where(whole, values, 0.0) for name, values in found.items()}
    places = np.where(held > 0, (held - 1) % (2 * bricks) + 1, 0)  # whoever holds
    nodes, most = free._node_numbers[places], np.full(held.shape, np.inf)
    seen = StateArrays(bricks, nodes, finite, forces, most, whole, free.criterion, places)
    values = np.zeros(len(held)) if goal.states is None else goal.states(seen)
    return np.where(whole, values, np.inf)


Key = tuple[frozenset[int], int]  # bricks that stand, and the newest


class TooManySetsError(ProblemError):
    """There are more sets of bricks than may be looked at."""


@dataclass(frozen=True)
class OrderStates:
    """The states of all orders, a part for every set of standing bricks and newest brick.

    ``most``: how many parts there may be; ``every_goal``: whether all goals count, not the first
    alone; ``parts``: those that were looked at, each in an order that begins with its set.
    """

    problem: AllOrders
    most: int
    every_goal: bool = False
    parts: dict[Key, FreeStates] = field(default_factory=dict)

    @property
    def first(self) -> int:
        """How many bricks stand where builds begin."""
        return len(self.problem.stands)

    @property
    def levels(self) -> int:
        """How many bricks there are."""
        return len(self.problem.scene.bricks)

    @property
    def peaks(self) -> tuple[bool, ...]:
        """Whether the worst step counts, or what all steps take."""
        if self.problem.states.totals:
            return (False,) * len(self.problem.states.scenarios)
        return tuple(goal.is_peak for goal in self._asked.goals)

    def start(self) -> tuple[Key, Ints]:
        """Return where builds begin."""
        stands = self.problem.stands
        key: Key = (frozenset(stands), stands[-1] if stands else 0)
        return key, self._of(key).start()[1]

    def codes(self, part: Key, states: Ints) -> Ints:
        """Return a number for every state."""
        return self._of(part).codes(len(part[0]), states)

    def within(self, part: Key, states: Ints) -> Moves:
        """Return the moves that place no brick."""
        return self._of(part).within(len(part[0]), states)

    def onward(self, part: Key, states: Ints) -> Iterator[tuple[Key, Moves]]:
        """Yield the moves that place one of the bricks that may come next."""
        old = self._of(part).problem
        rows = self._of(part).able(len(part[0]), states)
        for brick in self.problem.next_bricks(part[0]):
            key = (part[0] | {brick}, brick)
            new = self._of(key)
            moves = new.placed(len(part[0]), _renumbered(old, new.problem, states[rows]))
            yield key, moves._replace(source=rows[moves.source])

    complete = True  # no order or move is left out

    @property
    def floors(self) -> bool:
        """Whether there are scenarios."""
        return bool(self.problem.states.each) and not self.problem.states.totals

    def values(self, part: Key, states: Ints, *, rough: bool, most: float) -> tuple[Floats, Bools]:
        """Return what the first goal takes of states, and which are allowed."""
        return self._of(part).values(len(part[0]), states, rough=rough, most=most)

    def amounts(self, values: Floats, taken: Floats) -> Floats:
        """Return what the first goal takes of moves, (m, 1)."""
        return values if self.problem.states.totals else move_amounts(self._asked, values, taken)

    @cached_property
    def _asked(self) -> States:
        states = self.problem.states
        return states if self._all_count else replace(states, goals=states.goals[:1])

    @property
    def _all_count(self) -> bool:
        return self.every_goal or bool(self.problem.states.budgets)

    def path(self, found: Sequence[tuple[int, Key, Ints]]) -> tuple[Order, tuple[Ints, ...]]:
        """Return the order of a path, and its states (c,) with the places of nodes in it.

        ``found``: level, part and state (c,) of all its states.
        """
        order = self.problem.order_of(found)
        new = self.problem.at(order)
        rows = ((self._of(part).problem, state[None]) for _, part, state in found)
        return order, tuple(_renumbered(old, new, state)[0] for old, state in rows)

    def ended(self, part: Key, states: Ints) -> Bools:
        """Return which states end the build."""
        return self._of(part).ended(len(part[0]), states)

    def _of(self, part: Key) -> FreeStates:
        """Return the free schedule in an order that begins with a set, its newest brick last."""
        if part not in self.parts:
            if len(self.parts) > self.most:
                raise TooManySetsError(
                    f"scene {self.problem.scene.name}: its orders have more than {self.most} sets "
                    "of bricks; give an order, or ask for the worst step alone"
                )
            own = self.problem.scene.build_order
            first = [name for name in own if name in part[0] and name != part[1]]
            stand = [name for name in self.problem.stands if name in first]
            newest = (part[1],) if part[0] else ()
            order = tuple(dict.fromkeys((*stand, *first, *newest, *own)))
            problem = (self.problem.at if self._all_count else self.problem.judging)(order)
            kind = ScenarioSums if problem.totals else FreeStates
            self.parts[part] = kind(problem, standing=bool(problem.demands))
        return self.parts[part]


def _renumbered(old: States, new: States, states: Ints) -> Ints:
    """Return states with the places that nodes have in another order."""
    place = {node: i for i, node in enumerate(node_numbers(new.network), start=1)}
    map_to = np.array([0, *(place[node] for node in node_numbers(old.network))])
    out, robots = states.copy(), old.space.robots
    nodes = states[:, :robots]  # negative where a free robot was last
    out[:, :robots] = np.sign(nodes) * map_to[np.abs(nodes)]
    for first, end in new.space.slots:
        sort_entries(out, first, end)
    return out


NARROW = 50  # states of a brick count with which an order is tried first


@dataclass(frozen=True)
class Trial:
    """An order to be tried.

    ``order``: names of all bricks; ``ceiling``: a value of the first goal that it must beat.
    """

    order: Order
    ceiling: float


def order_value(problem: AllOrders, trial: Trial) -> float:
    """Return the first goal of the best plan of an order; infinite if none is below the ceiling."""
    judged, ceiling, found = problem.judging(trial.order), trial.ceiling, np.inf
    for width in (NARROW, None):
        visited = explore(judged, ceiling, width)
        if visited.whole:
            visited.refine()
            found = ceiling = keep_best(visited.graph().graph, 0)[1]
    return found


def trying(problem: AllOrders, *, elsewhere: bool) -> Callable[[Trial], float]:
    """Return the function that tries orders.

    ``elsewhere``: whether it is to be sent to other processes: then with the scene, not with an
    engine. Result: takes a trial, returns its `order_value`. Raises `ProblemError`, `SceneError` if
    a criterion or an engine of one's own cannot be sent.
    """
    if not elsewhere:
        return partial(order_value, problem)
    free = replace(problem.states, resources=problem.states.resources.alone())
    sent = ("engine", "scenarios")
    rest = {f.name: getattr(free, f.name) for f in fields(free) if f.name not in sent}
    others = tuple(map(packed, free.scenarios))
    content = pickled((rest, others, problem.among), free.criterion)
    return partial(_sent, packed(free.engine), content)


def _sent(shipment: bytes, content: bytes, trial: Trial) -> float:
    rest, others, among = pickle.loads(content)  # our own, from `trying`
    rest["scenarios"] = tuple(map(unpacked, others))
    return order_value(AllOrders(States(engine=unpacked(shipment), **rest), among), trial)
