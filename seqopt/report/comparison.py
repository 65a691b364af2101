"""Every method and formulation on one scene, beside the published plan; as text."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from seqopt.arms._kept import arm_faults
from seqopt.arrays import Terse
from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import simplest
from seqopt.errors import (
    MechanismError,
    NothingFoundError,
    ProblemError,
    SeqoptError,
    StepError,
    TimeUpError,
)
from seqopt.graph.formulation import Formulation, Run, find_formulation, formulations
from seqopt.plan.plan import Plan
from seqopt.plan.solve import _solve_run, graph_of, on_the_way, pose, solve
from seqopt.problem.criteria import WORST_OVER_METHODS, Criterion, RankSum, WorstRatio
from seqopt.problem.problem import Aim, Problem
from seqopt.problem.requirements import _prop_faults, overloads
from seqopt.report._regret._measure import measure_regret
from seqopt.report._regret._table import RegretTable
from seqopt.responses._grip_sets import Resources
from seqopt.responses._tolerance import COLUMN, is_tolerance
from seqopt.responses.quantities import CHOSEN_BY, RESPONSES, robot_response
from seqopt.responses.table import (
    Departure,
    Enough,
    LinearRange,
    _steps_in_table,
    analyze,
    force_column,
    what_was_enough,
)
from seqopt.scene.scene import Scene
from seqopt.sequence.methods import METHODS, modified_sequential
from seqopt.sequence.part import MOST, find_schedule
from seqopt.sequence.rules import FREE, FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step, _idle_note
from seqopt.stability.failure_map import BuildProver, BuildVerdicts
from seqopt.stability.verdict import Verdict
from seqopt.study import (
    IRREGULARITIES,
    PUBLISHED,
    is_reference_arch,
    printed_maxima,
    published_plan,
)
from seqopt.work import Clock, Stage, Tell

LARGEST = {"F_rob": "N", "M_sup": "N m", "T_max": "N", "D_max": "1e-3 mm"}
MARKS, COST = ["overloaded", "outside"], ["models", "seconds", "solve_seconds"]
COLUMNS = ["problem", "objective", "gap", *LARGEST, *MARKS, *COST]
CLOSED = "no choice"  # the problem of a sequence without open grips
PATIENCE = 10.0  # s, after which the best plan so far is the row


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Terse):
    """Methods and formulations side by side.

    Attributes
    ----------
    maxima : pandas.DataFrame
        A row per quantity (with its unit), a column per method without a choice, and the published
        plan: the largest value of any step.
    printed : pandas.DataFrame or None
        The same as the paper prints it, for its own arch only.
    table : pandas.DataFrame
        A row per method or formulation: the ``problem`` it solves (rows of different problems do
        not compete), ``objective`` and ``gap`` to the exact optimum of its aim; the largest
        ``F_rob`` [N], ``M_sup`` [N m], ``T_max`` [N] and ``D_max`` [1e-3 mm] of any step, whether a
        robot is ``overloaded`` and results are ``outside`` the linear range, how many ``models`` it
        looks at, the ``seconds`` that it took alone, ``solve_seconds`` of them to choose, and how
        many steps fall, as ``falls_dry``.
    tables, departures, verdicts : mapping of str
        By row of ``table``: the responses of every step; the limits of the linear range that are
        left; which steps stand, with each mortar that was asked for.
    notes : tuple of str
        Methods that degenerate, robots that never grip, payloads exceeded, and inconsistencies in
        the paper's own numbers.
    refusal : str
        Why the scene has no loop of its robots; empty if it has.
    criteria : mapping of str to Criterion
        With all of their numbers, by the problem whose rows they are the objective of.
    enough : Enough
        Which model was enough for all steps, and what more detailed ones would change.
    speed : RegretTable or None
        How long every way to a plan takes, and what its plan costs in the most detailed model: its
        ``sentence`` says which to take, ``plot()`` draws its ``table``. None if it was not asked.
    """

    maxima: pd.DataFrame
    printed: pd.DataFrame | None
    table: pd.DataFrame
    tables: Mapping[str, pd.DataFrame]
    notes: tuple[str, ...]
    refusal: str
    departures: Mapping[str, tuple[Departure, ...]]
    criteria: Mapping[str, Criterion]
    verdicts: Mapping[str, tuple[BuildVerdicts, ...]]
    enough: Enough
    speed: RegretTable | None = None


def compare(
    engine: Engine,
    criterion: Criterion,
    progress: Tell = lambda _: None,
    robots: Sequence[str] = (),
    prover: BuildProver | None = None,
    speed: float = 0.0,
    reference: str = "",
    mortar: Mortar | None = None,
) -> Comparison:
    """Analyze every method on an engine's scene and solve its usual loop by every formulation.

    Parameters
    ----------
    engine, criterion, progress : Engine, Criterion, callable
        Computes responses, and has the scene; the cost of a step; called with the progress.
    robots : sequence of str, optional
        Of those that take part, as many as a method needs; found from reach by default.
    prover : BuildProver, optional
        Says which steps stand; by default dry, and with epoxy.
    speed : float, optional
        Seconds in all, to set the speed of every way to a plan against what its plan costs.
    reference : str, optional
        The engine that values these plans; by default the most detailed one with data.
    mortar : Mortar, optional
        With which every step of these plans has to stand.

    Returns
    -------
    Comparison
    """
    asked, engine = engine, simplest(engine)
    scene, (tables, notes, refused) = engine.network.scene, method_tables(engine, robots)
    maxima = _maxima(scene, tables)
    in_paper = bool(tables) and is_reference_arch(scene)
    printed = printed_maxima().set_axis(maxima.index) if in_paper else None
    rows: dict[str, dict[str, object]] = {name: {"problem": CLOSED} for name in tables}
    fixed = [largest(scene, table) for table in tables.values()]
    whole, part = Clock(speed or math.inf), speed / 4 or math.inf
    plans, problem, refusal, late = _plans(engine, criterion, progress, robots, Clock(part))
    tables |= {name: plan.responses() for name, plan in plans.items()}
    rows |= {name: _row(plan) for name, plan in plans.items()}
    if problem is not None and PUBLISHED in rows and not robots:
        rows[PUBLISHED] |= _published_row(problem, plans.values())
    run = Run(PATIENCE, progress, clock=Clock(part))
    free, why = _free_plan(engine, criterion, fixed, robots, run)
    if not tables and free is None:  # the first refusal says most
        raise type(refused[0])(f"{refused[0]}; {why[0]}")
    notes += why + late
    criteria: dict[str, Criterion] = {}
    if problem is not None:
        loop_name = problem.method
        notes += _idle_note(scene, f"{loop_name} loop", problem.schedule.steps)
        criteria[loop_name] = problem.criterion
    if free is not None:
        tables[FREE], rows[FREE] = free.responses(), _row(free)
        criteria[FREE] = free.states.criterion
    prover = prover or BuildProver(engine.network, progress=progress)
    verdicts = prover.of_builds({name: _steps_in_table(scene, t) for name, t in tables.items()})
    left = (within := LinearRange(engine)).of_builds(tables)
    table, faults = _table(scene, rows, tables, left, verdicts)
    notes += faults
    notes += [f"In the paper: {text}" for text in IRREGULARITIES] if in_paper else []
    measured = None
    if speed:
        how: dict[str, Any] = {"reference": reference, "mortar": mortar, "progress": progress}
        how |= {"rules": FreeRules(robots=tuple(robots)), "seconds": max(whole.left, speed / 2)}
        try:
            measured = measure_regret(asked, criterion, **how)
        except NothingFoundError as error:
            notes.append(str(error))
    found = (maxima, printed, table, tables, tuple(notes), refusal, left)
    enough = what_was_enough(within, tables)
    return Comparison(*found, criteria, verdicts, enough, measured)


def _maxima(scene: Scene, tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the largest value of any step, a row per quantity, a column per build."""
    grips = {force_column(robot): f"{robot_response(robot.name)} [N]" for robot in scene.robots}
    others = {RESPONSES[name].column: f"{name} [{LARGEST[name]}]" for name in [*LARGEST][1:]}
    worst = {
        name: pd.concat([own[[*grips]].abs(), own[[*others]]], axis=1).max()
        for name, own in tables.items()
    }
    return pd.DataFrame(worst).rename(grips | others)


def _table(
    scene: Scene,
    rows: dict[str, dict[str, object]],
    tables: Mapping[str, pd.DataFrame],
    left: Iterable[str],
    verdicts: Mapping[str, Sequence[BuildVerdicts]],
) -> tuple[pd.DataFrame, list[str]]:
    """Return rows with the largest responses, and the payloads that are exceeded, in words.

    They say which of them leave the linear range (``left``), and how many steps fall.
    """
    notes: list[str] = []
    for name, steps in tables.items():
        over = overloads(scene, steps)
        rows[name].update(largest(scene, steps), overloaded=bool(over))
        faults = arm_faults(scene, _steps_in_table(scene, steps))
        notes += [f"{name}: {fault}" for fault in (*over, *_prop_faults(scene, steps), *faults)]
    table = pd.DataFrame.from_dict(rows, orient="index").reindex(columns=COLUMNS)
    falls = {
        name: {f"falls_{each.mortar}": each.count(Verdict.FALLS) for each in found}
        for name, found in verdicts.items()
    }
    table = table.assign(outside=table.index.isin([*left]))
    return table.join(pd.DataFrame.from_dict(falls, orient="index")), notes


def _plans(
    engine: Engine, criterion: Criterion, progress: Tell, robots: Sequence[str], clock: Clock
) -> tuple[dict[str, Plan], Problem | None, str, list[str]]:
    """Return plans by formulation, the loop's problem, or why there is none, and who was late."""
    network = engine.network
    count = len(robots) or min(len(network.scene.robots), MOST)
    plans, late = dict[str, Plan](), list[str]()

    def solved(schedule: Schedule, named: Mapping[str, Formulation]) -> Problem:
        problem = pose(engine, schedule, criterion, resources=Resources(progress=progress))
        for done, (name, formulation) in enumerate(named.items()):
            progress(Stage("comparing", (done + 1) / (len(named) + 1)))
            late.append(name)
            with suppress(TimeUpError):
                plan = on_the_way(_solve_run(problem, formulation, Run(clock=clock)))
                if plan.certificate is not None:
                    plans[late.pop()] = plan
        return problem

    try:
        loop = find_schedule(network, robots=robots)  # it says most
        if count >= MOST:
            cascade = {"modified-sequential": find_formulation("cascade")}
            solved(modified_sequential(network, robots[:3]), cascade)
        problem = solved(loop, formulations("costs"))
    except (StepError, ProblemError) as error:
        return {}, None, str(error), []
    return plans, problem, "", [f"left out, for lack of time: {', '.join(late)}"] * bool(late)


def largest(scene: Scene, table: pd.DataFrame) -> dict[str, float]:
    """Return the largest responses in a table of `seqopt.analyze`, by the names of `LARGEST`.

    In its units; ``F_rob`` is the largest force of any grip of the scene's robots.
    """
    forces = table[[force_column(robot) for robot in scene.robots]].abs()
    worst = {name: float(table[RESPONSES[name].column].max()) for name in [*LARGEST][1:]}
    return {"F_rob": float(np.nanmax(forces.to_numpy(float))), **worst}


def _published_row(problem: Problem, plans: Iterable[Plan]) -> dict[str, object]:
    """Return what the published plan is worth in a problem, and its gap to the best bound."""
    from seqopt.judge._schedules import plan_values  # noqa: PLC0415  # with its proofs

    loop = graph_of(problem, Aim.SUM)
    (value,) = plan_values(loop, published_plan(problem.scene))
    alike = (p for p in plans if (p.method, p.goals) == (loop.method, loop.names))
    bounds = (p.certificate.bound for p in alike if p.certificate is not None)
    bound = max(bounds, default=np.nan)  # nothing is proven for lack of time
    gap = (value - bound) / (abs(value) or 1.0)
    return {"problem": problem.method, "objective": value, "gap": gap}


def _row(plan: Plan) -> dict[str, object]:
    """Return the objective of a plan, and the seconds that it alone took; for a free one all."""
    models, seconds = plan.models, sum(plan.seconds.values())
    if plan.method == FREE:
        bound, value = plan.selection.bound[0], plan.selection.objective[0]
        gap = (value - bound) / (abs(value) or 1.0)  # without weight all responses are zero
    else:
        assert plan.certificate is not None  # asked for
        value, gap = plan.certificate.objective, plan.certificate.gap
        if plan.formulation.windowed == ():  # alone it needs fewer
            again: Problem = plan.problem  # type: ignore[assignment]  # of a comparison
            models = solve(replace(again), plan.formulation, proof=False).models
        seconds = sum(plan.seconds[stage] for stage in ("compile", "solve", "verify"))
    about = {"problem": plan.method, "objective": value, "gap": gap, "models": models}
    return about | {"seconds": seconds, "solve_seconds": plan.seconds["solve"]}


def method_tables(
    engine: Engine, robots: Sequence[str] = ()
) -> tuple[dict[str, pd.DataFrame], list[str], list[StepError | MechanismError]]:
    """Return the responses of every method without open grips, and of the published plan.

    ``robots``: names of those that take part, the first two of which are taken. Results: tables as
    of `seqopt.analyze`; notes, first why other methods cannot build the scene; and their errors.
    """
    scene = engine.network.scene
    tables, built = dict[str, pd.DataFrame](), dict[str, tuple[Step, ...]]()
    refusals, notes, refused = list[str](), list[str](), list[StepError | MechanismError]()
    for name, method in METHODS.items():
        try:
            steps = method(engine.network, robots[:2])
            tables[name] = analyze(engine, steps)
        except (StepError, MechanismError) as error:
            refusals.append(f"{name}: not possible here; {error}")
            refused.append(error)
            continue
        if alike := [other for other, own in built.items() if own == steps]:
            notes.append(f"{name}: it is the {alike[0]} method here")
        built[name] = steps
        notes += _idle_note(scene, name, steps)
    if tables and is_reference_arch(scene):
        tables[PUBLISHED] = analyze(engine, published_plan(scene))
    return tables, refusals + notes, refused


def _free_plan(
    engine: Engine,
    criterion: Criterion,
    fixed: Sequence[Mapping[str, float]],
    robots: Sequence[str],
    run: Run,
) -> tuple[Plan | None, list[str]]:
    """Return the shortest free schedule with the smallest worst step, or why there is none.

    States have no ranks: in their place is the worst ratio to the largest responses of the fixed
    methods, so that below 1 the free schedule is better than all of them in everything.
    """
    if isinstance(criterion, RankSum) and not fixed:
        criterion = WORST_OVER_METHODS  # of none: over what the scene itself says
    elif isinstance(criterion, RankSum):
        units = {"D_max": 1e-6}  # m of 1e-3 mm
        least = {n: units.get(n, 1.0) * min(r[n] for r in fixed) or 1.0 for n in LARGEST}
        limits = [("F_largest", least.pop("F_rob")), *least.items()]
        criterion = WorstRatio("worst-ratio-to-rows", tuple(limits))
    try:
        problem = pose(engine, FreeRules(robots=tuple(robots)), criterion, "minmax,steps")
        plan = _solve_run(problem, "schedule_search", run)
    except SeqoptError as error:
        return None, [f"{FREE}: {error}"]
    return on_the_way(plan), []


def _in_shown_unit(value: pd.Series[float] | float, name: str) -> pd.Series[float] | float:
    """Return a number of a Pareto set, SI units, in the unit in which it is shown."""
    if name == "tilt":
        return value * (-180.0 / np.pi) + 90.0
    if name == "bond":
        return value / 1e3
    if is_tolerance(name):
        return 1e3 / value
    return value * CHOSEN_BY[name].scale if name in CHOSEN_BY else value


def shown_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table of a Pareto set with the tilt that is survived and tolerances, in units."""
    names = {name: COLUMN for name in map(str, table) if is_tolerance(name)}
    names |= {"tilt": "tilt_survived_deg"} if "tilt" in table else {}
    return table.assign(**{n: _in_shown_unit(table[n], n) for n in names}).rename(columns=names)


_STANDING = (
    "Proven as rigid bricks whose joints may open and slide, robots within their payload. First: "
    "the step that falls first, the brick that is fastest in it, and the joint that opens fastest."
)
_CHOICES = (
    "of minimax its largest step, of the free schedule too, or where the criterion has ranks its "
    "worst response over the least that the fixed sequences reach. Compare objectives only within "
    "a heading and an aim. Gap: how far the objective is above its optimum. Models: how many "
    "partial structures with different grips it looks at. Seconds: to choose and to check."
)
NAME = 21  # columns of a name
HEADS = {
    "F_rob": ("grip", "force, N", 15),
    "M_sup": ("support", "moment, N m", 14),
    "T_max": ("", "tension, N", 14),
    "D_max": ("displacement,", "µm", 14),
}  # above each column of responses, and how wide it is
OF_PAPER = "In the paper: "  # with which notes about it begin
MODIFIED = "modified-sequential"
TITLES = {
    CLOSED: "fixed sequences, nothing to choose",
    MODIFIED: "modified sequential method, some grips chosen",
    FREE: "free schedule: any robot may place, hold or release next",
}  # above the rows of a problem


def format_comparison(
    comparison: Comparison, scene: Scene, criterion: Criterion, width: int = 80
) -> str:
    """Return a comparison as ``seqopt compare`` prints it.

    Parameters
    ----------
    comparison : Comparison
        What to tell.
    scene : Scene
        Which was compared.
    criterion : Criterion
        With which the formulations were compared.
    width : int
        Columns that text is wrapped to.

    Returns
    -------
    str
        Of many lines.
    """
    blocks = [
        [f"{scene.name}: {len(scene.bricks)} bricks, {len(scene.robots)} robots"],
        ["Largest response of any step", *_responses(comparison), "", _about(comparison)],
    ]
    if comparison.refusal:
        blocks.append([f"Loop of robots: not possible here; {comparison.refusal}"])
    if comparison.verdicts:
        blocks.append(["Steps that fall", *_stands(comparison), "", _STANDING])
    if comparison.table["objective"].notna().any():
        about = (
            f"Objective: what the criterion {criterion.name} adds up to over all steps; {_CHOICES}"
        )
        blocks.append(["How the grips were chosen", *_choices(comparison), "", about])
    for heading, of_paper in (("Notes", False), ("Inconsistencies in the paper", True)):
        lines = [text for text in comparison.notes if text.startswith(OF_PAPER) == of_paper]
        if lines:
            blocks.append([heading, *(f"- {text.removeprefix(OF_PAPER)}" for text in lines)])

    def wrapped(line: str) -> str:
        if "  " in line:  # a row of a table
            return line
        rest = "  " * line.startswith("- ")
        how: Any = {"break_long_words": False, "break_on_hyphens": False}
        return textwrap.fill(line, width, subsequent_indent=rest, **how)

    return "\n\n".join("\n".join(map(wrapped, block)) for block in blocks)


def _rows(
    table: pd.DataFrame, figures: Mapping[Any, object], cells: Callable[[str], str]
) -> Iterator[str]:
    """Yield headings, and below each a line for every name.

    Of names with the same figures the plainest has a line, which says how many more there are.
    """
    found = formulations()

    def plainness(name: str) -> tuple[bool, bool, str]:
        if (own := found.get(name)) is None:
            return False, False, name
        return own.kind.value != "exact", own.takes_budgets, name

    for problem, rows in table.groupby("problem", sort=False):
        yield TITLES.get(str(problem), f"{problem} loop, grips chosen by a formulation")
        names, same = [*map(str, rows.index)], dict[object, list[str]]()
        for name in sorted(names, key=plainness):
            same.setdefault(figures[name], []).append(name)
        for name, *more in sorted(same.values(), key=lambda own: names.index(own[0])):
            label = f"  {name}{f' +{len(more)}' if more else ''}"
            yield f"{label:{NAME}}{cells(name)}".rstrip()


def _responses(comparison: Comparison) -> Iterator[str]:
    """Yield the table of the largest responses."""
    for line in (0, 1):
        heads = (f"{names[line]:>{names[2]}}" for names in HEADS.values())
        yield f"{'':{NAME}}{''.join(heads)}".rstrip()

    def cells(name: str) -> str:
        row, paper, out = comparison.table.T[name], _printed_largest(comparison, name), ""
        marks = {"F_rob": "!" if row["overloaded"] else " ", "D_max": "?" * bool(row["outside"])}
        for response, (_, _, width) in HEADS.items():
            value = float(row[response])
            text = f"{value:.1f}" if abs(value) < 1e4 else f"{value:,.0f}"
            text += f" ({paper[response]:.1f})" if response in paper else ""
            out += f"{text + marks.get(response, ''):>{width}}"
        return out

    figures = comparison.table[[*HEADS]].astype(float).round(3).apply(tuple, axis=1).to_dict()
    yield from _rows(comparison.table, figures, cells)


def _stands(comparison: Comparison) -> Iterator[str]:
    """Yield the table of the steps that fall."""
    first, *_ = comparison.verdicts.values()
    heads = "".join(f"{each.mortar:>9}" for each in first)
    yield f"{'':{NAME}}{'steps':>5}{heads}   first, {first[0].mortar}".rstrip()

    def cells(name: str) -> str:
        shown, *_ = found = comparison.verdicts[name]
        out = f"{len(shown.verdicts):5}"
        for each in found:
            open_ = each.count(Verdict.UNDECIDED)
            out += f"{each.count(Verdict.FALLS)}{f' ({open_}?)' if open_ else ''}".rjust(9)
        where = f"step {shown.first}: brick {shown.brick}" if shown.first else ""
        return f"{out}   {where}{f', joint {shown.joint}' if shown.joint else ''}"

    yield from _rows(comparison.table, comparison.verdicts, cells)


def _printed_largest(comparison: Comparison, name: str) -> dict[str, float]:
    """Return the largest responses of a method as the paper prints them, in its units, if any."""
    if comparison.printed is None or name not in comparison.maxima:
        return {}
    column = list(comparison.maxima).index(name)  # printed ones have names of their own
    quantity = [str(text).partition(" [")[0] for text in comparison.maxima.index]
    values = dict(zip(quantity, comparison.printed.to_numpy(float)[:, column], strict=True))
    forces = [value for key, value in values.items() if key not in HEADS]
    found = {key: value for key, value in values.items() if key in HEADS}
    return {"F_rob": float(np.nanmax(forces)), **found}


def _about(comparison: Comparison) -> str:
    text = (
        "Grip force: of any robot. Support moment: at any ground end. Tension: in any edge of "
        "the network of bricks and joints. Displacement: of any node."
    )
    if comparison.table["overloaded"].astype(bool).any():
        text += " !: a robot holds more than its payload."
    if comparison.departures:
        text += " ?: outside the linear range, not reliable."
    if comparison.printed is not None:
        text += " In brackets: what Bruun et al. print."
    if " +" in "".join(_responses(comparison)):
        text += " +1, +2 …: so many other methods or formulations reach the same figures."
    return text


def _choices(comparison: Comparison) -> Iterator[str]:
    """Yield the table of objectives and times of formulations."""
    kinds = {name: found.kind.value for name, found in formulations().items()}
    kinds |= {MODIFIED: kinds.get("cascade", ""), FREE: "exact"}
    yield f"{'':{NAME}}{'objective':>10}{'gap':>9}{'steps':>7}{'models':>9}{'seconds':>9}  kind"
    chosen = comparison.table[comparison.table["objective"].notna()]

    def cells(name: str) -> str:
        row, steps = chosen.loc[name], len(comparison.tables[name])
        models, seconds = (
            format(row[column], form) if np.isfinite(row[column]) else "-"
            for column, form in (("models", ",.0f"), ("seconds", ".3f"))
        )
        return (
            f"{row['objective']:10.2f}{100 * row['gap']:7.2f} %{steps:7}"
            f"{models:>9}{seconds:>9}  {kinds.get(name, 'in print')}"
        )

    yield from _rows(chosen, {name: name for name in chosen.index}, cells)
