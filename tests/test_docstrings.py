"""Docstrings: a sentence for whatever is public, and whole sections for what others build on."""

import inspect
import pkgutil
from dataclasses import dataclass
from enum import Enum
from importlib import import_module
from pydoc import locate

import pytest
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate

import formulations
import seqopt

pytestmark = pytest.mark.slow

ALWAYS = {
    "GL08",  # there is no docstring
    "PR02",  # a parameter is documented that there is not
    "PR03",  # they are in another order
}
WHOLE = ALWAYS | {
    "PR01",  # a parameter is not documented
    "RT01",  # a value is returned and not documented
}
SECTIONS = ("Parameters", "Other Parameters", "Attributes")


def modules():
    """Return the names of all modules of both packages."""
    return sorted(
        module.name
        for package in (seqopt, formulations)
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        if not module.name.endswith("__main__")
    )


def public_objects(module):
    """Return the dotted names of the functions, classes and methods that a module defines."""
    found = []
    for name, thing in vars(import_module(module)).items():
        if name.startswith("_") or getattr(thing, "__module__", None) != module:
            continue
        if inspect.isfunction(thing) or inspect.isclass(thing):
            found.append(f"{module}.{name}")
        if inspect.isclass(thing):
            found += [
                f"{module}.{name}.{method}"
                for method, body in vars(thing).items()
                if not method.startswith("_") and inspect.isroutine(body)
            ]
    return found


def door():
    """Return what has whole sections: names of the interface, and the nouns of rooms."""
    named = [getattr(seqopt, name) for name in seqopt.__all__]
    for part in pkgutil.iter_modules(seqopt.__path__, "seqopt."):
        package = import_module(part.name) if part.ispkg else None
        named += [getattr(package, name) for name in getattr(package, "__all__", ())]
    return {f"{x.__module__}.{x.__qualname__}" for x in named if hasattr(x, "__qualname__")}


DOOR = door()


def is_whole(name):
    """Return whether an object has to have whole sections: protocols have them too."""
    owner = locate(name.rpartition(".")[0])
    return name in DOOR or any(getattr(x, "_is_protocol", False) for x in (locate(name), owner))


def faults(name, *, whole=None):
    """Return what the docstring of an object lacks."""
    whole = is_whole(name) if whole is None else whole
    said = inspect.getdoc(locate(name))
    if not whole and said and ("Parameters\n---" not in said or not locate(name).__doc__):
        return []  # it is there, and documents no parameter, or is that of the base it stands for
    wanted = WHOLE if whole else ALWAYS
    found = [f"{code}: {text}" for code, text in validate(name)["errors"] if code in wanted]
    thing = locate(name)
    if inspect.isclass(thing):  # numpydoc does not look for fields among the attributes
        found = [text for text in found if text.startswith("GL08")]
        fields = undocumented(thing) if whole else []
        found += [f"PR01: field {field} is not documented" for field in fields]
    return [f"{name}: {text}" for text in found]


def undocumented(kind):
    """Return the parameters of a class that no section names."""
    if issubclass(kind, Enum) or getattr(kind, "_is_protocol", False):
        return []
    if not inspect.isfunction(kind.__init__):  # an exception that takes what any takes
        return []
    doc = get_doc_object(kind)
    named = {name for part in SECTIONS for entry in doc[part] for name in entry.name.split(", ")}
    inherited = {name for base in kind.__bases__ for name in getattr(base, "__annotations__", {})}
    return [p for p in inspect.signature(kind).parameters if p not in named | inherited]


def test_docstrings_say_what_goes_in_and_out():
    names = [name for module in modules() for name in public_objects(module)]
    assert len(names) > 150
    assert [fault for name in names for fault in faults(name)] == []


def half_said(known, unknown):
    """Return the first.

    Parameters
    ----------
    known : int
    """
    return known


@dataclass(frozen=True)
class HalfSaid:
    """A value.

    Attributes
    ----------
    known : int
    """

    known: int
    unknown: int


def test_what_is_not_said_is_seen():
    assert len(DOOR) > 60
    assert faults(f"{__name__}.half_said") == []  # nobody builds on it
    seen = " ".join(faults(f"{__name__}.half_said", whole=True))
    assert "PR01: Parameters {'unknown'} not documented" in seen
    assert "RT01" in seen
    assert faults(f"{__name__}.HalfSaid", whole=True) == [
        f"{__name__}.HalfSaid: PR01: field unknown is not documented"
    ]
