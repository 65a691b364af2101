"""Words of the command line: commands that are right, and how they go wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from seqopt.placement.formulation import formulation_names
from seqopt.sequence.two_robots import METHODS

COMMANDS = ("scene", "analyze", "optimize", "assess", "compare")
QUICK = ("compliance", "frame", "planar", "auto")  # hundreds of grip sets in a moment
SHARES = (0.3, 0.3, 0.25, 0.1, 0.05)  # of the commands


def pick(rng: np.random.Generator, things: Sequence[Any]) -> Any:
    """Return one of several things."""
    return things[int(rng.integers(len(things)))]


def right_words(rng: np.random.Generator, *, plan: bool) -> tuple[str, ...]:
    """Return a command that is right."""
    steps = ["analyze", "assess"]
    command = str(rng.choice(steps if plan else COMMANDS, p=(0.85, 0.15) if plan else SHARES))
    return (command, "scene.json", *MORE[command](rng, plan))


def _engine(rng: np.random.Generator) -> list[str]:
    """Return an engine for a few grip sets."""
    engine = pick(rng, (*QUICK, "discrete"))
    mortar = ["--mortar", "dry"] if engine in ("auto", "discrete") and rng.random() < 0.3 else []
    return ["--engine", engine, *mortar] if rng.random() < 0.5 else []


def _steps(rng: np.random.Generator, plan: bool) -> list[str]:  # noqa: FBT001  # one of two
    return ["--plan", "plan.csv"] if plan else ["--method", pick(rng, tuple(METHODS))]


def _out(rng: np.random.Generator, name: str) -> list[str]:
    return ["--out", name] if rng.random() < 0.7 else []


def _strict(rng: np.random.Generator) -> list[str]:
    return ["--strict"] if rng.random() < 0.2 else []


def _optimize(rng: np.random.Generator, _: object) -> list[str]:
    schedule = pick(rng, ("three-robot", "modified-sequential"))
    criterion = pick(rng, ("equations-2-3", "worst-ratio", "T_max,M_sup=2", "F_each", "D_max"))
    limit = pick(rng, ([], [], ["--limit", "payload"], ["--limit", "T_max=1e3"]))
    formulation = pick(rng, formulation_names())
    return [
        *("--formulation", formulation, "--schedule", schedule, "--criteria", criterion),
        *(*limit, "--out", "out", "--engine", pick(rng, QUICK), *_strict(rng)),
    ]


MORE: dict[str, Callable[[np.random.Generator, bool], list[str]]] = {
    "scene": lambda rng, _: ["--export", "out.json"] if rng.random() < 0.5 else [],
    "analyze": lambda rng, plan: [
        *(*_steps(rng, plan), *_engine(rng), *_out(rng, "out.csv"), *_strict(rng)),
        *(["--fields", "out.npz"] if rng.random() < 0.2 else []),
    ],
    "optimize": _optimize,
    "assess": lambda rng, plan: [
        *(*_steps(rng, plan), *_out(rng, "out.csv")),
        *(["--mortar", "dry"] if rng.random() < 0.5 else []),
    ],
    "compare": lambda rng, _: _strict(rng),
}
WRONG_WORDS = (
    *("--out", "--plan", "--limit", "--option", "--criteria", "--export", "--fields", "--no-proof"),
    *("scene.json", "plan.csv", "out/deep/er", "/dev/null", "/dev/full", "/nowhere/out", ".", ""),
    *("width=0", "width=-3", "width=10000000", "horizon=2", "charge=later", "F_rob1=1", "F_sup=1"),
    *("T_max=nan", "T_max=1e-320", "payload", "1e400", "-1", "\udcff", "\x1b[31m", "x" * 5000),
    *("--friction", "--cohesion", "--tensile-strength", "1e-300", "1e300", "--strict", "--help"),
)


def wrong_words(rng: np.random.Generator, words: tuple[str, ...]) -> tuple[str, ...]:
    out = list(words)
    for _ in range(int(rng.integers(1, 4))):
        at = int(rng.integers(len(out) + 1))
        what = int(rng.integers(3))
        if what == 0 and at < len(out):
            out[at] = pick(rng, WRONG_WORDS)
        elif what == 1 and at < len(out):
            del out[at]
        else:
            out.insert(at, pick(rng, WRONG_WORDS))
        if not out:
            return ("scene",)
    return tuple(out)
