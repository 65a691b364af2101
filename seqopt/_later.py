"""Modules, and names of a package, that are loaded when they are first used.

The milliseconds beside a `Later` are those that other commands do without.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any


class Later(ModuleType):
    """A module by its name, loaded when something of it is first used."""

    def __getattr__(self, name: str) -> Any:
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(import_module(self.__name__), name)


def later(
    page: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package with lazy names (PEP 562).

    ``homes``: the module of the package that defines each name.
    """
    own = vars(sys.modules[page])

    def found(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {page!r} has no attribute {name!r}")
        value: object = getattr(import_module(f"{page}.{homes[name]}"), name)
        own[name] = value
        return value

    def names() -> list[str]:
        return [*own.keys() | homes.keys()]

    return found, names
