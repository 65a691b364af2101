"""What commands are asked: frozen values, whose docstrings are the help of the command line.

A class names its question first; then every option that it has, the word for its value, and the
help. `seqopt._cli.arguments` makes parsers of them, `seqopt.doors` functions of Python. A field
that no docstring of a command describes has its default there, and is no option of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, dataclass, field
from pathlib import Path
from typing import Any

from seqopt.engines.registry import DEFAULT, ENGINES
from seqopt.graph.formulation import formulation_names
from seqopt.plan.build import ShownBuild
from seqopt.problem.criteria import Ranked
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import builtin_scenes
from seqopt.sequence.three_robots import SCHEDULES
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import MARGINS
from seqopt.study.published import CRITERIA, PUBLISHED
from seqopt.work.progress import Tell

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
    """Return a field of which a parser knows more: ``choices``, ``place``, ``const``.

    ``place``: it stands without dashes; ``const``: what it is where no value follows. What has no
    default must be given.
    """
    return field(metadata=how) if default is MISSING else field(default=default, metadata=how)


def _unheard(_: object) -> None:
    """Let nobody know how far a command is."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is written and printed?

    quiet :
        print errors and the paths of what is written, nothing else
    json :
        print one JSON document, for scripts
    """

    quiet: bool = False
    json: bool = False
    out: Path | None = None
    cache: Path | None = None
    tell: Tell = _unheard
    words: Sequence[str] = ()
    taken: list[str] = field(default_factory=list)  # notes on what is taken where nothing is asked


@dataclass(frozen=True, kw_only=True)
class Strict(Asked):
    """What is written and printed?

    strict :
        end with exit status 1 if a robot would exceed its payload in a step, or results leave the
        linear range
    """

    strict: bool = False


@dataclass(frozen=True, kw_only=True)
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

    scene: Scene | ShownBuild | Path | str = word("arch25", place=True)
    order: str | None = None
    grips: str | None = None
    props: str | None = None
    payload: tuple[str, ...] = ()
    robots: str = ""


@dataclass(frozen=True, kw_only=True)
class Team(Built):
    """What is built, and by whom?

    robots : N|NAME,NAME
        how many robots there are (those of the scene first, further ones reach every node), or the
        names of those that take part where the steps leave that open; in the order in which they
        place their first bricks (default: the first of the scene whose reach allows the build)
    """


@dataclass(frozen=True, kw_only=True)
class Timed(Asked):
    """What is built, and by whom?

    durations : WORDS
        how long robots take, s: fetch=30,place=10,approach=10,grip=5,release=5 or speed=0.2 (m/s,
        of ways between grips); that is to bring the next brick, to place it, to come to one that
        stands, to grip it, to let go; who is free fetches and approaches while others act; of one
        robot with its name before, as rob3:fetch=75 or rob3:slower=2.5 (default: as the scene says)
    """

    durations: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Postures(Asked):
    """How are responses computed?

    cache : DIR
        where robots have arms: keep their postures there, and use what is there
    """


@dataclass(frozen=True, kw_only=True)
class Fixed(Team):
    """Which steps may a build have?

    method : CHOICE
        how it is built: by two robots, or {published}, the three-robot plan that Bruun et al. print
        for arch25 (default: the first of {methods} that fits, or the steps of a plan's folder)
    plan : FILE
        a plan's folder, or a CSV file of steps: step, type, bricks, NAME_node of each robot
    """

    method: str | None = word(None, choices=(*METHODS, PUBLISHED))
    plan: Path | ShownBuild | None = None


@dataclass(frozen=True, kw_only=True)
class Cost(Asked):
    """What counts as best?

    criteria : NAME
        what a step costs: equations-2-3 (of Bruun et al.), worst-ratio (over the least worst of
        fixed methods), or responses to rank with weights, as T_max,M_sup=2,F_move; all names:
        {criteria} (default: equations-2-3; with --aim, --stands or --schedule free worst-ratio)
    crown : BRICKS
        for criteria of ranks: how many bricks are placed at the crown of an arch, or none (default:
        derived from the scene)
    ranked : CHOICE
        for criteria of ranks: where two open grips meet in a step, rank all pairs of their nodes
        together, or only the pairs with the node chosen before (default: pairs)
    """

    criteria: str | None = None
    crown: str | None = None
    ranked: str | None = word(None, choices=[each.value for each in Ranked])


@dataclass(frozen=True, kw_only=True)
class Stands(Asked):
    """What must hold?

    stands : MORTAR
        every state must be proven to stand, robots within payload: dry, epoxy or bond=STRENGTH (Pa)
    friction : F
        with --stands: coefficient of friction
    tilt : DEG
        with --stands: tilt that every state must survive
    """

    stands: Any = None
    friction: str | None = None
    tilt: str | None = None
    curing: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Cured(Stands):
    """What must hold?

    curing : WORDS
        with --stands: which share of its bond mortar has at an age: 15min (in proportion, full
        then), 0s=0.005,5min=0.4,15min=1 (what is reached when), never; of one joint with its name
        before, as 5-6:30min. What is let go waits for it (default: full at once)
    """


@dataclass(frozen=True, kw_only=True)
class Computed(Asked):
    """How are responses computed?

    engine : CHOICE
        what computes responses (default: {engine}): compliance: exactly rigid bricks, fast; planar:
        the same with three unknowns per brick, where all lies in a plane; frame: stiff bars, a slow
        independent check; discrete: joints that open and slip; auto: the cheapest of planar,
        compliance and discrete that is enough
    mortar : MORTAR
        what holds the joints, in verdicts and in the engines auto and discrete: epoxy, that of
        Bruun et al. (default), dry, nothing, or bond=STRENGTH (Pa)
    """

    engine: str | None = word(None, choices=(*ENGINES,))
    mortar: Any = None
    no_stability: bool = True


@dataclass(frozen=True, kw_only=True)
class Judged(Computed):
    """What is written and printed?

    no_stability :
        do not prove which steps stand, dry and with epoxy (or the mortar of --stands or --mortar):
        quicker
    """

    no_stability: bool = False


@dataclass(frozen=True, kw_only=True)
class Rules(Asked):
    """Which steps may a build have?

    rule : NAME=VALUE
        what robots may do: least_grips=N (2, or 1 of two robots, from the second brick on),
        newest=either|placing|free (where the newest brick is held), regrips=N|any (between two
        bricks), placers=NAME,NAME|any, payload=kept|ignored, ending=held|released|one-by-one (how
        robots leave the finished structure), candidates=near:JOINTS|within:METERS|all (as
        --candidates)

    What must hold?
    limit : LIMIT
        what no step may exceed: payload (of every robot), or RESPONSE=VALUE in SI units, as
        F_largest=300; also where no grip is open. Plans keep the linear range wherever one does:
        linear_range=any lifts that, 0.5 asks for half of it in every step
    """

    rule: tuple[str, ...] = ()
    limit: tuple[Any, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Aimed(Asked):
    """What counts as best?

    aim : NAME,NAME
        what is to be as small as possible, the most important first: minmax (the worst step), sum,
        steps, regrips, travel, makespan (time), a response, as T_max, and others; these are props
        (how many are needed, at which nodes), bond, friction, tilt, and sum(RESPONSE); the worst
        step is by the criterion, by default worst-ratio, and a makespan needs --durations (default:
        minmax with --schedule free; with others the total of what their moves cost); with --order
        search the best order of the bricks is found too

    Who chooses and proves, and how long?
    time_limit : SECONDS
        limit of the whole command, of choosing, proof and verdicts: the best choice by then is
        written with its bound, and what there was no time for is named; with --no-proof, where
        choosing and computing are one, the moves that were chosen by then
    """

    aim: str | None = None
    time_limit: str | None = None


@dataclass(frozen=True, kw_only=True)
class Posed(Judged, Stands, Rules, Team):
    """Which steps may a build have?

    --rule and --direction go with --schedule free alone, --keep with --direction take-down and not
    with --to.

    begin : PLAN:STEP|STATE|N
        where the build begins: after a step of a plan (its folder or CSV file); in a state of a
        JSON file (bricks that stand, by names or how many, grips by robot, ages of bricks in s
        where mortar cures, else just placed); or with so many bricks that nobody holds
    to : PLAN:STEP|STATE|N
        where it ends, said in the same ways; a number of bricks leaves grips to the rule ending
    direction : build|take-down
        with --schedule free: take-down removes bricks, the newest first, from the whole structure
        to the empty site, if nothing else is said
    keep : BRICK,BRICK
        with --direction take-down: bricks that stay, as 1..12
    """

    schedule: Any = None
    begin: str | None = word(None, flag="--from")
    to: str | None = None
    direction: Any = None
    keep: str | None = None
    # what optimize alone has
    durations: tuple[str, ...] = ()
    aim: str | None = None
    criteria: Any = None
    crown: str | None = None
    ranked: str | None = None
    budget: tuple[str, ...] = ()
    robust: str | None = None
    scenarios: str | None = None
    unseen: str | None = None
    seed: str | None = None
    vary: tuple[str, ...] = ()
    formulation: str | None = None
    candidates: str | None = None
    workers: str = "1"
    max_memory: str | None = None
