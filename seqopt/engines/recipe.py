"""How an engine was made: enough to make it again elsewhere, and to know its answers by content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import scipy

from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import scene_to_dict

ARITHMETIC = ("arrays.py", "contact", "engines", "network", "responses/quantities.py")
"""Files and folders of the package that answers depend on."""
WITHOUT_EFFECT = ("name", "provenance", "robots")  # of a scene, on answers to given grips


@dataclass(frozen=True)
class Recipe:
    """An engine's name, scene and options, as `seqopt.engines.registry.make_engine` takes them.

    Attributes
    ----------
    engine : str
    scene : Scene
    options : mapping of str to object
        Values whose representation says all of them.
    """

    engine: str
    scene: Scene
    options: Mapping[str, object] = field(default_factory=dict)

    def __reduce__(self) -> tuple[object, ...]:
        return Recipe, (self.engine, self.scene, dict(self.options))

    @cached_property
    def network(self) -> Network:
        """The network of the scene; it is not sent along."""
        return build_network(self.scene)

    @cached_property
    def key(self) -> str:
        """What answers depend on, condensed: equal for equal scenes, options and arithmetic.

        Names, provenance and robots of a scene change no answer and are left out.
        """
        scene = {k: v for k, v in scene_to_dict(self.scene).items() if k not in WITHOUT_EFFECT}
        built = json.dumps(scene, sort_keys=True)
        parts = (self.engine, repr(sorted(self.options.items())), built, arithmetic())
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@cache
def arithmetic() -> str:
    """Return a mark of the code that answers come from: its text, NumPy and SciPy."""
    home = Path(__file__).parents[1]
    found = (home / name for name in ARITHMETIC)
    files = [
        f for path in found for f in ([path] if path.is_file() else sorted(path.rglob("*.py")))
    ]
    mark = hashlib.sha256(f"{np.__version__} {scipy.__version__}".encode())
    for file in files:
        mark.update(file.relative_to(home).as_posix().encode() + file.read_bytes())
    return mark.hexdigest()


def recipe_of(engine: object) -> Recipe | None:
    """Return how an engine was made.

    Returns
    -------
    Recipe or None
        None where it was not made by name; an engine of one's own may have an attribute ``recipe``.
    """
    found = getattr(engine, "recipe", None)
    return found if isinstance(found, Recipe) else None
