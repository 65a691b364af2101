"""Names of a room's page that wait until somebody asks for them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module


def later(
    page: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return the ``__getattr__`` and ``__dir__`` of a page that loads little at first (PEP 562).

    ``homes``: what few commands need, by name the module of its own room that has it.
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
