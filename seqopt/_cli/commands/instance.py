"""The command ``instance``: write the graph of a problem, for any solver."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from math import inf
from pathlib import Path

from seqopt._cli import inputs, outputs
from seqopt._cli.answer import Answer, Result
from seqopt._cli.commands.optimize import Optimize
from seqopt._cli.posing import pose_problem
from seqopt.errors import ProblemError
from seqopt.graph.formulation import find_formulation
from seqopt.graph.instance import Instance as Graph
from seqopt.instances._files import WRITERS, save_instance
from seqopt.instances.compiled import compile_instance
from seqopt.judge.arithmetic import first_stage
from seqopt.work.progress import Clock

SAID = ("--quiet", "--json")


class Instance(Optimize):
    """What is written and printed?

    out : FILE
        file to write: .npz (the instance) or .mps (a program);
        without an end a folder with both
    name : NAME
        what it is called (default: as the file)
    below : VALUE
        leave out states of which the first aim, a worst step, takes more; plans that are better
        than this stay
    """

    name: str | None = None
    below: float = inf
    made_by: Sequence[str] = ()  # words of the shell


def run(asked: Instance) -> Result:
    """Write the graph of a problem: its nodes and arcs, what they take, what is small and capped.

    Reading it needs no scene. The options are those of optimize; what concerns the search
    alone has no effect.

    Usage
    [SCENE] [--out FILE] [options of optimize]

    Examples
    --------
    seqopt instance arch25 --out arch25.npz
    seqopt instance arch25 --budget travel=0.8 --out arch25.mps
    seqopt instance chain:bricks=7 --schedule free --aim minmax,steps --out chain7
    """
    path = asked.path
    if path and path.suffix not in ("", *WRITERS):
        raise ProblemError(f"--out {path}: give a name with {', '.join(WRITERS)}, or a folder")
    clock = Clock(asked.time_limit)
    with clock.needed("posing the problem"):
        problem = pose_problem(asked).problem
    named = None if asked.formulation is None else find_formulation(asked.formulation)
    asked.tell("computing all that arcs take")
    aim = None if named is None else named.aim
    facts = {"made_by": _command_line(asked.made_by)} if asked.made_by else {}
    usual = inputs.file_name(problem.scene.name, ".npz")
    name = asked.name or (
        path.stem if path else usual.stem if asked.made_by else problem.scene.name
    )
    with clock.needed("writing down the graph"):
        found = compile_instance(problem, name=name, aim=aim, below=asked.below, facts=facts)
    return Result(found, lambda: _answer(asked, found, path or usual))


def _answer(asked: Instance, found: Graph, path: Path) -> Answer:
    """Write an instance, to a path that is no input, and return its answer."""
    asked.tell("writing the instance")
    outputs.keep_apart(asked, path)
    save_instance(found, path)
    limited = ", ".join(f"{name} {most:g}" for name, _, most in first_stage(found).limited)
    lines = [f"{found!r}".strip("<>"), *([f"capped: {limited}"] if limited else [])]
    lines += [f"written to {path}; seqopt judge {path} SOLUTION checks an answer"]
    notes = (
        () if asked.path else (f"file: {path}; --out names another, or a folder for every format",)
    )
    return Answer(facts=found.facts_of(), text="\n".join(lines), written=(path,), notes=notes)


def _command_line(words: Sequence[str]) -> str:
    """Return the command line without options of output."""
    kept = list[str]()
    left = iter(words)
    for word in left:
        if word == "--out":
            next(left, None)
        elif word not in SAID and not word.startswith("--out="):
            kept.append(word)
    return shlex.join(["seqopt", *kept])
