"""The command ``completion``: a script for shell completion.

The script is generated once, by shtab, and holds all names: completion then needs no start of
Python.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator
from hashlib import sha256
from typing import Any, Literal

import shtab

from seqopt._cli.answer import Answer
from seqopt._cli.arguments import parser
from seqopt._registry import every_command
from seqopt.graph.formulation import formulation_names
from seqopt.responses._choices import CHOICE_RESPONSES
from seqopt.scene.scene import ORDERS
from seqopt.scene.scene_file import KINDS, builtin_scenes
from seqopt.sequence.methods import SCHEDULES
from seqopt.sequence.rules import FREE, RULES
from seqopt.study.published import CRITERIA

AIMS = ("minmax", "sum", "steps", "regrips", "travel", "bond", "friction", "tilt")
SHORT = re.compile(r"[:;(]|, (?:as|if|or) ")  # where what matters of a help text ends


def run(shell: Literal["bash", "zsh", "fish"]) -> Answer[None]:
    """Print a script with which the shell completes words of seqopt.

    It completes commands, options, files, and the names of scenes, formulations, criteria, engines,
    schedules and aims. Print it again once a formulation of your own is installed.

    Parameters
    ----------
    shell : str
        Which shell reads it.

    Examples
    --------
    $ eval "$(seqopt completion bash)"      in ~/.bashrc, or for this shell alone
    $ eval "$(seqopt completion zsh)"       in ~/.zshrc, after compinit
    $ seqopt completion fish > ~/.config/fish/completions/seqopt.fish
    """
    script = shtab.complete(_completed(parser()), shell)
    return Answer(facts={"shell": shell, "script": script}, data=script + "\n")


def _completed(whole: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Add completions to the arguments of the parser, in place, and return it."""
    known = {name: words(names) for name, names in _names().items()}
    known |= {
        "scene": words([*builtin_scenes(), *(f"{kind}:" for kind in KINDS)], files=True),
        "schedule": words([*SCHEDULES, FREE], files=True),
    }
    folder = shtab.DIRECTORY
    paths: dict[Any, object] = {"DIR": folder, "PLAN_DIR": folder, "FILE": shtab.FILE}
    about = {name: each.line for name, each in every_command().items()}
    for command in _commands(whole):
        command.description = about[command.prog.split()[-1]]
        for action in command._actions:
            if found := known.get(action.dest, paths.get(action.metavar)):
                action.complete = found  # type: ignore[attr-defined]
            if action.help and action.help != argparse.SUPPRESS:
                action.help = SHORT.split(action.help)[0]
    return whole


def _commands(whole: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    for action in whole._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.values()


def _names() -> dict[str, list[str]]:
    """Return the names that arguments accept, by destination."""
    responses = [*CHOICE_RESPONSES]
    return {
        "formulation": [*formulation_names()],
        "criterion": [*CRITERIA, *responses],
        "aim": [*AIMS, *responses],
        "pick": [*responses, "steps", "regrips"],
        "limits": ["payload", *responses],
        "order": [*ORDERS, "search"],
        "stands": ["dry", "epoxy", "bond="],
        "robust": ["worst-peak", "worst-total", "cvar="],
        "vary": ["stiffness=", "density=", "position="],
        "budgets": ["travel=", "steps_over:", "robot_use:"],
        "candidates": ["near:", "within:"],
        "rules": [f"{name}=" for name in RULES],
    }


def words(names: Iterable[str], *, files: bool = False) -> dict[str, object]:
    """Return shtab's completion of given words, with ``files`` also of paths, by shell."""
    listed = " ".join(names)
    name = f"_seqopt_{sha256(listed.encode()).hexdigest()[:8]}"
    more = '; compgen -f -- "$1"' if files else ""
    also = " 'files:file:_files'" if files else ""
    path = "; __fish_complete_path (commandline -ct)" if files else ""
    zsh = listed.replace(":", "\\:")
    return {
        "bash": name,
        "zsh": name,
        "fish": f"(printf '%s\\n' {listed}{path})",
        "preamble": {
            "bash": f'{name}() {{ compgen -W "{listed}" -- "$1"{more}; }}',
            "zsh": f"{name}() {{ _alternative 'names:name:({zsh})'{also} }}",
        },
    }
