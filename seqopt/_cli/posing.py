"""The problem that the words of the command line pose, over scenarios too."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from typing import Any

from seqopt._cli.asked import asked_engine, asked_scene, in_seconds
from seqopt._cli.outputs import require_out
from seqopt._cli.values import (
    asked_criterion,
    asked_resources,
    asked_standing,
    count_word,
    parse_criterion,
    parse_numbers,
    parse_robots,
    parse_rules,
)
from seqopt._cli.words.props import parse_props
from seqopt._cli.words.where import Place, _kept_place, asked_place, between
from seqopt.arms.reach import find_postures
from seqopt.errors import ProblemError, StepError
from seqopt.graph.formulation import On, find_formulation
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.problem._limit_words import parse_limits
from seqopt.problem.problem import (
    Orders,
    Problem,
    RobustAim,
    parse_budgets,
    parse_caps,
    parse_robust,
)
from seqopt.problem.requirements import Criterion
from seqopt.scene._props import Prop
from seqopt.scene.scenarios import MOST, Scenarios, scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE, Direction, FreeRules
from seqopt.sequence.schedule import Schedule, thin
from seqopt.sequence.schedule_file import find_schedule
from seqopt.sequence.steps import StepKind
from seqopt.times._curing import CuringBuilds
from seqopt.times._steps import step_times
from seqopt.workflow import SEARCH, posed

ALONE = ("scenarios", "unseen", "seed", "vary")  # options that mean something with --robust alone
COUNT = 30
SPREADS = ("stiffness", "density", "position", "grips")
_NOT_FREE = "the free schedule has no such; leave it out"
_NOT_STATES = "aims and --stands have no such; leave it out"
_MORE = f"it needs more; give --stands MORTAR, or --schedule {FREE}"
_WRONG = {
    "free": {"ranked": _NOT_FREE, "among": _NOT_FREE},
    "states": {"ranked": _NOT_STATES, "among": _NOT_STATES, "rule": _NOT_STATES},
    "candidates": {
        "rule": f"it needs more; give --schedule {FREE}",
        "tilt": _MORE,
        "friction": _MORE,
    },
}


@dataclass(frozen=True, eq=False, repr=False)
class Asked:
    """What a command is asked for: the problem, the scenarios, and those that judge the plan."""

    scene: Scene
    problem: Problem
    whole: Problem | None = None  # the same from an empty site, if it begins elsewhere
    aim: RobustAim | None = None
    known: Scenarios | None = None
    unseen: Scenarios | None = None
    fewest: tuple[Prop, ...] | None = None  # candidates, where as few props as can be are asked


def fewest_asked(options: argparse.Namespace, scene: Scene) -> tuple[Prop, ...] | None:
    """Return the candidates where as few props as can be are asked; that aim is then taken out."""
    aims = [word.strip() for word in (options.aim or "").split(",")]
    among = getattr(options, "props_among", None)
    if "props" not in aims:
        if among is not None:
            raise ProblemError("--props-among: it goes with --aim props,minmax")
        return None
    wrong = aims[0] != "props" or options.command != "optimize"
    if wrong or scene.props or getattr(options, "bases", None) is not None:
        raise ProblemError(
            "aim props: it comes first, and goes with optimize, without --bases or props that are "
            "given (--props none leaves out those of a scene)"
        )
    options.aim = ",".join(aims[1:]) or "minmax"
    return parse_props(among or "all", scene, "--props-among")


def asked_problem(options: argparse.Namespace) -> Asked:
    """Return the problem that the command ``optimize`` or ``pareto`` is asked for.

    Raises `ProblemError` or `StepError` if words do not go together, naming one.
    """
    of_states = _wants_states(options)
    _require_known(options, of_states=of_states)
    sought = options.order == SEARCH
    options.order = None if sought else options.order
    criterion = _criterion(options, of_states=of_states)
    scene = asked_scene(options)
    if getattr(options, "bases", None) is not None:
        if options.schedule != FREE or options.order is not None or sought:
            raise ProblemError(f"--bases: it goes with --schedule {FREE} in the scene's own order")
        from seqopt.arms._bases import without_arms  # noqa: PLC0415  # few ask for bases

        scene = without_arms(scene)  # bases are chosen afterwards
    scene, begin, end = _asked_ends(options, scene)
    fewest = fewest_asked(options, scene)
    scene = scene if fewest is None else scene.with_props(*fewest)
    if getattr(options, "durations", ()):
        scene = in_seconds(options, scene)
    find_postures(scene, getattr(options, "cache", None), options.tell)
    words: dict[str, Any] = {"limits": parse_limits(options.limit, scene, "--limit")}
    budgets = getattr(options, "budget", [])
    (parse_caps if of_states else parse_budgets)(budgets)  # said before anything is built
    aim = known = unseen = None
    if options.command == "optimize":
        words["resources"] = asked_resources(options, None if of_states else options.tell)
        words["formulation"] = options.formulation
        if options.robust is not None:
            aim = _asked_aim(options)
            known, unseen = _asked_scenarios(options, scene)
            words |= {"scenarios": known, "over": aim}
    require_out(options)
    engine = asked_engine(options, build_network(scene))
    every = _asked_moves(options, engine.network)
    moves = between(every, begin, end)
    words |= {"stands": asked_standing(options), "budgets": budgets}
    words |= {"orders": Orders.TIED} if sought else {}
    problem = posed(engine, moves, criterion, options.aim, **words)
    whole = None
    if begin.site is not None and not hasattr(options, "change"):
        start = between(every, Place(), end)
        whole = posed(engine, start, criterion, options.aim, **words)
    return Asked(scene, problem, whole, aim, known, unseen, fewest)


def _aged(options: argparse.Namespace, scene: Scene, begin: Place) -> Place:
    """Return where a build begins with the ages of bricks, where mortar cures: as the plan was."""
    if not getattr(options, "curing", None) or not begin.done or begin.site is None:
        return begin
    standing = asked_standing(options)
    if standing is None or standing.curing is None:
        return begin
    scene = in_seconds(options, scene) if getattr(options, "durations", ()) else scene
    waits = CuringBuilds(build_network(scene), standing.mortar, standing.curing).waits
    try:
        times = step_times(scene, begin.done, waits)
    except StepError as error:
        raise StepError(f"{error}; or give a STATE.json with the ages of its bricks") from None
    ends = [t.end for t, s in zip(times, begin.done, strict=True) if s.kind is StepKind.PLACE]
    ages = tuple(times[-1].end - end for end in ends)
    return replace(begin, site=replace(begin.site, ages=ages))


def _asked_ends(options: argparse.Namespace, scene: Scene) -> tuple[Scene, Place, Place]:
    """Return where a build begins and ends, and the scene after what has changed."""
    scene, begin = asked_place(options, "from", scene)
    begin = _aged(options, scene, begin)
    if hasattr(options, "change"):
        scene, begin, options.robots = options.change(scene, begin)
    if getattr(options, "keep", None) is not None:
        return _kept_place(options, scene, begin)
    later, end = asked_place(options, "to", scene)
    if later != scene:
        raise StepError(f"--to {options.to}: its bricks are not those that follow in this order")
    return scene, begin, end


def _wants_states(options: argparse.Namespace) -> bool:
    """Return whether states of the build are to be chosen, and not candidates of moves."""
    if options.schedule == FREE or options.aim or options.stands or options.order == SEARCH:
        return True
    named = getattr(options, "formulation", None)
    return named is not None and find_formulation(named).on in (On.STATES, On.ORDERS, On.TIMES)


def _criterion(options: argparse.Namespace, *, of_states: bool) -> Criterion | None:
    """Return the criterion that is asked for; None leaves it to what is posed."""
    if of_states:
        asked = options.criteria is not None
        return parse_criterion(options.criteria, options.crown) if asked else None
    said = (options.criteria, options.crown, options.ranked, options.among)
    return None if said == (None,) * 4 else asked_criterion(options)


def _asked_moves(options: argparse.Namespace, network: Network) -> Schedule | FreeRules:
    """Return the open grips or the rules that a command is asked for."""
    rule = getattr(options, "candidates", None)
    if options.schedule != FREE:
        schedule = find_schedule(network, options.schedule, parse_robots(options.robots))
        return schedule if rule is None else thin(schedule, rule)
    rules = parse_rules(options.rule, parse_robots(options.robots))
    rules = replace(rules, direction=getattr(options, "direction", None) or Direction.BUILD)
    return replace(rules, candidates=rule) if rule else rules


def _require_known(options: argparse.Namespace, *, of_states: bool) -> None:
    """Raise an error if options are given that states, or candidates, do not have."""
    if options.command == "optimize" and options.robust is None:
        for name in ALONE:
            if getattr(options, name):
                raise ProblemError(
                    f"--{name}: plans over scenarios alone have it; give --robust worst-peak, "
                    "worst-total or as cvar=0.9"
                )
    free = options.schedule == FREE
    _require_direction(options, free=free)
    for name, why in _WRONG["free" if free else "states" if of_states else "candidates"].items():
        if getattr(options, name, None):
            raise ProblemError(f"--{name}: {why}")


def _require_direction(options: argparse.Namespace, *, free: bool) -> None:
    """Raise an error if a take-down is asked for that does not go with the rest."""
    down, keep = Direction.TAKE_DOWN.value, getattr(options, "keep", None)
    asked = getattr(options, "direction", None)
    if asked == down and not free:
        raise ProblemError(f"--direction {down}: it goes with --schedule {FREE}")
    if keep is not None and asked != down:
        raise ProblemError(f"--keep {keep}: it goes with --direction {down}")


def _asked_aim(options: argparse.Namespace) -> RobustAim:
    try:
        return parse_robust(options.robust)
    except ProblemError as error:
        raise ProblemError(f"--robust: {error}") from error


def _asked_scenarios(
    options: argparse.Namespace, scene: Scene
) -> tuple[Scenarios, Scenarios | None]:
    """Return the scenarios to choose by, and those of the next seed that judge if any are to."""
    count = count_word(options.scenarios, "--scenarios", MOST, usual=COUNT)
    seed, other = count_word(options.seed, "--seed", MOST, least=0), None
    if options.unseen is not None:
        other = count_word(options.unseen, "--unseen", MOST)
    known = _drawn(scene, options, count, seed)
    return known, None if other is None else _drawn(scene, options, other, seed + 1)


def _drawn(scene: Scene, options: argparse.Namespace, count: int, seed: int) -> Scenarios:
    asked = parse_numbers("--vary", options.vary, SPREADS, zero=True, advice=", as stiffness=3")
    factor = asked.pop("stiffness", 3.0)
    grips = asked.pop("grips", 1.0)
    for name, each in (("stiffness", factor), ("grips", grips)):
        if each < 1:
            raise ProblemError(f"--vary {name}={each:g}: give a factor from 1")
    if grips > 1 and scene.grip_kinds.rigid:
        raise ProblemError(f"--vary grips={grips:g}: they are rigid; say how stiff with --grips")
    drawn = scenarios(scene, stiffness=(1 / factor, factor), count=count, seed=seed, **asked)
    return drawn if grips == 1 else drawn.with_grips((1 / grips, grips))
