"""Options that several commands share: frozen values that a function takes spread.

A class names its question first; then every option that it has, the word for its value, and the
help. `seqopt._cli.signatures` makes parsers of them, `seqopt.doors` functions of Python: a field is
annotated with what these take, and is in words once it was parsed. Options that are described but
have no field concern the output alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field
from math import inf
from pathlib import Path
from typing import Any, TypeAlias, dataclass_transform

from seqopt.contact.mortar import Mortar
from seqopt.engines.registry import DEFAULT, ENGINES
from seqopt.graph.formulation import formulation_names
from seqopt.plan.build import ShownBuild
from seqopt.problem.criteria import Ranked
from seqopt.problem.requirements import Criterion, Limit
from seqopt.problem.standing import Standing
from seqopt.scene.scenarios import MOST
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import builtin_scenes
from seqopt.sequence.methods import METHODS, SCHEDULES
from seqopt.sequence.rules import FreeRules
from seqopt.stability.assessment import MARGINS
from seqopt.study.published import CRITERIA, PUBLISHED
from seqopt.work.progress import Tell

File: TypeAlias = Path | str
BuiltFrom: TypeAlias = Scene | ShownBuild | Path | str
Number: TypeAlias = float | str
Words: TypeAlias = Sequence[str] | str
Numbers: TypeAlias = Mapping[str, float] | Sequence[str] | str
Bricks: TypeAlias = Sequence[int | str] | int | str
Limits: TypeAlias = Sequence[Limit | str] | Limit | str
Rules: TypeAlias = FreeRules | Sequence[str] | str
Stability: TypeAlias = Standing | Mortar | str

MOST_WORKERS = 1024
NAMES: dict[str, Callable[[], Iterable[str]]] = {  # what stands in braces in the help
    "criteria": lambda: CRITERIA,
    "engine": lambda: [DEFAULT],
    "formulations": formulation_names,
    "margins": lambda: MARGINS,
    "methods": lambda: METHODS,
    "published": lambda: [PUBLISHED],
    "scenes": builtin_scenes,
    "schedules": lambda: SCHEDULES,
}


def word(default: Any = MISSING, **how: Any) -> Any:
    """Return a field of which a parser knows more: ``choices``, ``flag``, ``const``.

    ``const``: what it is where no value follows; ``zero``: whether a number may be zero, ``least``
    and ``most``: bounds of a whole one; ``advice``: beside what is wrong with it; ``shell``:
    whether Python has a value in its place. What has no default must be given. The field of an
    argument without dashes is no keyword, so that type checkers see it as functions have it.
    """
    return field(metadata=how) if default is MISSING else field(default=default, metadata=how)


def listed(values: Any) -> tuple[Any, ...]:
    """Return the words of an option that may be repeated, once `given` has read it."""
    return tuple(values)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is written and printed?

    quiet :
        print errors and the paths of what is written, nothing else
    json :
        print one JSON document, for scripts
    """

    progress: Tell | None = None

    def __init_subclass__(cls) -> None:
        """Turn every subclass into a frozen dataclass with keyword-only fields."""
        dataclass(frozen=True, kw_only=True)(cls)

    @property
    def tell(self) -> Tell:
        """The progress callback; by default it ignores reports."""
        return self.progress or (lambda _: None)


class Strict(Asked):
    """What is written and printed?

    strict :
        end with exit status 1 if a robot would exceed its payload in a step, or results leave the
        linear range
    """


class Written(Asked):
    """What is written and printed?

    out : DIR
        folder to write
    """

    out: File | None = None

    @property
    def path(self) -> Path | None:
        """Where it goes."""
        return None if self.out is None else Path(self.out)


class Built(Asked):
    """What is built, and by whom?

    scene : SCENE
        a built-in scene ({scenes}), a JSON file, a plan's folder, or words as
        arch:span=2,rise=0.8 (default: arch25); seqopt scene --list shows all
    order : ORDER
        in which order bricks are placed, if not in the scene's own: reversed, ends (from all ground
        ends at once), sides (course by course, from both ends of each to its middle), or the names
        of all bricks, as 1..12,25..13
    grips : STIFFNESS
        how stiff the grips of all robots are, if not as the scene says: rigid, or N/m, as 1e6, or
        three along its axes, as 1e6x1e6x5e5; turning=N m/rad after a comma keeps held bricks from
        turning
    props : NODES
        nodes that props hold beside the robots, if not as the scene says, until the finished
        structure is let go: as 13,27, or every, one at each brick as centering has; N/m after a
        colon if they are not rigid, as every:1e6; then push for such as only push up, and
        capacity=N
    payload : NEWTON
        what every robot may carry, N, if not as the scene says; of one robot with its name before,
        as rob1=250
    """

    scene: BuiltFrom = field(default="arch25", kw_only=False, metadata={"place": True})
    order: Bricks | None = None
    grips: Number | None = None
    props: Bricks | None = None
    payload: float | Numbers = ()


class Team(Asked):
    """What is built, and by whom?

    robots : N|NAME,NAME
        how many robots there are (those of the scene first, further ones reach every node), or the
        names of those that take part where the steps leave that open; in the order in which they
        place their first bricks (default: the first of the scene whose reach allows the build)
    """

    robots: int | Words | None = None


class Timed(Asked):
    """What is built, and by whom?

    durations : WORDS
        how long robots take, s: fetch=30,place=10,approach=10,grip=5,release=5 or speed=0.2 (m/s,
        of ways between grips); that is to bring the next brick, to place it, to come to one that
        stands, to grip it, to let go; who is free fetches and approaches while others act; of one
        robot with its name before, as rob3:fetch=75 or rob3:slower=2.5 (default: as the scene says)
    """

    durations: Words = ()


class Postures(Asked):
    """How are responses computed?

    cache : DIR
        where robots have arms: keep their postures there, and use what is there
    """

    cache: File | None = None


class Fixed(Written, Postures, Team, Built):
    """Which steps may a build have?

    method : CHOICE
        how it is built: by two robots, or {published}, the three-robot plan that Bruun et al. print
        for arch25 (default: the first of {methods} that fits, or the steps of a plan's folder)
    plan : FILE
        a plan's folder, or a CSV file of steps: step, type, bricks, NAME_node of each robot
    """

    method: str | None = word(None, choices=(*METHODS, PUBLISHED))
    plan: ShownBuild | File | None = None


class Ranks(Asked):
    """What counts as best?

    criterion : NAME
        what a step costs: equations-2-3 (of Bruun et al.), worst-ratio (over the least worst of
        fixed methods), or responses to rank with weights, as T_max,M_sup=2,F_move; all names:
        {criteria} (default: equations-2-3; with --aim, --stands or --schedule free worst-ratio)
    ranked : CHOICE
        for criteria of ranks: where two open grips meet in a step, rank all pairs of their nodes
        together, or only the pairs with the node chosen before (default: pairs)
    """

    criterion: Criterion | str | None = word(None, flag="--criteria")
    ranked: str | None = word(None, choices=[each.value for each in Ranked], shell=True)


class Stands(Asked):
    """What must hold?

    stands : MORTAR
        every state must be proven to stand, robots within payload: dry, epoxy or bond=STRENGTH (Pa)
    friction : F
        with --stands: coefficient of friction
    tilt : DEG
        with --stands: tilt that every state must survive
    """

    stands: Stability | None = None
    friction: float | None = word(None, zero=True, shell=True)
    tilt: float | None = word(None, zero=True, shell=True)


class Cured(Stands):
    """What must hold?

    curing : WORDS
        with --stands: which share of its bond mortar has at an age: 15min (in proportion, full
        then), 0s=0.005,5min=0.4,15min=1 (what is reached when), never; of one joint with its name
        before, as 5-6:30min. What is let go waits for it (default: full at once)
    """

    curing: Words = ()


class Computed(Asked):
    """How are responses computed?

    engine : CHOICE
        what computes responses (default: {engine}): compliance: exactly rigid bricks, fast; frame:
        stiff bars, a slow independent check; discrete: joints that open and slip; auto: compliance,
        and discrete where that is not enough
    mortar : MORTAR
        what holds the joints, in verdicts and in the engines auto and discrete: epoxy, that of
        Bruun et al. (default), dry, nothing, or bond=STRENGTH (Pa)
    """

    engine: str | None = word(None, choices=(*ENGINES,))
    mortar: Mortar | str | None = None


class Judged(Computed):
    """What is written and printed?

    stability :
        do not prove which steps stand, dry and with epoxy (or the mortar of --stands or --mortar):
        quicker
    """

    stability: bool = True


class Aimed(Asked):
    """Which steps may a build have?

    rules : NAME=VALUE
        what robots may do: least_grips=N (2, or 1 of two robots, from the second brick on),
        newest=either|placing|free (where the newest brick is held), regrips=N|any (between two
        bricks), placers=NAME,NAME|any, payload=kept|ignored, ending=held|released|one-by-one (how
        robots leave the finished structure), candidates=near:JOINTS|within:METERS|all (as
        --candidates)

    What must hold?
    limits : LIMIT
        what no step may exceed: payload (of every robot), or RESPONSE=VALUE in SI units, as
        F_largest=300; also where no grip is open. Plans keep the linear range wherever one does:
        linear_range=any lifts that, 0.5 asks for half of it in every step

    What counts as best?
    aim : NAME,NAME
        what is to be as small as possible, the most important first: minmax (the worst step), sum,
        steps, regrips, travel, makespan (time), a response, as T_max, and others; these are bond,
        friction, tilt, and sum(RESPONSE); the worst step is by the criterion, by default
        worst-ratio, and a makespan needs --durations (default: minmax with --schedule free; with
        others the total of what their moves cost); with --order
        search the best order of the bricks is found too
    """

    aim: Words | None = None
    rules: Rules = word((), flag="--rule")
    limits: Limits = word((), flag="--limit")


class Limited(Asked):
    """Who chooses and proves, and how long?

    time_limit : SECONDS
        limit of the whole command, of choosing, proof and verdicts: the best choice by then is
        written with its bound, and what there was no time for is named; with --no-proof, where
        choosing and computing are one, the moves that were chosen by then
    """

    time_limit: float = word(inf, zero=True)


class Moves(Judged, Aimed, Stands, Team, Built):
    """Which steps may a build have?

    --rule and --direction go with --schedule free alone.

    schedule : NAME|FILE
        free: any robot may release, hold or place next, or a sequence with open grips: {schedules}
        (of all robots), or a CSV file of steps; open grips are marked ? in it (default: the loop of
        three robots, or of two where there is no third)
    begin : PLAN:STEP|STATE|N
        where the build begins: after a step of a plan (its folder or CSV file); in a state of a
        JSON file (bricks that stand, by names or how many, grips by robot, ages of bricks in s
        where mortar cures, else just placed); or with so many bricks that nobody holds
    to : PLAN:STEP|STATE|N
        where it ends, said in the same ways; a number of bricks, of a take-down those that stay,
        leaves grips to the rule ending
    direction : build|take-down
        with --schedule free: take-down removes bricks, the newest first, from the whole structure
        to the empty site, if nothing else is said
    """

    schedule: str | Path | None = None
    begin: str | None = word(None, flag="--from", shell=True)
    to: int | str | None = word(None, shell=True)
    direction: str | None = word(None, shell=True)


class Chosen(Ranks, Timed, Moves):
    """In which scenarios is it good?

    --scenarios, --seed and --vary go with --robust alone.

    robust : AIM
        what is to be as small as possible over all scenarios, in place of --formulation: worst-peak
        (the largest cost of any step), worst-total (the largest total), or cvar=0.9 (the mean total
        of the worst tenth)
    scenarios : N
        how many samples of the scene (default: 30)
    seed : N
        which samples are drawn (default: 0)
    vary : NAME=VALUE
        how far samples are from the scene: stiffness=3 (of each joint, by a factor up to it, up or
        down), density=0.1 (of each brick, up to this share), position=0.002 (of each brick and
        joint, up to so many m); these are the defaults; grips=2 (of grips that are not rigid, by a
        factor up to it)

    What must hold?
    budgets : BUDGET
        cap on a total over the build, with the formulations labels, lagrangian, overlap_mip and
        overlap_lp: travel=0.8 (of what the optimum without budgets travels), travel=3.5m,
        steps_over:F_largest=250:10 (at most 10 steps over 250 N), robot_use:rob1=100:5 (at most 5
        in which rob1 carries over 100 N); with --aim or --schedule free: steps=N, regrips=N,
        travel=3.5m, makespan=600s or sum(RESPONSE)=VALUE

    Who chooses and proves, and how long?
    formulation : NAME
        which mathematical program chooses: {formulations} (default: overlap_dp, which is exact and
        the fastest, labels with --budget, minimax with --robust worst-peak, scenario_search with
        other aims over scenarios; schedule_search with --aim, --stands or --schedule free,
        makespan_labels where a makespan counts, order_search with --order search)
    candidates : RULE
        look at fewer nodes per move: near:12 for those at most 12 joints from the newest bricks,
        within:1.5 for those at most 1.5 m from them; makes any formulation a heuristic (free: of
        grips on bricks that stand; what is proven holds among these)
    workers : N
        processes to share the work among; pays from about ten seconds (default: {default})
    cache : DIR
        where robots have arms: keep their postures there, and use what is there
    max_memory : SIZE
        what responses and costs may take, as 500MB or 2GB (default: four fifths of what is free);
        of a free schedule states and moves, with a bound where it ends
    """

    robust: str | None = word(None, shell=True)
    scenarios: int | None = word(None, most=MOST, shell=True)
    seed: int = word(0, least=0, most=MOST, shell=True)
    vary: Numbers = word((), shell=True)
    budgets: Words = word((), flag="--budget")
    formulation: str | None = None
    candidates: str | None = None
    workers: int = word(1, most=MOST_WORKERS, shell=True)
    cache: File | None = word(None, shell=True)
    max_memory: str | None = word(None, shell=True)
