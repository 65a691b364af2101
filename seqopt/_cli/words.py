"""Words of the command line: those for options, and values that several options make.

`SPREAD` says which parameters are made of several words. An option that a table names has one
meaning in all commands.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from seqopt.engines.registry import ENGINES
from seqopt.errors import ProblemError
from seqopt.graph.formulation import formulation_names
from seqopt.scene.scenarios import MOST
from seqopt.scene.scene_file import builtin_scenes, find_scene
from seqopt.sequence.methods import METHODS, SCHEDULES
from seqopt.sequence.part import Part
from seqopt.stability.standing import find_standing
from seqopt.stability.verdict import ASSESSED
from seqopt.study import CRITERIA, PUBLISHED
from seqopt.workflow import Robust, Search

File: TypeAlias = Annotated[Path | None, ("value", "FILE")]
Folder: TypeAlias = Annotated[Path | None, ("value", "DIR")]

MOST_WORKERS = 1024
QUESTIONS = {
    "What is built, and by whom?": "scene folder list export order grips props payload "
    "durations robots",
    "Which steps may a build have?": "schedule method plan begin to direction rules reassign",
    "What has changed?": "at lost missing measured",
    "What counts as best?": "criterion aim rounding speed reference",
    "What must hold?": "stands friction tilt curing limits budgets",
    "What is asked beside verdicts?": "margins map holds",
    "In which scenarios is it good?": "measure count seed vary",
    "Who chooses and proves, and how long?": "formulation candidates options proof time_limit "
    "workers max_memory",
    "How are responses computed?": "engine mortar tolerance cache",
    "What does the file not say?": "unit up density supports",
    "Which joints are made?": "law gap accept_overlaps",
    "What is written and printed?": "out name below figures stability details quiet json",
}
"""Options by the question that they answer, in the order in which help asks them."""
FLAGS = {
    "begin": "from",
    "bounds": "bound",
    "budgets": "budget",
    "count": "scenarios",
    "law": "stiffness",
    "limits": "limit",
    "measure": "robust",
    "options": "option",
    "rounding": "round",
    "rules": "rule",
}  # words for options that are not their names
VALUES = dict(
    re.findall(
        r"(\w+)=(\S+)",
        """
        grips=STIFFNESS props=NODES payload=NEWTON durations=WORDS curing=WORDS robots=N|NAME,NAME
        criterion=NAME formulation=NAME name=NAME format=NAME margins=NAMES holds=NAMES
        aim=NAME,NAME rules=NAME=VALUE vary=NAME=VALUE options=NAME=VALUE over=NAME=VALUES
        rounding=NAME=STEP limits=LIMIT budgets=BUDGET stands=MORTAR friction=F tilt=DEG
        schedule=NAME|FILE begin=PLAN:STEP|N
        to=PLAN:STEP|N direction=build|take-down measure=AIM count=N seed=N workers=N
        candidates=RULE time_limit=SECONDS max_memory=SIZE plan=FILE source=FILE bounds=FILE
        cache=DIR measured=FILE at=STEP lost=ROBOT missing=BRICK below=VALUE
        """,
    )
)
"""Words for the values of options, if not their names."""
HOW: dict[str, dict[str, Any]] = {
    "engine": {"choices": lambda: ENGINES},
    "method": {"choices": (*METHODS, PUBLISHED)},
    "friction": {"zero": True},
    "tilt": {"zero": True, "unit": "degrees"},
    "density": {"unit": "kg/m³"},
    "distance": {"unit": "m"},
    "gap": {"unit": "m"},
    "robots": {"parse": lambda text: int(text) if text.isdecimal() else named(text)},
    "time_limit": {"zero": True, "unit": "seconds"},
    "at": {"least": 0, "most": 1_000_000},
    "count": {"most": MOST},
    "seed": {"least": 0, "most": MOST},
    "scene": {"names": builtin_scenes, "usual": "arch25"},
    "schedule": {"names": lambda: SCHEDULES},
    "criterion": {"names": lambda: CRITERIA},
    "formulation": {"names": formulation_names},
    "margins": {"names": lambda: ASSESSED},
}  # what a parser knows of options beside their types; names are what help lists
HIDDEN = ("executor", "made_by", "prover", "scenes")  # that Python alone says


def named(text: str) -> tuple[str, ...]:
    """Return names with commas between them."""
    return tuple(name.strip() for name in text.split(","))


def given_steps(
    *, method: str | None = None, plan: Annotated[Path | None, ("value", "FILE")] = None
) -> Path | str | None:
    """Return the file of steps that are given, or their method.

    Parameters
    ----------
    method : str, optional
        How it is built: by two robots, or published, the three-robot plan that Bruun et al. print
        for arch25 (default: the first of sequential, cantilever that fits, or the steps of a plan's
        folder).
    plan : pathlib.Path, optional
        A plan's folder, or a CSV file of steps: step, type, bricks, NAME_node of each robot.
    """
    if method is not None and plan is not None:
        text = "not allowed with --plan; leave one of them out"
        raise ProblemError(f"--method {method}: {text}")
    return plan or method


SPREAD: dict[str, Callable[..., Any]] = {
    "scene": find_scene,
    "schedule": Part,
    "steps": given_steps,
    "stands": find_standing,
    "robust": Robust,
    "search": Search,
}
"""By parameter, what makes a value of several words."""
