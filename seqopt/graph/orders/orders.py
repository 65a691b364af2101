"""The problem of finding the build order whose best plan is best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from seqopt.arrays import FrozenValue
from seqopt.engines.interface import Engine
from seqopt.engines.registry import make_engine, recipe_of
from seqopt.errors import ProblemError
from seqopt.graph.states.states import States
from seqopt.network.build import build_network
from seqopt.problem.problem import Orders
from seqopt.scene.orders import Order
from seqopt.scene.scene import Scene
from seqopt.showing import Shown


@dataclass(frozen=True, repr=False)
class AllOrders(Shown):
    """The free schedule of a scene whose build order is free too.

    The value of an order is the first goal of its best plan; the criterion keeps the numbers that
    it has in the scene's own order.

    ``states``: in the scene's own order; their first goal is no margin. Raises `ProblemError` if it
    is one, the engine was not made by name, or there are no such orders.
    """

    states: States
    among: Orders = Orders.TIED

    def __post_init__(self) -> None:
        object.__setattr__(self, "among", Orders.of(self.among))
        goal = self.states.goals[0]
        if goal.of_margins:
            raise ProblemError(
                f"aim {goal}: an order is not chosen by a margin; name minmax, a response, sum, "
                "steps, regrips or travel first"
            )
        if self.states.budgets:
            raise ProblemError(
                f"budget {self.states.goals[-1]}: an order is chosen by its first aim alone; leave "
                "it out, or give an order"
            )
        if recipe_of(self.states.engine) is None:
            raise ProblemError(
                f"engine {type(self.states.engine).__name__}: orders need engines of their own; "
                "take one of seqopt.make_engine"
            )

    def __repr__(self) -> str:
        return f"AllOrders({self.scene.name!r}, {self.states.goals[0]}, {self.among.value} orders)"

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
        """Return the bricks that may be placed next.

        ``placed``: names of those that stand.
        """
        left = [name for name in self.scene.build_order if name not in placed]
        if self.among is Orders.ANY:
            return tuple(left)
        return tuple(b for b in left if self.ties[b] & placed or self._on_ground(b, placed))

    def _on_ground(self, brick: int, placed: frozenset[int]) -> bool:
        grounds = (ground for ground in self.scene.grounds if ground.brick == brick)
        return any(g.closes_with is None or g.closes_with in {*placed, brick} for g in grounds)

    def allows(self, order: Sequence[int]) -> bool:
        """Return whether an order is one of those among which the best is sought.

        ``order``: names of all bricks.
        """
        return all(b in self.next_bricks(frozenset(order[:k])) for k, b in enumerate(order))

    def judging(self, order: Order) -> States:
        """Return the free schedule of one order with the goal that orders are judged by alone."""
        alone = self.states.resources.alone()  # orders are shared out, not their grip sets
        return replace(self.at(order), goals=self.states.goals[:1], resources=alone)

    def at(self, order: Order) -> States:
        """Return the free schedule of one order."""
        engine, *others = (_anew(e, order) for e in (self.states.engine, *self.states.scenarios))
        return replace(self.states, engine=engine, scenarios=tuple(others))


def _anew(engine: Engine, order: Order) -> Engine:
    """Return an engine of the same kind for the same scene in another order."""
    recipe, network = recipe_of(engine), build_network(engine.network.scene, order)
    assert recipe is not None
    return make_engine(recipe.engine, network, **recipe.options)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False, repr=False)
class OrderSelection(FrozenValue):
    """An order, and what its formulation claims of it.

    ``order``: names of all bricks; ``objective``: claimed value of the first goal of its best plan;
    ``bound``: claimed lower bound over all orders; the value itself where it is proven the least;
    ``evaluated``: how many orders, or sets of bricks with a newest one, were looked at;
    ``stopped``: why the search ended before all was proven: ``size``, ``time`` or ``interrupt``;
    empty if it did not.
    """

    order: Order
    objective: float
    bound: float
    evaluated: int
    stopped: str = ""
