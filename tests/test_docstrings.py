"""Every public function, method and class says what it takes and gives, as numpydoc reads it."""

from __future__ import annotations

import inspect
import pkgutil
from enum import Enum
from importlib import import_module

import pytest
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate

import formulations
import seqopt

UNFINISHED = ("scene", "network", "contact", "engines", "stability", "arrays", "errors")
FAULTS = {
    "GL08",  # no docstring at all
    "PR01",  # a parameter is not documented
    "PR02",  # an unknown one is
    "PR03",  # in another order
    "RT01",  # a value is returned and not documented
}


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
        own = getattr(thing, "__module__", None) == module
        if not own or name.startswith("_") or not inspect.isroutine(thing) | inspect.isclass(thing):
            continue
        found.append(f"{module}.{name}")
        if inspect.isclass(thing):
            found += [
                f"{module}.{name}.{method}"
                for method, body in vars(thing).items()
                if not method.startswith("_") and inspect.isroutine(body)
            ]
    return found


def faults(name, thing=None):
    """Return what is missing in the docstring of an object, by its dotted name."""
    found = {code: text for code, text in validate(thing or name)["errors"] if code in FAULTS}
    own = thing.obj if thing else resolve(name)
    if inspect.isclass(own):
        missing = undocumented_fields(own)
        found = {code: text for code, text in found.items() if code == "GL08"}
        found |= {"PR01": f"fields {sorted(missing)} not documented"} if missing else {}
    return [f"{name}: {code}: {text}" for code, text in found.items()]


def resolve(name):
    """Return the object that a dotted name stands for; a module may share a name with a function."""
    module = next(m for m in reversed(modules()) if name.startswith(f"{m}."))
    found = import_module(module)
    for part in name.removeprefix(f"{module}.").split("."):
        found = getattr(found, part)
    return found


def undocumented_fields(kind):
    """Return the parameters of a class that neither Parameters nor Attributes name."""
    if issubclass(kind, Enum) or getattr(kind, "_is_protocol", False):
        return set()
    doc = get_doc_object(kind)
    sections = ("Parameters", "Other Parameters", "Attributes")
    named = {n for part in sections for entry in doc[part] for n in entry.name.split(", ")}
    return {p.lstrip("*") for p in inspect.signature(kind).parameters} - {
        n.lstrip("*") for n in named
    }


def room(module):
    """Return the room of a module of seqopt; a module of another package has none."""
    package, _, rest = module.partition(".")
    return rest.partition(".")[0] if package == "seqopt" else package


@pytest.mark.parametrize("module", [m for m in modules() if room(m) not in UNFINISHED])
def test_docstrings_name_what_goes_in_and_out(module):
    assert [fault for name in public_objects(module) for fault in faults(name)] == []


def test_many_objects_are_looked_at():
    assert len([name for module in modules() for name in public_objects(module)]) > 150
