"""What a plan asks of what it was chosen from: candidates of moves, states of a build, or arcs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar

from seqopt.errors import ProblemError
from seqopt.graph.formulation import Formulation, as_formulation
from seqopt.problem.problem import Aim
from seqopt.responses._tolerance import values_text
from seqopt.sequence.steps import Step

if TYPE_CHECKING:
    from seqopt.graph.formulation import Solution
    from seqopt.problem.standing import Standing
    from seqopt.scene.scene import Order
    from seqopt.sequence.site import Site


CANDIDATES, STATES, ARCS = "candidates", "states", "arcs"  # of what a path is chosen


class Source:
    """Base class of what plans are chosen from, with what most of these have in common."""

    kind: ClassVar[str]  # `CANDIDATES`, `STATES` or `ARCS`

    @property
    def candidates(self) -> tuple[tuple[int, ...], ...]:
        """The nodes that can be chosen, move by move; none where states are chosen."""
        return ()

    @property
    def title(self) -> str:
        """What the plan is called beside others; empty for the name of its formulation."""
        return ""

    @property
    def among(self) -> str:
        """The candidates that are kept, in words; empty for all."""
        return ""

    @property
    def models(self) -> int:
        """How many models were solved."""
        return 0

    @property
    def scenarios(self) -> tuple[Any, ...]:
        """What computes the responses of every scenario."""
        return ()

    @property
    def standing(self) -> Standing | None:
        """The demand that every state stands, if there is one."""
        return None

    @property
    def begin(self) -> Site | None:
        """Where a part of a build begins, if that is known."""
        return None

    @property
    def questions(self) -> tuple[str, ...]:
        """What a formulation must answer to choose from it."""
        raise NotImplementedError

    @property
    def default_formulation(self) -> str:
        """The name of the formulation that chooses from it if none is named."""
        raise NotImplementedError

    def formulation(self, named: Formulation | str | None) -> Formulation:
        """Return the formulation that chooses from it; a `ProblemError` if it does not fit."""
        return as_formulation(named or self.default_formulation, *self.questions)

    def at(self, order: Order) -> Any:
        """Return it in the chosen order of the bricks, by name; itself where one was given: ()."""
        return self

    @property
    def as_layers(self) -> Any:
        """Its layers of candidates, of the scene itself; a `ProblemError` if there are none."""
        raise ProblemError(
            "the plan has no moves to show: it was chosen from states, which have no candidates"
        )

    @property
    def as_states(self) -> Any:
        """Its states of the build; a `ProblemError` if there are none."""
        raise ProblemError("the plan was chosen from candidates, not from states of the build")

    def names_of(self, aim: Aim | None) -> tuple[str, ...]:
        """Return what every goal is called, then what has a budget; ``aim``: of the formulation."""
        raise NotImplementedError

    def in_display_units(self, aim: Aim | None, values: Sequence[float]) -> dict[str, float]:
        """Return values of the first goals by their names, in display units."""
        return dict(zip(self.names_of(aim), values, strict=False))

    def bounded(self, bounds: Sequence[Any]) -> Sequence[Any]:
        """Return the bounds of goals, without those of budgets."""
        return bounds

    def chosen_nodes(self, states: Sequence[Sequence[int]]) -> tuple[int, ...]:
        """Return the nodes of the states of a plan, which are one each."""
        return tuple(state[-1] for state in states)

    def chosen_candidates(self, states: Sequence[Sequence[int]]) -> tuple[int, ...]:
        """Return the candidate chosen for every move; a `ProblemError` if there are no moves."""
        raise ProblemError("states were chosen, not candidates of moves; take its steps")

    def settles(self, *, exact: bool) -> bool:
        """Return whether a judged plan is optimal though its gap is the width of a margin."""
        return False

    def said(self, objective: Mapping[str, float], gap: float | None, status: str) -> str:
        """Return objective, gap and status of a plan in words."""
        within = f" within {gap:.2g}" if gap and gap < inf else ""
        among = f" among candidates {self.among}" if self.among else ""
        return f"{values_text(objective)}, {status}{within}{among}"

    def described(self, aim: Aim | None, limits: Mapping[str, object]) -> dict[str, object]:
        """Return the settings of the problem for a summary; ``limits``: bounds by name."""
        raise NotImplementedError

    def spent(
        self, objective: Mapping[str, float], found: Solution
    ) -> dict[str, dict[str, float | None]]:
        """Return cap, use and multiplier, if one is known, of every budget."""
        return {}

    def step_columns(self, steps: Sequence[Step]) -> dict[str, list[object]]:
        """Return further columns of the table of responses, for the steps of a plan."""
        return {}

    def letting_go(self, steps: Sequence[Step]) -> int:
        """Return how many steps at the end only let go."""
        return 0
