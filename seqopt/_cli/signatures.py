"""Options of commands, derived from the signatures and docstrings of functions.

A command is a function. Its parameters are its options: of a type and a default, with the help text
that its docstring has for them. A parameter that takes a value made of several words is spread: the
fields of the value are options (`seqopt._cli.words`). So the command line is made from Python.
"""

from __future__ import annotations

import argparse
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, replace
from functools import cache, wraps
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin

import pandas as pd

from seqopt._cli.answer import Answer, Result
from seqopt._cli.terminal import columns, wrapped
from seqopt._cli.watcher import Watcher
from seqopt._cli.words import (
    FLAGS,
    HIDDEN,
    HOW,
    MOST_WORKERS,
    NAMES,
    QUESTIONS,
    SPREAD,
    VALUES,
    parse_count,
)
from seqopt._registry import COMMANDS
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.requirements import number_word

OWN = "What is it about?"  # of options under no question
PRINTED = {
    "strict": "end with exit status 1 if a robot would exceed its payload in a step, or results "
    "leave the linear range",
    "quiet": "print errors and the paths of what is written, nothing else",
    "json": "print one JSON document, for scripts",
}  # what concerns the printed answer alone
STRICT = ("optimize", "compare", "analyze", "replan", "instance", "sweep")
TOGETHER = ({"quiet", "json"}, {"method", "plan"}, {"list", "export"})  # one of each
PATHS = ("FILE", "DIR", "FOLDER", "PLAN_DIR", "INSTANCE", "SOLUTION")
NAMED = re.compile(r"(\w+(?:, \w+)*) :(?: (\S.*))?")  # begins what a docstring says of parameters
SECTIONS = ("Parameters", "Returns", "Raises", "Examples", "Usage", "Notes", "Yields")
SAME = re.compile(r"As of `(\w+)`")
WORD = re.compile(r"``(\w+)(?:=\"?([^`\"]*)\"?)?``")  # a parameter in a docstring, with its value
_P = ParamSpec("_P")
_T = TypeVar("_T")


@dataclass(frozen=True)
class Option:
    """An option: the types that it takes, its default, and what a parser knows of it.

    ``more``: ``choices``, ``const`` (what it is where no value follows), ``zero`` (whether a number
    may be zero), ``least`` and ``most`` (of a whole number), ``advice``, ``parse``.
    """

    name: str
    kinds: frozenset[Any] = frozenset({bool})
    default: Any = False
    place: bool = False  # whether it stands without dashes
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def flag(self) -> str:
        """Its word on the command line."""
        word = FLAGS.get(self.name, self.name).replace("_", "-")
        return f"--no-{word}" if self.default is True else f"--{word}"

    @property
    def value(self) -> str:
        """The word for its value; a switch has none."""
        if self.kinds == {bool}:
            return ""
        return str(self.more.get("value") or VALUES.get(self.name, self.name.upper()))

    @property
    def choices(self) -> tuple[str, ...]:
        """The words that it may have; none where any word may be."""
        choices = self.more.get("choices", ())
        return tuple(choices() if callable(choices) else choices)

    def add_to(self, parser: Any, text: str) -> None:
        """Add it to a parser: as a switch if it has no value, repeated if it is a tuple."""
        default, value = self.default, self.value
        how: dict[str, Any] = {"help": text}
        if not value:
            how |= {"action": "store_false" if default is True else "store_true"}
        else:
            named = "value" in self.more or self.name in VALUES or not self.choices
            how |= {"choices": self.choices} if self.choices else {}
            how |= {"metavar": value} if named else {}
            how |= {"type": Path} if value in PATHS else {}
        if isinstance(default, tuple):
            how |= {"action": "append", "default": [], "help": f"{text}; may be repeated"}
        if "const" in self.more:
            how |= {"nargs": "?", "const": self.more["const"]}
        if self.place:
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
        if self.kinds <= {float, type(None)}:
            try:
                return number_word(str(value), self.flag, zero=self.more.get("zero", False))
            except ProblemError as error:
                raise ProblemError(f"{error}{self.more.get('advice', '')}") from None
        if self.kinds <= {int, type(None)}:
            least, most = self.more.get("least", 1), self.more.get("most", MOST_WORKERS)
            return parse_count(value, self.flag, most, least)
        text, choices = _text(value), self.choices
        if choices and text not in choices:
            hint, known = did_you_mean(text, choices), ", ".join(choices)
            raise ProblemError(f"{self.name} {text!r} does not exist{hint}; give {known}")
        if "parse" in self.more and isinstance(text, str):
            return self.more["parse"](text)
        path = self.value in PATHS or (Path in self.kinds and str not in self.kinds)
        return Path(text) if path and isinstance(text, str) else text


def _text(value: Any) -> Any:
    """Return numbers, paths and lists as words, other values unchanged."""
    if isinstance(value, int | float | os.PathLike):
        return os.fspath(value) if isinstance(value, os.PathLike) else f"{value!r}"
    if isinstance(value, list | tuple | range):
        return ",".join(str(_text(each)) for each in value)
    return value


@dataclass(frozen=True)
class Call:
    """A function with words for its parameters, also of those that are spread."""

    function: Callable[..., Any]
    words: Mapping[str, Any]

    def __call__(self, **more: Any) -> Any:
        """Call it with further words, which take the place of those that it has."""
        return signature_of(self.function).call({**self.words, **more})


@dataclass(frozen=True)
class Signature:
    """What a function is asked: its options by name, and those that make a spread parameter."""

    function: Callable[..., Any]
    options: Mapping[str, Option]
    spread: Mapping[str, tuple[Callable[..., Any], Sequence[str], Any]]  # and its default

    def call(self, given: Mapping[str, Any]) -> Any:
        """Call the function with values, or words for them; None means the default."""
        values = {name: each for name, each in given.items() if each is not None}
        values |= {
            n: self.options[n].parse(each) for n, each in values.items() if n in self.options
        }
        for name, (kind, names, default) in self.spread.items():
            words = {each: values.pop(each) for each in names if each in values}
            if not isinstance(kind, type):  # in place of its words Python gives the first of them
                first = {names[0]: values[name]} if name in values else {}
                values[name] = Call(kind, {**first, **words})
            elif len(words) == 1 and isinstance(words.get(name), kind):
                values[name] = words[name]
            elif words or default is MISSING:
                first = {name: default} if name in names and default is not MISSING else {}
                made = kind(**{**first, **words})
                values[name] = made.parse() if hasattr(made, "parse") else made
        taken = inspect.signature(self.function).parameters  # not all tell how far they are
        return self.function(**{name: each for name, each in values.items() if name in taken})

    def texts(self) -> dict[str, tuple[str, str, str]]:
        """Return question, word for the value, and help by option, as docstrings say them."""
        own, out = dict[str, tuple[str, str, str]](), dict[str, tuple[str, str, str]]()
        for part in [*getattr(self.function, "__mro__", ())[-2:0:-1], self.function]:
            own |= _read(part.__doc__)[1]
        for kind, names, _ in self.spread.values():
            said = signature_of(kind).texts()
            own |= {name: said[name] for name in names if name in said}
        for name, (question, value, text) in own.items():
            same = SAME.match(text)
            if same and name in self.options:
                text = signature_of(COMMANDS[same[1]].load()).texts()[name][2]  # noqa: PLW2901
            default = self.options[name].default if name in self.options else ""
            out[name] = question, value, text.replace("{default}", str(default))
        return out

    @property
    def examples(self) -> list[str]:
        """The command lines that its docstring shows."""
        lines = _read(self.function.__doc__)[0].get("Examples", [])
        shell = [each[2:] for each in lines if each.startswith("$ ")]
        return lines if self._foreign and not shell else shell

    def fill(self, command: argparse.ArgumentParser, *, helps: bool = True) -> None:
        """Add the options, by question, and the help, which is read where it ``helps`` alone."""
        lines = _read(self.function.__doc__)[0]
        texts = self.texts() if helps or self._foreign else {}
        command.description = wrapped(self._spoken(" ".join(lines.get("", ()))))
        own = sorted(self.options.values(), key=lambda e: not e.place or e.default is MISSING)
        if usages := lines.get("Usage"):
            command.usage = "\n       ".join(f"{command.prog} {usage}" for usage in usages)
        else:
            places = (each for each in own if each.place)  # as report [SCENE] FOLDER
            shown = (e.value if e.default is MISSING else f"[{e.value}]" for e in places)
            command.usage = " ".join([command.prog, *shown, "[options]"])
        if examples := self.examples:
            listed = "\n".join(f"  {example}" for example in examples)
            command.epilog = f"example{'s' * (len(examples) > 1)}:\n{listed}"
        strict = command.prog.split()[-1] in STRICT
        own += [Option(name) for name in PRINTED if name != "strict" or strict]
        groups: dict[str, list[Option]] = {}
        for option in own:
            if option.name in HIDDEN:
                continue
            question, value, _ = texts.get(option.name, ("", "", ""))
            asked = (title for title, names in QUESTIONS.items() if option.name in names.split())
            title = question if question[-1:] == "?" else next(asked, OWN)
            upper = value if value == value.upper() and value != "CHOICE" else ""
            known = replace(option, more={"value": upper, **option.more}) if upper else option
            groups.setdefault(title, []).append(known)
        order = [*QUESTIONS]
        for title in sorted(groups, key=lambda e: order.index(e) if e in order else -1):
            about = wrapped(" ".join(lines.get(title, ())), columns() - 2)
            group = command.add_argument_group(title, about or None)
            takes: dict[str, Any] = {}
            for names in TOGETHER:
                if names <= {option.name for option in groups[title]}:
                    takes |= dict.fromkeys(names, group.add_mutually_exclusive_group())
            for option in groups[title]:
                said = texts.get(option.name, ("", "", PRINTED.get(option.name, "")))[2]
                option.add_to(takes.get(option.name, group), self._help(option, said))

    @property
    def _foreign(self) -> bool:
        return _is_foreign(self.function)

    def _spoken(self, text: str) -> str:
        """Return a text of a docstring as the command line says it: parameters are options."""

        def word(found: re.Match[str]) -> str:
            option = self.options.get(found[1])
            if option is None:
                return found[0].strip("`")
            return f"{option.flag} {found[2]}" if found[2] and option.value else option.flag

        return WORD.sub(word, text).replace("`", "")

    def _help(self, option: Option, text: str) -> str:
        """Return the help of an option, with its names and default."""
        text = self._spoken(text).replace("{choices}", ", ".join(option.choices))
        text = text.removesuffix(".")
        if text[1:2].islower() or text[1:2] == " ":
            text = text[:1].lower() + text[1:]
        if (names := NAMES.get(option.name)) and not self._foreign:
            text += f"; names: {', '.join(names())}"
        return text.replace("%", "%%")


def _is_foreign(function: Callable[..., Any]) -> bool:
    return not function.__module__.startswith("seqopt.")


@cache
def signature_of(function: Callable[..., Any]) -> Signature:
    """Return what a function, or the class of a value, is asked, by its parameters."""
    function = inspect.unwrap(function)
    own, home = inspect.signature(function).parameters, vars(sys.modules[function.__module__])
    options, spread = dict[str, Option](), dict[str, tuple[Any, Sequence[str], Any]]()
    foreign = _is_foreign(function)
    for each in own.values():
        default = MISSING if each.default is each.empty else each.default
        kind = each.annotation  # evaluated alone: what is returned may load pandas
        kind = eval(kind, home) if isinstance(kind, str) else kind
        how = {} if foreign else dict(HOW.get(each.name, {}))
        option, more = _option(each.replace(annotation=kind), default, how)
        spreads = SPREAD.get((function.__name__, each.name), SPREAD.get(each.name))
        spreads = None if foreign and kind is not spreads else spreads  # names are of seqopt alone
        kind = more.get("call") or spreads
        if kind is None or kind is function:
            if each.name != "progress":
                options[each.name] = option
            continue
        known = signature_of(kind).options
        names = [name for name in known if name == each.name or name not in own]
        whole = not isinstance(kind, type)  # of a function the scene alone has no dashes
        options |= {n: replace(known[n], place=whole and n == "scene") for n in names}
        if each.name in known:
            first = known[each.name].default if default is MISSING else default
            options[each.name] = replace(known[each.name], default=first, place=option.place)
        spread[each.name] = kind, names, default
    return Signature(function, options, spread)


def _option(
    parameter: inspect.Parameter, default: Any, more: dict[str, Any]
) -> tuple[Option, dict[str, Any]]:
    """Return the option of a parameter, and ``more``, with what its annotation says."""
    kinds, left = set[Any](), [parameter.annotation]
    while left:
        kind = left.pop()
        if get_origin(kind) is Annotated:
            kind, *said = get_args(kind)
            for each in said:
                more |= each if isinstance(each, dict) else dict([each])
            left.append(kind)
        elif get_origin(kind) is Literal:
            more |= {"choices": get_args(kind)}
            kinds.add(str)
        elif get_origin(kind) in (Union, UnionType):
            left += get_args(kind)
        else:
            kinds.add(get_origin(kind) or kind)
    if repr(default) == "<factory>" or isinstance(default, list | dict):
        default = ()
    place = parameter.kind is not parameter.KEYWORD_ONLY
    return Option(parameter.name, frozenset(kinds), default, place, more), more


def _read(page: str | None) -> tuple[dict[str, list[str]], dict[str, tuple[str, str, str]]]:
    """Return the lines of a docstring by section, and what it says of parameters.

    A heading that is a question is a group of options.
    """
    lines, texts, title = {"": list[str]()}, dict[str, tuple[str, str, str]](), ""
    names: Sequence[str] = ()
    for line in inspect.cleandoc(page or "").splitlines():
        if not line or line.startswith("---"):
            continue
        of_options = title == "Parameters" or title[-1:] == "?"
        if line.endswith("?") or line in SECTIONS:
            title = line
        elif of_options and (found := NAMED.fullmatch(line)):
            names = found[1].split(", ")
            texts |= dict.fromkeys(names, (title, found[2] or "", ""))
        elif of_options and line.startswith("    "):
            question, value, text = texts[names[0]]
            said = f"{text} {line.strip()}".lstrip()
            texts |= dict.fromkeys(names, (question, value, said))
        else:
            lines.setdefault(title, []).append(line)
    return lines, texts


def door(function: Callable[_P, Answer[_T] | Result[_T]]) -> Callable[_P, _T]:
    """Return a command as a function of Python, which gives its value.

    Words of the command line stand for values. Progress is shown in a notebook and at a terminal.
    """
    places = [
        each.name
        for each in inspect.signature(function).parameters.values()
        if each.kind is not each.KEYWORD_ONLY
    ]

    @wraps(function)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        asked, name = signature_of(function), function.__name__
        known = {*asked.options, *asked.spread, "progress"}
        if wrong := [each for each in kwargs if each not in known]:
            raise TypeError(f"{name}() got an unexpected keyword argument {wrong[0]!r}")
        if len(args) > len(places):
            raise TypeError(f"{name}() takes {len(places)} values without names; name the others")
        values = {**dict(zip(places, args, strict=False)), **kwargs}
        with Watcher(shows=values.get("progress") is None) as watcher:
            result = asked.call({"progress": watcher} | values)
            if isinstance(result, Result) and values.get("out") is not None:
                result.answer()
        found: Any = pd.DataFrame(result.value) if isinstance(result.value, list) else result.value
        if isinstance(found, pd.DataFrame) and isinstance(result, Answer):
            found.attrs |= {"notes": [*result.notes], "failures": [*result.failures]}
        value: _T = found
        return value

    return call


def names_of(options: Iterable[Option]) -> dict[str, Option]:
    """Return options that have a value, by their words without dashes."""
    return {option.flag.removeprefix("--"): option for option in options if option.value}
