"""The engines by name."""

from __future__ import annotations

from collections.abc import Callable

from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.engines.auto import AutoEngine
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Engine
from seqopt.engines.planar import PlanarEngine
from seqopt.engines.recipe import Recipe
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene

ENGINES: dict[str, Callable[[Network], Engine]] = {
    "auto": AutoEngine,
    "planar": PlanarEngine,
    "compliance": ComplianceEngine,
    "frame": FrameEngine,
    "discrete": DiscreteEngine,
}
USUAL = "compliance"  # the engine where none is asked for
LIMITED: dict[str, Callable[[Network, Mortar], Engine]] = {
    "auto": AutoEngine,
    "discrete": DiscreteEngine,
}  # engines whose joints hold only what their mortar does


def make_engine(name: str, network: Network | Scene, mortar: Mortar | str | None = None) -> Engine:
    """Return an engine by name.

    Parameters
    ----------
    name : str
        One of `ENGINES`.
    network : Network or Scene
    mortar : Mortar or str, optional
        The strength of the joints, for the engines that need it; by default the epoxy.

    Returns
    -------
    Engine

    Raises
    ------
    SceneError
        If there is no such engine, a mortar would change nothing in it, or the engine cannot
        model the scene.

    Examples
    --------
    >>> from seqopt.network.build import build_network
    >>> from seqopt.scene.scene_file import load_scene
    >>> engine = make_engine("compliance", build_network(load_scene("arch25")))
    >>> engine.solve(1, [[1]]).grip_force.shape
    (1, 1, 3)
    """
    if name not in ENGINES:
        raise SceneError(f"engine {name} does not exist; known are {', '.join(ENGINES)}")
    network = network_of(network)
    if mortar is None:
        return _known_by(ENGINES[name](network), Recipe(name, network.scene))
    if name not in LIMITED:
        raise SceneError(
            f"engine {name}: its joints never fail, so a mortar changes nothing; "
            f"use the engine {' or '.join(LIMITED)}"
        )
    mortar = find_mortar(mortar)
    return _known_by(
        LIMITED[name](network, mortar), Recipe(name, network.scene, {"mortar": mortar})
    )


def _known_by(engine: Engine, recipe: Recipe) -> Engine:
    """Return an engine that says how it was made, so that others can make it again."""
    vars(engine)["recipe"] = recipe
    return engine
