"""What a result came from: the engine that computed it, why that one, and versions of packages."""

from __future__ import annotations

import platform
import re
from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, requires, version

from seqopt.engines.auto import AutoEngine
from seqopt.engines.interface import Engine
from seqopt.engines.recipe import recipe_of
from seqopt.engines.registry import USUAL


def provenance(engine: Engine) -> dict[str, object]:
    """Return what a summary says of the engine that computed it, and of packages.

    Parameters
    ----------
    engine : Engine
        After it computed.

    Returns
    -------
    dict of str to object
        ``engine`` with its ``name``, the ``reason`` for it, the ``mortar`` if one was given, and of
        an automatic one the ``levels`` that it took, for how many grip ``sets``, and why each;
        ``versions`` as of `versions`.
    """
    recipe = recipe_of(engine)
    said: dict[str, object] = {"name": type(engine).__name__, "reason": "given as an object"}
    if recipe is not None:
        why = "the default" if recipe.engine == USUAL else "asked for by name"
        said = {"name": recipe.engine, "reason": why}
        said |= {name: asdict(value) for name, value in recipe.options.items()}  # type: ignore[call-overload]
    if isinstance(engine, AutoEngine):
        said["levels"] = [
            {"engine": choice.level.value, "sets": sets, "reason": choice.reason}
            for choice, sets in engine.tally.items()
        ]
        said["unchecked"] = engine.unchecked or None
    return {"engine": said, "versions": dict(versions())}


@cache
def versions() -> Mapping[str, str]:
    """Return the versions of Python, of seqopt and of the packages that it needs.

    Returns
    -------
    mapping of str to str
        By name.
    """
    lines = (line for line in requires("seqopt") or () if "extra ==" not in line)
    names = ["seqopt", *(re.split(r"[^\w.-]", line)[0] for line in lines)]
    return {"python": platform.python_version()} | {name: _version(name) for name in names}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
