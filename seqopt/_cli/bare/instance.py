"""The command ``instance``: write the graph of a problem, for any solver."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path

from seqopt._cli.answer import Answer
from seqopt._cli.commands import optimize
from seqopt._cli.options import WRITTEN, declare
from seqopt._cli.outputs import keep_apart
from seqopt._cli.posing import asked_problem
from seqopt._cli.screens import question
from seqopt._cli.values import parse_time_limit
from seqopt._cli.words.given import file_name, take
from seqopt.errors import ProblemError
from seqopt.graph.formulation import find_formulation
from seqopt.instances._files import WRITERS, save_instance
from seqopt.instances.compiled import compile_instance
from seqopt.judge._claims import first_stage
from seqopt.problem._limit_words import number_word
from seqopt.work._clock import Clock

DESCRIPTION = (
    "Write the graph of a problem: its nodes and arcs, what they take, what is to be small and "
    "what is capped. Whoever reads it needs no scene. The options are those of optimize; what "
    "concerns the search alone is left aside."
)
USAGE = ("[SCENE] [--out FILE] [options of optimize]",)
EXAMPLES = (
    "seqopt instance arch25 --out arch25.npz",
    "seqopt instance arch25 --budget travel=0.8 --out arch25.mps",
    "seqopt instance chain:bricks=7 --schedule free --aim minmax,steps --out chain7",
)
SAID = ("--quiet", "--json")
OUT = (
    "file to write: .npz (the instance), .mps, .lp or .pbtxt (a program, the last for CP-SAT); "
    "without an end a folder with all of them"
)


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``instance``: those of ``optimize``, and how it is written."""
    optimize.add_arguments(command)
    out = next(action for action in command._actions if action.dest == "out")
    out.metavar, out.help = "FILE", OUT
    about = {
        "--name NAME": "what it is called (default: as the file)",
        "--below VALUE": "leave out states of which the first aim, a worst step, takes more; "
        "plans that are better than this stay",
    }
    declare(question(command, WRITTEN), about)


def run(options: argparse.Namespace) -> Answer:
    """Write the instance of the problem that is asked for."""
    path = options.out and Path(options.out)
    if path and path.suffix not in ("", *WRITERS):
        raise ProblemError(f"--out {path}: give a name with {', '.join(WRITERS)}, or a folder")
    if options.bases is not None:
        raise ProblemError("--bases: an instance is of one scene; leave it out")
    below = number_word(options.below, "--below") if options.below is not None else float("inf")
    options.out, options.command = None, "optimize"
    clock = Clock(parse_time_limit(options.time_limit))
    with clock.needed("posing the problem"):
        problem = asked_problem(options).problem
    if path is None:
        path = file_name(problem.engine.network.scene.name, ".npz")
        take(options, f"file: {path}; --out names another, or a folder for every format")
    named = None if options.formulation is None else find_formulation(options.formulation)
    options.tell("computing all that arcs take")
    aim = None if named is None else named.aim
    facts = {"made_by": _made_by(options.words)}
    name = options.name or path.stem
    with clock.needed("writing down the graph"):
        instance = compile_instance(problem, name=name, aim=aim, below=below, facts=facts)
    options.tell("writing the instance")
    keep_apart(options, path)
    save_instance(instance, path)
    limited = ", ".join(f"{name} {most:g}" for name, _, most in first_stage(instance).limited)
    lines = [f"{instance!r}".strip("<>"), *([f"capped: {limited}"] if limited else [])]
    lines += [f"written to {path}; seqopt judge {path} SOLUTION checks an answer"]
    return Answer(facts=instance.facts_of(), text="\n".join(lines), written=(path,))


def _made_by(words: Sequence[str]) -> str:
    """Return the command without where it writes and what it prints."""
    kept = list[str]()
    left = iter(words)
    for word in left:
        if word == "--out":
            next(left, None)
        elif word not in SAID and not word.startswith("--out="):
            kept.append(word)
    return shlex.join(["seqopt", *kept])
