"""How few props a build needs, and where: the best plan of the smallest sets that allow one.

Sets are looked at by their size, and in build order. A judge says of each with how many bricks all
of its plans end unfinished, or pass a state worse than the best plan so far. Which props hold is
until then the same for all sets with the same first props: these are ruled out together. Every set
that is left is solved, with its proof.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import comb, inf
from operator import itemgetter

import pandas as pd

from seqopt.arrays import Terse
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, StepError
from seqopt.judge._proof import Proof
from seqopt.plan._range import best_of_several
from seqopt.plan._studies._tried import Tried
from seqopt.plan.plan import Plan
from seqopt.plan.solving import _moved, states_of
from seqopt.problem.problem import Measure, Problem
from seqopt.responses.table import OUTSIDE
from seqopt.scene._props import Prop
from seqopt.scene.scene import Scene
from seqopt.work.progress import Tell

_MOST = 2_000  # sets that are looked at, one by one
_Set = tuple[int, ...]  # candidates by index, ascending


@dataclass(frozen=True, repr=False)
class FoundProps(Terse):
    """The best plan with as few props as any needs, and what became of each set.

    ``problem``: with the props of the plan; ``tried``: a row for every set that was looked at:
    its ``nodes``, ``outcome``, and by goal what is known; ``sets``: how many there are of as many
    props or fewer; ``proven``: whether none of these, nor any with fewer, allows a better plan.
    """

    plan: Plan
    problem: Problem
    tried: pd.DataFrame
    sets: int
    proven: bool

    @property
    def count(self) -> int:
        """How many props the plan has."""
        return len(self.problem.scene.props)

    @property
    def _solved(self) -> int:
        return int(self.tried["outcome"].str.startswith("solved").sum())

    @property
    def said(self) -> str:
        """What was chosen, and what ruled the rest out, in words."""
        nodes = ", ".join(str(prop.node) for prop in self.problem.scene.props)
        looked, solved = len(self.tried), self._solved
        where = f" at node{'s' * (self.count > 1)} {nodes}" if nodes else ""
        end = "no set of as many or fewer is better" if self.proven else "another may be better"
        end += f", by a model {OUTSIDE}" if self.plan.outside else ""
        return (
            f"props: {self.count}{where}; {self.sets} sets of as many or fewer: {solved} solved, "
            f"{looked - solved} ruled out by a cut, {self.sets - looked} with these; {end}"
        )

    def described(self) -> dict[str, object]:
        """Return the same for a summary, ready for JSON."""
        return {
            "props": self.count,
            "nodes": [prop.node for prop in self.problem.scene.props],
            "sets": self.sets,
            "solved": self._solved,
            "cut": len(self.tried) - self._solved,
            "proven": self.proven,
        }


def fewest_props(
    problem: Problem,
    candidates: Sequence[Prop],
    solved: Callable[[Problem], Plan],
    tell: Tell = lambda _: None,
) -> FoundProps:
    """Return the best plan of the smallest sets of props that allow any.

    ``problem``: whose plans are compared by the worst or the total of states; ``candidates``: at
    different nodes; ``solved``: returns the proven plan of a problem. Raises `InfeasibleError` if
    no set allows a plan, `NothingFoundError` if that is open, `ProblemError` if too many have to be
    looked at. Sets that allow a plan within the linear range come before all others, unless a limit
    on it says otherwise.
    """
    if problem.orders is not None:
        raise ProblemError("aim props: they are chosen for one order; leave out the search of it")
    return best_of_several(problem, lambda asked: _Search(asked, candidates, solved, tell).found())


class _Search(Tried):
    """Looks at sets of props, the smallest first, and keeps the best plan so far."""

    def __init__(
        self,
        problem: Problem,
        candidates: Sequence[Prop],
        solved: Callable[[Problem], Plan],
        tell: Tell,
    ) -> None:
        super().__init__(problem, solved, tell)
        scene = problem.scene
        since = {prop: scene.since[scene.brick_of_node[prop.node].name] for prop in candidates}
        self._candidates = sorted(candidates, key=lambda prop: since[prop])
        self._since = [since[prop] for prop in self._candidates]  # bricks that stand by then
        self._cuts: dict[int, set[_Set]] = {}  # first props of sets without a better plan
        self._farthest: tuple[int, _Set] = (0, ())  # at how many bricks plans end, of which set

    def found(self) -> FoundProps:
        """Return the best plan of the smallest sets that allow any."""
        count, sets = len(self._candidates), 0
        for size in range(count + 1):
            sets += comb(count, size)
            whole = all(map(self._look, self._sets(size, ())))
            if self._plan is not None and self._of is not None:
                rows = pd.DataFrame(self._rows)
                return FoundProps(self._plan, self._of, rows, sets, whole and self._proven)
            if not whole:
                raise ProblemError(
                    f"aim props: {_MOST} sets were looked at, and none of up to {size} props was "
                    "found to allow a plan; allow fewer nodes with --props-among"
                )
        raise self._none(
            f"props: none of {sets:,} sets of up to {count} props allows a plan; {self._cause()}"
        )

    def _cause(self) -> str:
        """Return why the set with which plans come farthest allows none, in words."""
        props = [self._candidates[i] for i in self._farthest[1]]
        nodes = ", ".join(str(prop.node) for prop in props)
        which = f"with those at nodes {nodes}" if nodes else "without any"
        try:
            self._solved(_moved(self._problem, self._problem.scene.with_props(*props)))
        except (InfeasibleError, NothingFoundError, StepError) as error:
            return f"{which}, {error}"
        return "allow other nodes, or loosen a rule or limit"

    def _sets(self, size: int, chosen: _Set) -> Iterator[_Set]:
        """Yield the sets that begin with some, ascending, and that no cut rules out until then."""
        count = len(self._candidates)
        if len(chosen) == size:
            if not self._is_cut(chosen, len(self._problem.scene.bricks)):
                yield chosen
            return
        first = chosen[-1] + 1 if chosen else 0
        for i in range(first, count - (size - len(chosen)) + 1):
            if self._is_cut(chosen, self._since[i] - 1):
                return  # so are all with later ones
            yield from self._sets(size, (*chosen, i))

    def _is_cut(self, chosen: _Set, bricks: int) -> bool:
        """Return whether sets that have these props alone up to a brick count are ruled out."""
        early = ((stop, sets) for stop, sets in self._cuts.items() if stop <= bricks)
        return any(self._until(chosen, stop) in sets for stop, sets in early)

    def _until(self, chosen: _Set, bricks: int) -> _Set:
        return tuple(i for i in chosen if self._since[i] <= bricks)

    def _look(self, chosen: _Set) -> bool:
        """Rule out a set and its like, or solve it; return whether there is time for another."""
        props = [self._candidates[i] for i in chosen]
        nodes = " ".join(str(prop.node) for prop in props)
        self._tell(f"props, {len(self._rows)} sets looked at, now {nodes or 'none'}")
        scene = self._problem.scene.with_props(*props)
        found = self._in_time(partial(self._outcome, chosen, scene))
        if found is None:
            return False
        outcome, value = found
        self._rows.append({"nodes": nodes, "outcome": outcome, **self._named(value)})
        return len(self._rows) < _MOST and not self._over

    def _outcome(self, chosen: _Set, scene: Scene) -> tuple[str, tuple[float, ...]]:
        """Return what is known of a set, in words, and the values of its best plan."""
        try:
            problem = _moved(self._problem, scene)
            first = problem.goals[0]
            peak = first.measure is Measure.PEAK and not first.of_margins
            incumbent = self._best[:1] if self._plan is not None and peak else ()
            stop = Proof(states_of(problem)).stops_at(incumbent)
            if stop is not None:
                self._cuts.setdefault(stop, set()).add(self._until(chosen, stop))
                self._farthest = max(self._farthest, (stop, chosen), key=itemgetter(0))
                why = "no plan" if self._plan is None else "none as good"
                return f"{why}, by {stop} bricks", ()
            return self._kept(problem, self._solved(problem))
        except (InfeasibleError, StepError) as error:
            return f"no plan: {error}", (inf,)
        except NothingFoundError as error:
            return self._open(error)
