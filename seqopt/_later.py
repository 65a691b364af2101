"""Lazily loaded names of a package."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module


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
