"""The API shows the door, what rooms hand out, and whatever a page of the site imports."""

import inspect
import re
from importlib import import_module

import seqopt
from tests.docs.transcripts import DOCS

IMPORT = re.compile(
    r"^ *(?:>>> )?from ((?:seqopt|formulations)[\w.]*) import (\([^)]*\)|[^\n]*)", re.M
)
DIRECTIVE = re.compile(r"^\.\. auto(module|class|function):: ([\w.]+)\n((?: {3}:.*\n)*)", re.M)


def located(path):
    """Return what a dotted path names."""
    home, _, name = path.rpartition(".")
    return getattr(import_module(home), name)


def named(path):
    """Return the name under which an object is defined."""
    thing = located(path)
    return f"{thing.__module__}.{thing.__qualname__}"


def has_place(thing):
    """Return whether something is a class or function, which the API shows with its sections."""
    return inspect.isclass(thing) or inspect.isfunction(thing)


def members(module):
    """Return the classes and functions that a room hands out, or the classes of a module."""
    home = import_module(module)
    own = [n for n, thing in vars(home).items() if getattr(thing, "__module__", "") == module]
    names = getattr(home, "__all__", [n for n in own if inspect.isclass(getattr(home, n))])
    return [
        f"{module}.{name}" for name in names if name[0] != "_" and has_place(getattr(home, name))
    ]


def shown():
    """Return what the pages of the API show, by the names under which it is defined."""
    found = set()
    for page in (DOCS / "api").glob("*.md"):
        for kind, path, options in DIRECTIVE.findall(page.read_text(encoding="utf-8")):
            if kind != "module":
                found.add(named(path))
            elif ":members:" in options:
                left = re.findall(r"\w+", options.partition(":exclude-members:")[2])
                found |= {named(n) for n in members(path) if n.rpartition(".")[2] not in left}
    return found


def imported(text):
    """Return the dotted paths of what a page imports."""
    pairs = [
        (home, re.findall(r"\w+", names.split("#")[0])) for home, names in IMPORT.findall(text)
    ]
    return [f"{home}.{name}" for home, names in pairs for name in names if name != "as"]


def unshown(paths):
    """Return the paths whose objects are on no page of the API."""
    known = shown()
    return sorted(p for p in {*paths} if has_place(located(p)) and named(p) not in known)


def rooms():
    """Return the rooms that have a heading in the API."""
    return re.findall(r"^## (seqopt\.\w+)$", (DOCS / "api" / "rooms.md").read_text("utf-8"), re.M)


def test_the_door_and_what_rooms_hand_out_are_shown():
    assert len(rooms()) > 12
    nouns = [name for room in rooms() for name in members(room)]
    assert unshown([*(f"seqopt.{n}" for n in seqopt.__all__ if n[0] != "_"), *nouns]) == []


def test_what_pages_import_is_shown():
    pages = [page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md")]
    paths = [path for page in pages for path in imported(page)]
    assert len({*paths}) > 40
    assert unshown(paths) == []


def test_what_is_missing_is_seen():
    assert imported("from seqopt.arrays import freeze  # x") == ["seqopt.arrays.freeze"]
    assert unshown(["seqopt._files.read_text", "seqopt.Scene"]) == ["seqopt._files.read_text"]
