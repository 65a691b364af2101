"""Formulations: ways to solve a placement problem, and their solutions."""

from __future__ import annotations

import inspect
import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from enum import Enum
from importlib.metadata import EntryPoint
from numbers import Integral, Real
from typing import Any, NamedTuple

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.errors import PluginWarning, ProblemError, did_you_mean, message_of, plugins
from seqopt.problem.problem import Aim
from seqopt.scene._checks import short
from seqopt.scene.scene import Order
from seqopt.work import Clock

GROUP = "seqopt.formulations"
EXHIBITS = "seqopt.exhibits"
WATCH = "watch"  # the name by which a formulation takes a watch
ALIASES = {
    "path_dp": "overlap_dp",
    "scenario_search": "overlap_dp",
    "flow_lp": "overlap_lp",
    "flow_mip": "overlap_mip",
}  # names that each had where it was written twice


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """Settings of one solve: time limits, callback of progress, proof and options.

    ``time_limit``: of the formulation alone, s; ``proof``: whether the answer is proven;
    ``options``: of the formulation; ``explains``: whether an infeasible problem is answered with
    remedies; ``clock``: of responses, formulation and proof together.
    """

    time_limit: float = math.inf
    progress: Callable[[Any], object] | None = None
    proof: bool = True
    options: Mapping[str, Any] | Sequence[str] = field(default_factory=dict)
    explains: bool = True
    clock: Clock = field(default_factory=Clock)

    def __post_init__(self) -> None:
        if not isinstance(self.time_limit, Real) or not self.time_limit >= 0:
            raise ProblemError(f"time_limit is {short(self.time_limit)}; give seconds from 0")
        if not (self.progress is None or callable(self.progress)):
            raise ProblemError(f"progress is {short(self.progress)}; give a function")

    @property
    def left(self) -> float:
        """Time that the formulation has left, s."""
        return min(self.time_limit, self.clock.left)


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Record the run time of a stage, s, under its name."""
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start


@dataclass(frozen=True)
class Finding:
    """Incumbent and lower bound of a formulation at a time.

    ``seconds``: since it began; ``objective``: of the incumbent; infinite without one; ``bound``:
    the highest lower bound; minus infinity without one.
    """

    seconds: float
    objective: float
    bound: float

    @property
    def gap(self) -> float:
        """What the bound leaves open, over the size of the objective; infinite if either lacks."""
        left = max(self.objective - self.bound, 0.0)  # it may be above by rounding
        return left / max(abs(self.objective), abs(self.bound)) if left else 0.0

    def __str__(self) -> str:
        known = {"objective": self.objective, "bound": self.bound}
        said = [f"{name} {value:.6g}" for name, value in known.items() if math.isfinite(value)]
        said += [f"gap {100 * self.gap:.3g} %"] if len(said) == 2 else []
        return ", ".join([f"{self.seconds:.2f} s", *said])


class Watch:
    """Clock and log of one solve: the deadline, and the incumbents and bounds so far.

    ``time_limit``: after which the formulation has to stop, s; ``progress``: called with every
    `Finding`; ``memory``: above which it has to stop, bytes.

    >>> watch = Watch(time_limit=60.0)
    >>> watch.tell(objective=12.0)
    >>> watch.tell(bound=9.0)
    >>> watch.over, [finding.objective for finding in watch.trace], watch.bound
    (False, [12.0, 12.0], 9.0)
    """

    def __init__(
        self,
        time_limit: float = math.inf,
        progress: Callable[[Finding], object] | None = None,
        memory: float = math.inf,
    ) -> None:
        self._start, self._limit, self.memory = time.perf_counter(), time_limit, memory
        self._progress = progress
        self._trace: list[Finding] = []
        self._within: Watch | None = None
        self.interrupted = False  # whether somebody asked for an end

    @property
    def seconds(self) -> float:
        """Since the watch was started."""
        return time.perf_counter() - self._start

    @property
    def is_limited(self) -> bool:
        """Whether time or memory has a limit."""
        return min(self._limit, self.memory) < math.inf

    @property
    def left(self) -> float:
        """How much time is left, s; zero where it is over."""
        return 0.0 if self.over else self._limit - self.seconds

    @property
    def over(self) -> bool:
        """Whether the time limit is reached, or an interrupt has come."""
        ended = self._within is not None and self._within.over
        return ended or self.interrupted or self.seconds >= self._limit

    def apart(self) -> Watch:
        """Return a watch with a log of its own, which is over when this one is."""
        other = Watch(self.left, memory=self.memory)
        other._within = self
        return other

    def interrupt(self) -> None:
        """Ask for an end: time is over from now on."""
        self.interrupted = True

    @property
    def trace(self) -> tuple[Finding, ...]:
        """Incumbents and bounds, in order."""
        return tuple(self._trace)

    @property
    def objective(self) -> float:
        """Objective of the incumbent; infinite without one."""
        return self._trace[-1].objective if self._trace else math.inf

    @property
    def bound(self) -> float:
        """Highest lower bound; minus infinity without one."""
        return self._trace[-1].bound if self._trace else -math.inf

    def tell(self, objective: float = math.inf, bound: float = -math.inf) -> None:
        """Record an incumbent or a lower bound, unless it is no better than those before.

        ``objective``, ``bound``: in the unit of the criterion.
        """
        if objective < self.objective or bound > self.bound or not self._trace:
            best = min(objective, self.objective)
            found = Finding(self.seconds, best, max(bound, self.bound))
            self._trace.append(found)
            if self._progress is not None:
                self._progress(found)


LEAST = {Aim.SUM: "sum", Aim.PEAK: "largest"}
READ: dict[type, tuple[Callable[[str], Any], type, str]] = {
    bool: (lambda word: {"true": True, "false": False}[word.lower()], bool, "true or false"),
    int: (int, Integral, "a whole number"),
    float: (float, Real, "a number"),
    str: (str, str, "a word"),
}
"""By the type of an option's default: how words are read, its type, and what is accepted."""


QUESTIONS = {
    "costs": "the costs of candidates of moves",
    "goals": "states of a build",
    "tail": "totals over scenarios",
    "time": "the time of a build",
    "resource": "resources that depend on the path",
    "order": "orders of the bricks",
    "front": "Pareto sets",
    "instance": "instances",
}
"""What formulations answer: ``goals`` are sums and worst steps, an instance is arrays alone."""


class FormulationKind(Enum):
    """What a formulation promises."""

    EXACT = "exact"
    HEURISTIC = "heuristic"
    BOUND = "bound"  # a proven bound; its choice is exact where nothing couples the moves


class End(Enum):
    """How a formulation ended."""

    DONE = "done"
    STOPPED = "stopped"  # before it could keep what it promises; its choice and bound stand
    INTERRUPTED = "interrupted"  # by a request to end; its incumbent and bound stand


@dataclass(frozen=True, repr=False)
class Formulation:
    """A way to solve the problem.

    Attributes
    ----------
    name, summary : str
        What it is called, and what it does in a few words.
    kind : FormulationKind
        What it promises.
    aim : Aim or None
        What it minimizes of candidates of moves: the sum of the costs, or the largest cost; None
        where a problem has its goals.
    solve : callable
        Takes a problem and named options, returns a `seqopt.graph.formulation.Solution`.
    takes_budgets : bool
        Whether it can keep totals over the build within budgets.
    windowed : tuple of (str, int or str), optional
        Options with which it looks at one window after the other; empty if it always does, None if
        it never does.
    answers : tuple of str, optional
        Which questions it answers, of `QUESTIONS`; one with an aim answers ``costs`` as well.
    alone : bool, optional
        Whether it is charged by ranks among the moves from one state, `Graph.alone`.

    Examples
    --------
    >>> import seqopt
    >>> best = seqopt.formulations()["overlap_dp"]
    >>> best.kind.value, best.aim.value
    ('exact', 'sum')
    """

    name: str
    summary: str
    kind: FormulationKind
    aim: Aim | None
    solve: Callable[..., Any]
    takes_budgets: bool = False
    windowed: tuple[tuple[str, int | str], ...] | None = None
    answers: tuple[str, ...] = ("goals", "tail", "instance")
    alone: bool = False

    def __repr__(self) -> str:
        return f"<Formulation {self.name}: {self.summary} ({self.kind.value}, {self._for})>"

    @property
    def _for(self) -> str:
        return f"least {LEAST[self.aim]} of the costs" if self.aim else QUESTIONS[self.answers[0]]

    def fits(self, *questions: str) -> bool:
        """Return whether it answers some `QUESTIONS`."""
        return {*questions} <= {*self.answers, *(["costs"] if self.aim else [])}

    @property
    def looks_at_all(self) -> bool:
        """Whether it may say that there is no plan, not only that it found none."""
        return self.kind is not FormulationKind.HEURISTIC

    @property
    def window_options(self) -> dict[str, int | str] | None:
        """Options for solving window by window; None if it cannot."""
        return None if self.windowed is None else dict(self.windowed)

    @property
    def options(self) -> dict[str, Any]:
        """The options of ``solve`` that are numbers or words, by name, and their defaults."""
        return {
            name: parameter.default
            for name, parameter in inspect.signature(self.solve).parameters.items()
            if parameter.kind is inspect.Parameter.KEYWORD_ONLY
            and isinstance(parameter.default, int | float | str)
        }

    def parse_options(self, given: Mapping[str, Any] | Sequence[str]) -> dict[str, Any]:
        """Return options by name, each of the type of its default; raises `ProblemError`."""
        if isinstance(given, str) or not isinstance(given, Mapping | Sequence):
            raise ProblemError(f"options {short(given)}: give {{'width': 10}} or ['width=10'], say")
        if not isinstance(given, Mapping):
            given = dict(str(word).partition("=")[::2] for word in given)
        known, out = self.options, dict(given)
        for name, value in out.items():
            where = f"option {name}={value if isinstance(value, str) else short(value)}"
            if name not in known:
                hint, names = did_you_mean(name, known), ", ".join(known) or "no options"
                raise ProblemError(f"{where}: {self.name} has {names}{hint}")
            read, kind, wanted = READ[type(known[name])]
            if isinstance(value, str):
                with suppress(KeyError, ValueError):
                    out[name] = read(value)
            said = out[name]
            if not isinstance(said, kind) or isinstance(said, bool) is not (kind is bool):
                raise ProblemError(f"{where}: {name} is {short(value)}; give {wanted}")
        return out

    @property
    def watched(self) -> bool:
        """Whether ``solve`` takes a `Watch`, and so a time limit."""
        return WATCH in inspect.signature(self.solve).parameters


def formulation_names() -> tuple[str, ...]:
    """Return the names of registered formulations in alphabetical order; none is loaded."""
    return tuple(sorted(plugins(GROUP)))


def formulations(*questions: str) -> dict[str, Formulation]:
    """Return registered formulations: entry points of the group ``seqopt.formulations``.

    Parameters
    ----------
    *questions : str
        What they must answer, of `QUESTIONS`: ``costs`` for those that the loop is compared by.

    Returns
    -------
    dict of str to Formulation
        By name, in alphabetical order.

    Warns
    -----
    PluginWarning
        Of one that cannot be used, which is left out.

    Examples
    --------
    >>> import seqopt
    >>> [name for name, f in seqopt.formulations().items() if f.takes_budgets and f.aim]
    ['labels', 'lagrangian', 'overlap_lp', 'overlap_mip']
    """
    return {name: found for name, found in _loaded(GROUP).items() if found.fits(*questions)}


def exhibits() -> dict[str, Formulation]:
    """Return the exhibits: entry points of the group ``seqopt.exhibits``.

    They solve what `formulations` solve, by programs that are there to be looked at. Comparisons
    leave them out.

    Result: by name, in alphabetical order.
    """
    return _loaded(EXHIBITS)


def _loaded(group: str) -> dict[str, Formulation]:
    """Return the formulations of a group; of one that cannot be used it is warned."""
    out = {}
    for name, entry in sorted(plugins(group).items()):
        try:
            out[name] = _load(entry)
        except ProblemError as error:
            warnings.warn(f"{error}; it is left out", PluginWarning, stacklevel=1)
    return out


def _load(entry: EntryPoint) -> Formulation:
    try:
        found = entry.load()
    except Exception as error:  # foreign code may raise any error
        raise ProblemError(
            f"formulation {entry.name!r}: {entry.value} cannot be loaded: {message_of(error)}; "
            "reinstall it or remove it"
        ) from error
    if not isinstance(found, Formulation):
        raise ProblemError(
            f"formulation {entry.name!r}: {entry.value} is a {type(found).__name__}; "
            "let the entry point name a Formulation"
        )
    kinds: dict[str, Any] = {"name": str, "summary": str, "kind": FormulationKind}
    kinds |= {"answers": tuple, "takes_budgets": bool, "aim": Aim | None, "solve": Callable}
    for field_name, kind in kinds.items():
        value = getattr(found, field_name)
        if not isinstance(value, kind):
            raise ProblemError(
                f"formulation {entry.name!r}: {entry.value} has {type(value).__name__} as "
                f"{field_name}; correct it"
            )
    if unknown := {*found.answers} - {*QUESTIONS}:
        raise ProblemError(
            f"formulation {entry.name!r}: {entry.value} answers {', '.join(map(str, unknown))}; "
            f"give some of {', '.join(QUESTIONS)}"
        )
    return found


def find_formulation(name: str) -> Formulation:
    """Return a formulation by name.

    ``name``: one of `formulation_names`, of an exhibit, or of `ALIASES`. Raises `ProblemError`
    if there is none of that name; the message lists those there are.
    """
    found, known = plugins(EXHIBITS) | plugins(GROUP), formulation_names()
    name = name if name in found else ALIASES.get(name, name)
    if name not in found:
        why = f"does not exist{did_you_mean(name, known)}"
        raise ProblemError(f"formulation {name!r} {why}; give one of {', '.join(known)}")
    return _load(found[name])


def as_formulation(given: object, *questions: str) -> Formulation:
    """Return a formulation, by name or itself.

    ``*questions``: what it must answer, of `QUESTIONS`. Raises `ProblemError` if it is none, or
    answers something else.
    """
    if isinstance(given, str):
        given = find_formulation(given)
    if not isinstance(given, Formulation):
        known = ", ".join(formulations(*questions))
        raise ProblemError(f"a {type(given).__name__} is not a formulation; give one of {known}")
    if not given.fits(*questions):
        asked = next(each for each in questions if not given.fits(each))
        raise ProblemError(
            f"{given.name} is for {given._for}, and {QUESTIONS[asked]} are asked for; "
            f"use {' or '.join(formulations(*questions))}"
        )
    return given


class LabelProof(NamedTuple):
    """Labels of a build in time that show that no path is better in one goal.

    Every successor of a label by one act is a label that another one of these
    dominates, or a bound by multipliers and sums to go says that it is no better.

    ``states`` (N, 1 + c): how many bricks stand, and entries of a state; ``labels`` (N,
    1 + c + q): when the last step ended, since when robots of columns are free, zero where they
    hold, and sums of budgets and of goals before; ``prices`` (L, 1 + c): of the time of all, and of
    the robots of columns.
    """

    states: Ints
    labels: Floats
    prices: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Solution(FrozenValue):
    """A free schedule, and the values and bounds that its formulation claims.

    ``states``: after every step: how many bricks stand, then the node that each robot holds, as a
    place in build order from 1; robots of one kind stand together, 0 for one that is free;
    ``objective``: claimed value of every goal; ``bound``: claimed lower bound of every goal, those
    before it being at their values; ``visited`` (tuple of (n, c) int): states that a better plan
    could pass, by brick count, if the formulation knows them: the proof looks at these together,
    and depends on them in nothing but its time; ``prices``: multipliers by goal, of every budget
    and of every sum before it: they prove the bounds where there are budgets; ``stopped``:
    why the search ended before all was proven: ``time``, ``memory`` or ``interrupt``; empty if it
    did not; ``grips``: where it counts who of a kind acts, after every step the place that each
    robot of the scene holds, 0 for none; ``proofs``: of the makespan and the goals after it, of all
    goals where there are budgets; ``starts``, ``ends``: where mortar cures, when steps start, s,
    and the last one ends; ``motions``: by which labels there are a proof: states fall in them, (b,
    6) in m and rad; ``trace``: what the first goal was known to be at which time;
    ``compile_seconds``: part of the time that went into writing a program down for a solver, s;
    ``order``: names of all bricks, where their order was sought, empty where it is given;
    ``effort``: how many sets of bricks with a newest one, or orders, were looked at for it, and how
    many grip sets were solved in these.
    """

    states: tuple[tuple[int, ...], ...]
    objective: tuple[float, ...]
    bound: tuple[float, ...]
    visited: tuple[Ints, ...] = field(default=(), repr=False)
    prices: tuple[tuple[float, ...], ...] = ()
    stopped: str = ""
    grips: tuple[tuple[int, ...], ...] = ()
    proofs: tuple[LabelProof, ...] = field(default=(), repr=False)
    starts: tuple[float, ...] = ()
    ends: float = 0.0
    motions: tuple[Floats, ...] = field(default=(), repr=False)
    trace: tuple[Finding, ...] = field(default=(), compare=False, repr=False)
    compile_seconds: float = field(default=0.0, compare=False)
    order: Order = ()
    effort: tuple[int, int] = field(default=(0, 0), compare=False)
