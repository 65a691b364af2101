"""Parsers and values of commands, derived from the classes of their options."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from inspect import cleandoc
from pathlib import Path
from typing import Any, TypeVar

from seqopt._cli.grammar import parse_count
from seqopt._cli.options import NAMES, Asked
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
TOGETHER = ({"quiet", "json"}, {"method", "plan"}, {"list", "export", "view"})  # one of each
PATHS = ("FILE", "DIR", "FOLDER", "PLAN_DIR", "INSTANCE", "SOLUTION")
FILE = re.compile(r"Path|.*\bFile\b")  # what is annotated so is a path
OPTION = re.compile(r"(\w+) :(?: (\S.*))?")
PLAIN = ("Usage", "Examples")
_Asked = TypeVar("_Asked", bound=Asked)


@dataclass
class Page:
    """Parsed docstrings of a command: lines by heading, the first one empty, and options."""

    lines: dict[str, list[str]] = field(default_factory=dict)
    options: dict[str, tuple[str, str, str]] = field(default_factory=dict)  # question, value, help

    def read(self, docstring: str) -> None:
        """Parse and add a docstring."""
        title = name = ""
        for line in cleandoc(docstring).splitlines():
            if not line or line.startswith("---"):
                continue
            if line.endswith("?") or line in PLAIN:
                title = line
                self.lines.setdefault(title, [])
            elif title not in PLAIN and (found := OPTION.fullmatch(line)):
                name = found[1]
                self.options[name] = title, found[2] or "", ""
            elif line.startswith("    "):
                question, value, text = self.options[name]
                self.options[name] = question, value, f"{text} {line.strip()}".lstrip()
            else:
                self.lines.setdefault(title, []).append(line)


def page_of(kind: type[Asked]) -> Page:
    """Return the parsed docstrings of a command, those of its base classes first."""
    command, *shared, root, _ = kind.__mro__
    page, known = Page(), {each.name: each for each in fields(kind)}
    for part in (*reversed(shared), command, root):
        page.read(part.__doc__ or "")
        if part in shared:  # a command may build on another one
            page.lines = {title: each for title, each in page.lines.items() if title[-1:] == "?"}
    names = {name: ", ".join(NAMES[name]()) for name in NAMES}
    for name, (question, value, text) in page.options.items():
        own = known.get(name)
        choices = ", ".join(own.metadata.get("choices", ())) if own else ""
        more = names | {"choices": choices, "default": own and own.default}
        page.options[name] = question, value, text.format(**more)
    return page


def fill(command: argparse.ArgumentParser, kind: type[Asked]) -> None:
    """Add the options of a command, by heading, and its help to a parser."""
    page = page_of(kind)
    command.description = wrapped(" ".join(page.lines.get("", ())))
    if usages := page.lines.get("Usage"):
        command.usage = "\n       ".join(f"{command.prog} {usage}" for usage in usages)
    examples = page.lines.get("Examples", [])
    listed = "\n".join(f"  {example}" for example in examples)
    command.epilog = f"example{'s' * (len(examples) > 1)}:\n{listed}"
    known = {each.name: each for each in fields(kind)}
    asked = dict.fromkeys(question for question, *_ in page.options.values())
    for title in sorted(asked, key=lambda each: QUESTIONS.index(each) if each in QUESTIONS else -1):
        about = wrapped(" ".join(page.lines.get(title, ())), columns() - 2)
        group = command.add_argument_group(title, about or None)
        own = {name: said for name, said in page.options.items() if said[0] == title}
        one = [names for names in TOGETHER if names <= {*own}]
        takes: dict[str, Any] = {}
        for names in one:
            takes |= dict.fromkeys(names, group.add_mutually_exclusive_group())
        for name, (_, value, text) in own.items():
            _add(takes.get(name, group), name, known.get(name), value, text)


def _add(takes: Any, name: str, known: Field[Any] | None, value: str, text: str) -> None:
    """Add an option: a switch, if it has no value; repeated, if its default is a tuple."""
    if known is None:  # of whoever prints the answer
        takes.add_argument(_flag(name), dest=name, action="store_true", help=text)
        return
    more, default = known.metadata, known.default
    how: dict[str, Any] = {"help": text, "default": None if default is MISSING else default}
    if not value:
        how["action"] = "store_false" if default else "store_true"
    else:
        how["metavar"] = None if value == "CHOICE" else value
        how |= {"choices": more["choices"]} if "choices" in more else {}
        how |= {"type": Path} if value in PATHS else {}
    if isinstance(default, tuple):
        how |= {"action": "append", "default": [], "help": f"{text}; may be repeated"}
    if "const" in more:
        how |= {"nargs": "?", "const": more["const"]}
    if "place" in more:
        how |= {} if default is MISSING else {"nargs": "?"}
        takes.add_argument(name, **how)
        return
    flag = more.get("flag", _flag(f"no-{name}" if default is True else name))
    takes.add_argument(flag, dest=name, required=default is MISSING, **how)


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def given(kind: type[_Asked], values: Mapping[str, Any]) -> _Asked:
    """Return the options of a command from Python values; numbers and lists become words.

    None means the command's default. Raises `ProblemError` for words that are no choice.
    """
    known = {each.name: each for each in fields(kind)}
    return kind(**{name: _value(known[name], v) for name, v in values.items() if v is not None})


def _value(known: Field[Any], value: Any) -> Any:
    """Parse a value as the command line does; other Python objects stay unchanged."""
    if isinstance(value, bool):
        return value
    if isinstance(known.default, tuple):
        if isinstance(value, Mapping):
            value = [f"{name}={_text(each)}" for name, each in value.items()]
        several = value if isinstance(value, Sequence) and not isinstance(value, str) else [value]
        return tuple(map(_text, several))
    kind, more = str(known.type), known.metadata
    flag = more.get("flag", _flag(known.name))
    if kind in ("float", "float | None"):
        if value == known.default:
            return value
        try:
            return number_word(str(value), flag, zero=more.get("zero", False))
        except ProblemError as error:
            raise ProblemError(f"{error}{more.get('advice', '')}") from None
    if kind in ("int", "int | None"):
        return parse_count(value, flag, more["most"], more.get("least", 1))
    text, choices = _text(value), more.get("choices")
    if choices is not None and text not in choices:
        hint = did_you_mean(text, choices)
        raise ProblemError(f"{known.name} {text!r} does not exist{hint}; give {', '.join(choices)}")
    return Path(text) if FILE.match(str(known.type)) and isinstance(text, str) else text


def _text(value: Any) -> Any:
    """Return numbers, paths and lists as words, other values unchanged."""
    if isinstance(value, int | float | os.PathLike):
        return os.fspath(value) if isinstance(value, os.PathLike) else f"{value!r}"
    if isinstance(value, list | tuple | range):
        return ",".join(str(_text(each)) for each in value)
    return value
