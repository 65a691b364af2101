"""Options of commands, derived from the signatures and docstrings of their functions.

A command is a function. Its parameters are its options: of a type and a default, with a help text
in the docstring, under the question that it answers. A parameter that takes a subclass of `Asked`,
a frozen value of options that belong together, is spread into the fields of that class.
"""

from __future__ import annotations

import argparse
import inspect
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

from seqopt._cli.grammar import parse_count
from seqopt._cli.options import MOST_WORKERS, NAMES, Asked
from seqopt._cli.terminal import columns, wrapped
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.requirements import number_word

QUESTIONS = (
    "What is built, and by whom?",
    "Which steps may a build have?",
    "What counts as best?",
    "What must hold?",
    "What is asked beside verdicts?",
    "In which scenarios is it good?",
    "Who chooses and proves, and how long?",
    "How are responses computed?",
    "What is written and printed?",
)  # in the order in which help asks them, after those of one command
OWN = "What is it about?"  # of options under no question
TOGETHER = ({"quiet", "json"}, {"method", "plan"}, {"list", "export", "view"})  # one of each
PATHS = ("FILE", "DIR", "FOLDER", "PLAN_DIR", "INSTANCE", "SOLUTION")
PATH = re.compile(r"(?:pathlib\.)?Path|.*\bFile\b")  # what is annotated so is a path
OPTION = re.compile(r"(\w+) :(?: (\S.*))?")
PLAIN = ("Usage", "Examples", "Parameters", "Returns", "Raises")


@dataclass(frozen=True)
class Option:
    """An option: its type as text, its default, what a parser knows of it, and its help."""

    name: str
    kind: str = "bool"
    default: Any = False
    more: Mapping[str, Any] = field(default_factory=dict)
    question: str = ""
    value: str = ""  # the word for its value; a switch has none
    help: str = ""

    @property
    def flag(self) -> str:
        """Its word on the command line."""
        name = f"no-{self.name}" if self.default is True else self.name
        return str(self.more.get("flag", f"--{name.replace('_', '-')}"))

    @property
    def choices(self) -> tuple[str, ...]:
        """The words that it may have; none where any word may be."""
        choices = self.more.get("choices", ())
        return tuple(choices() if callable(choices) else choices)

    def add_to(self, parser: Any) -> None:
        """Add it to a parser: as a switch if it has no value, repeated if it is a tuple."""
        more, default = self.more, self.default
        text = self.help.replace("{choices}", ", ".join(self.choices))
        how: dict[str, Any] = {"help": text, "default": None if default is MISSING else default}
        if not self.value:
            how["action"] = "store_false" if default is True else "store_true"
        else:
            how["metavar"] = None if self.value == "CHOICE" else self.value
            how |= {"choices": self.choices} if self.choices else {}
            how |= {"type": Path} if self.value in PATHS else {}
        if isinstance(default, tuple):
            how |= {"action": "append", "default": [], "help": f"{text}; may be repeated"}
        if "const" in more:
            how |= {"nargs": "?", "const": more["const"]}
        if "place" in more:
            how |= {} if default is MISSING else {"nargs": "?"}
            parser.add_argument(self.name, **how)
        else:
            parser.add_argument(self.flag, dest=self.name, required=default is MISSING, **how)

    def parse(self, value: Any) -> Any:
        """Parse a value as of the command line; other Python objects stay unchanged."""
        if isinstance(value, bool) or value is self.default:
            return value
        if isinstance(self.default, tuple):
            if isinstance(value, Mapping):
                value = [f"{name}={_text(each)}" for name, each in value.items()]
            several = isinstance(value, Sequence) and not isinstance(value, str)
            return tuple(map(_text, value if several else [value]))
        if self.kind in ("float", "float | None"):
            try:
                return number_word(str(value), self.flag, zero=self.more.get("zero", False))
            except ProblemError as error:
                raise ProblemError(f"{error}{self.more.get('advice', '')}") from None
        if self.kind in ("int", "int | None"):
            least, most = self.more.get("least", 1), self.more.get("most", MOST_WORKERS)
            return parse_count(value, self.flag, most, least)
        text, choices = _text(value), self.choices
        if choices and text not in choices:
            hint, known = did_you_mean(text, choices), ", ".join(choices)
            raise ProblemError(f"{self.name} {text!r} does not exist{hint}; give {known}")
        return Path(text) if PATH.match(self.kind) and isinstance(text, str) else text


def _text(value: Any) -> Any:
    """Return numbers, paths and lists as words, other values unchanged."""
    if isinstance(value, int | float | os.PathLike):
        return os.fspath(value) if isinstance(value, os.PathLike) else f"{value!r}"
    if isinstance(value, list | tuple | range):
        return ",".join(str(_text(each)) for each in value)
    return value


@dataclass(frozen=True)
class Signature:
    """What a function is asked: options by name, lines of help by heading, and spread values."""

    function: Callable[..., Any]
    options: Mapping[str, Option]
    lines: Mapping[str, Sequence[str]]
    spread: Mapping[str, type[Asked]]

    def call(self, given: Mapping[str, Any]) -> Any:
        """Call the function with values, or words for them; None means the default.

        Raises `ProblemError` for words that are no choice.
        """
        known, values = self.options, {n: each for n, each in given.items() if each is not None}
        values |= {n: known[n].parse(each) for n, each in values.items() if n in known}
        taken = inspect.signature(self.function).parameters.keys()
        arguments = {name: values.pop(name) for name in taken & values.keys()}
        for name, kind in self.spread.items():
            own = {each.name for each in fields(kind)}
            arguments[name] = kind(**{n: each for n, each in values.items() if n in own})
        return self.function(**arguments)

    def fill(self, command: argparse.ArgumentParser) -> None:
        """Add the options, by question, and the help to a parser."""
        command.description = wrapped(" ".join(self.lines.get("", ())))
        if usages := self.lines.get("Usage"):
            command.usage = "\n       ".join(f"{command.prog} {usage}" for usage in usages)
        if examples := self.lines.get("Examples"):
            listed = "\n".join(f"  {example}" for example in examples)
            command.epilog = f"example{'s' * (len(examples) > 1)}:\n{listed}"
        asked = dict.fromkeys(option.question for option in self.options.values())
        for title in sorted(asked, key=lambda e: QUESTIONS.index(e) if e in QUESTIONS else -1):
            about = wrapped(" ".join(self.lines.get(title, ())), columns() - 2)
            group = command.add_argument_group(title, about or None)
            own = [option for option in self.options.values() if option.question == title]
            takes: dict[str, Any] = {}
            for names in TOGETHER:
                if names <= {option.name for option in own}:
                    takes |= dict.fromkeys(names, group.add_mutually_exclusive_group())
            for option in own:
                option.add_to(takes.get(option.name, group))


@cache
def signature_of(function: Callable[..., Any]) -> Signature:
    """Return what a function is asked, by its parameters and docstrings.

    Help texts of values that are spread come first, a later text takes the place of one before.
    """
    options, spread = dict[str, Option](), dict[str, type[Asked]]()
    for each in inspect.signature(function, eval_str=True).parameters.values():
        if inspect.isclass(each.annotation) and issubclass(each.annotation, Asked):
            spread[each.name] = each.annotation
            own = fields(each.annotation)
            options |= {f.name: Option(f.name, str(f.type), f.default, f.metadata) for f in own}
        else:
            options[each.name] = _of_parameter(each)
    kinds = [part for kind in spread.values() for part in kind.__mro__[-3::-1]]
    texts, lines = dict[str, tuple[str, str, str]](), dict[str, list[str]]()
    for part in dict.fromkeys([*kinds, function, Asked]):
        for title, said in _read(inspect.cleandoc(part.__doc__ or ""), texts).items():
            if title[-1:] == "?" or part is function:
                lines.setdefault(title, []).extend(said)
    known = {name: ", ".join(names()) for name, names in NAMES.items()}
    for name, (question, value, text) in texts.items():
        found, told = options.get(name) or Option(name), text
        for key, names in (known | {"default": str(found.default)}).items():
            told = told.replace(f"{{{key}}}", names)
        options[name] = replace(found, question=question, value=value, help=told)
    return Signature(function, {name: options[name] for name in texts}, lines, spread)


def _of_parameter(parameter: inspect.Parameter) -> Option:
    """Return the option of a parameter, whose annotation may say its choices."""
    kind, more = parameter.annotation, dict[str, Any]()
    if get_origin(kind) is Annotated:
        kind, more = get_args(kind)
    literal = next((k for k in (kind, *get_args(kind)) if get_origin(k) is Literal), None)
    if literal is not None:
        more = {**more, "choices": get_args(literal)}
    if parameter.kind is not parameter.KEYWORD_ONLY:
        more = {**more, "place": True}
    default = MISSING if parameter.default is parameter.empty else parameter.default
    return Option(parameter.name, inspect.formatannotation(kind), default, more)


def _read(page: str, texts: dict[str, tuple[str, str, str]]) -> dict[str, list[str]]:
    """Return the lines of a docstring by heading; add question, value and help of options."""
    lines, title, name = {"": list[str]()}, "", ""
    for line in page.splitlines():
        if not line or line.startswith("---"):
            continue
        if line.endswith("?") or line in PLAIN:
            title = OWN if line == "Parameters" else line
        elif title[-1:] == "?" and (found := OPTION.fullmatch(line)):
            name = found[1]
            texts[name] = title, found[2] or "", ""
        elif title[-1:] == "?" and line.startswith("    "):
            question, value, text = texts[name]
            texts[name] = question, value, f"{text} {line.strip()}".lstrip()
        else:
            lines.setdefault(title, []).append(line)
    return lines
