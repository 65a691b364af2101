"""Options of commands, derived from the signatures and docstrings of functions.

A command is a function. Its parameters are its options: of a type and a default, with the help text
that its docstring has for them. A parameter that takes a value made of several words is spread: the
fields of the value are options (`seqopt._cli.words`). A parameter that is a `Call` has the options
of another function, as that of an analysis.
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, replace
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from seqopt._cli.registry import COMMANDS
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import FLAGS, HIDDEN, HOW, MOST_WORKERS, QUESTIONS, SPREAD, VALUES
from seqopt.errors import ProblemError
from seqopt.problem.requirements import number_word

OWN = "What is it about?"  # of options under no question
PRINTED = {
    "quiet": "print errors and the paths of what is written, nothing else",
    "json": "print one JSON document, for scripts",
}  # what concerns the printed answer alone
PATHS = ("FILE", "DIR", "FOLDER", "PLAN_DIR", "INSTANCE", "SOLUTION")
NAMED = re.compile(r"(\w+(?:, \w+)*) :(?: (\S.*))?")  # begins what a docstring says of parameters
SECTIONS = ("Parameters", "Returns", "Raises", "Examples")
SAME = re.compile(r"As of `([\w.]+)`")
WORD = re.compile(r"``(\w+)(?:=\"?([^`\"]*)\"?)?``")  # a parameter in a docstring, with its value


@dataclass(frozen=True)
class Option:
    """An option: the types that it takes, its default, and what a parser knows of it.

    ``more``: ``choices``, ``const`` (what it is where no value follows), ``unit`` of a number and
    whether it may be ``zero``, ``least`` and ``most`` (of a whole number), ``parse``.
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
        """Return the value of words of the command line; other values stay unchanged."""
        if isinstance(self.default, tuple) and isinstance(value, list):
            return tuple(value)
        if not isinstance(value, str):
            return value
        if self.kinds <= {float, type(None)}:
            how = {name: self.more[name] for name in ("unit", "zero") if name in self.more}
            return number_word(value, self.flag, **how)
        if self.kinds <= {int, type(None)}:
            least, most = self.more.get("least", 1), self.more.get("most", MOST_WORKERS)
            if not (value.isascii() and value.isdecimal() and least <= int(value[:12]) <= most):
                given = f"{self.flag} {value}"
                raise ProblemError(f"{given}: give a whole number from {least} to {most}")
            return int(value)
        return self.more["parse"](value) if "parse" in self.more else value


@dataclass(frozen=True)
class Call:
    """A function with words for its parameters, also of those that are spread."""

    function: Callable[..., Any]
    words: Mapping[str, Any]

    def __call__(self, **more: Any) -> Any:
        """Call it with further words, which take the place of those that it has."""
        return self.function(**self.values(**more))

    def values(self, **more: Any) -> dict[str, Any]:
        """Return the values of all of its parameters."""
        taken = inspect.signature(self.function).parameters
        usual = {name: each.default for name, each in taken.items() if each.default != each.empty}
        return usual | signature_of(self.function).values({**self.words, **more})


class Spread(NamedTuple):
    """A parameter whose value several words make: by what, which, and its default."""

    made_by: Callable[..., Any]
    names: Sequence[str]
    default: Any
    called: bool  # whether it is a `Call`


@dataclass(frozen=True)
class Signature:
    """What a function is asked: its options by name, and those that make a spread parameter."""

    function: Callable[..., Any]
    options: Mapping[str, Option]
    spread: Mapping[str, Spread]

    def values(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return values of parameters, of values or words for options; of none the default."""
        values = {n: o.more["usual"] for n, o in self.options.items() if "usual" in o.more}
        values |= {name: each for name, each in given.items() if each not in (None, [], ())}
        values |= {
            n: self.options[n].parse(each) for n, each in values.items() if n in self.options
        }
        for name, each in self.spread.items():
            words = {n: values.pop(n) for n in each.names if n in values}
            if each.called:
                values[name] = Call(each.made_by, words)
            elif not isinstance(words.get(name, ""), str | Path):
                values |= words  # a value
            elif name not in values and (words or each.default is MISSING):
                values[name] = each.made_by(**words)
        taken = inspect.signature(self.function).parameters  # not all tell how far they are
        return {name: each for name, each in values.items() if name in taken}

    def texts(self) -> dict[str, tuple[str, str]]:
        """Return word for the value, and help, by option, as docstrings say them."""
        own, out = _read(self.function.__doc__)[1], dict[str, tuple[str, str]]()
        for each in self.spread.values():
            said = signature_of(each.made_by).texts()
            own |= {name: said[name] for name in each.names if name in said}
        for name, (value, text) in own.items():
            same = SAME.match(text)
            if same and name in self.options:
                like = COMMANDS.get(same[1], COMMANDS["optimize"])
                text = signature_of(like.load()).texts()[name][1]  # noqa: PLW2901
            out[name] = value, text
        return out

    @property
    def examples(self) -> list[str]:
        """The command lines that its docstring shows."""
        lines = _read(self.function.__doc__)[0].get("Examples", [])
        shell = [each[2:] for each in lines if each.startswith("$ ")]
        return lines if _is_foreign(self.function) and not shell else shell

    def fill(self, command: argparse.ArgumentParser, *, helps: bool = True) -> None:
        """Add the options, by question, and the help, which is read where it ``helps`` alone."""
        lines = _read(self.function.__doc__)[0]
        texts = self.texts() if helps or _is_foreign(self.function) else {}
        command.description = wrapped(self._spoken(" ".join(lines.get("", ()))))
        own = sorted(self.options.values(), key=lambda e: not e.place or e.default is MISSING)
        places = (each for each in own if each.place)  # as report [SCENE] FOLDER
        shown = (e.value if e.default is MISSING else f"[{e.value}]" for e in places)
        command.usage = " ".join([command.prog, *shown, "[options]"])
        if examples := self.examples:
            listed = "\n".join(f"  {example}" for example in examples)
            command.epilog = f"example{'s' * (len(examples) > 1)}:\n{listed}"
        groups: dict[str, list[Option]] = {}
        for option in (*own, *map(Option, PRINTED)):
            asked = (title for title, names in QUESTIONS.items() if option.name in names.split())
            if option.name not in HIDDEN:
                groups.setdefault(next(asked, OWN), []).append(option)
        for title in sorted(groups, key=[OWN, *QUESTIONS].index):
            group = command.add_argument_group(title)
            for option in groups[title]:
                value, text = texts.get(option.name, ("", PRINTED.get(option.name, "")))
                upper = value if value == value.upper() else ""  # of packages of others
                known = replace(option, more={"value": upper, **option.more}) if upper else option
                known.add_to(group, self._help(option, text))

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
        text = self._spoken(text).removesuffix(".")
        text = text.removeprefix("If not, ") if option.flag.startswith("--no-") else text
        if text[1:2].islower() or text[1:2] == " ":
            text = text[:1].lower() + text[1:]
        names = option.more.get("names", lambda: option.choices if option.name in VALUES else ())()
        text += f"; names: {', '.join(names)}" if names else ""
        return text.replace("%", "%%")


def _is_foreign(function: Callable[..., Any]) -> bool:
    return not function.__module__.startswith("seqopt.")


@cache
def signature_of(function: Callable[..., Any]) -> Signature:
    """Return what a function, or the class of a value, is asked, by its parameters."""
    own, home = inspect.signature(function).parameters, vars(sys.modules[function.__module__])
    options, spread, foreign = dict[str, Option](), dict[str, Spread](), _is_foreign(function)
    for each in own.values():
        default = MISSING if each.default is each.empty else each.default
        kind = each.annotation  # evaluated alone: what is returned may load pandas
        if isinstance(kind, str) and each.name not in HIDDEN:
            kind = eval(kind, home)
        option = _option(each.replace(annotation=kind), default, foreign=foreign)
        called = option.more.get("call")
        maker = called or (None if foreign else SPREAD.get(each.name))
        if maker in (None, function):
            if each.name != "progress":
                options[each.name] = option
            continue
        known = signature_of(maker).options
        names = [n for n in known if n not in own or n == each.name]
        first = {n for n in names if called and (n == "scene" or known[n].default is MISSING)}
        options |= {n: replace(known[n], place=n in first) for n in names}
        if each.name in names:
            usual = known[each.name].default if default is MISSING else default
            options[each.name] = replace(known[each.name], default=usual, place=option.place)
        spread[each.name] = Spread(maker, names, default, bool(called))
    return Signature(function, options, spread)


def _option(parameter: inspect.Parameter, default: Any, *, foreign: bool) -> Option:
    """Return the option of a parameter, with what its annotation says."""
    kinds, left = set[Any](), [parameter.annotation]
    more: dict[str, Any] = {} if foreign else dict(HOW.get(parameter.name, {}))
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
    default = more.get("usual", MISSING) if default is MISSING else default
    place = parameter.kind is not parameter.KEYWORD_ONLY
    return Option(parameter.name, frozenset(kinds), default, place, more)


def _read(page: str | None) -> tuple[dict[str, list[str]], dict[str, tuple[str, str]]]:
    """Return the lines of a docstring by section, and value and help of its parameters."""
    lines, texts, title = {"": list[str]()}, dict[str, tuple[str, str]](), ""
    names: Sequence[str] = ()
    for line in inspect.cleandoc(page or "").splitlines():
        if not line or line.startswith("---"):
            continue
        if line in SECTIONS:
            title = line
        elif title == "Parameters" and (found := NAMED.fullmatch(line)):
            names = found[1].split(", ")
            texts |= dict.fromkeys(names, (found[2] or "", ""))
        elif title == "Parameters":
            value, text = texts[names[0]]
            texts |= dict.fromkeys(names, (value, f"{text} {line.strip()}".lstrip()))
        else:
            lines.setdefault(title, []).append(line)
    return lines, texts
