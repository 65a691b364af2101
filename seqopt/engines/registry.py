"""The engines by name."""

from __future__ import annotations

from collections.abc import Callable

from seqopt.contact.mortar import Mortar
from seqopt.engines.auto import AutoEngine
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Engine
from seqopt.engines.planar import PlanarEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneError
from seqopt.network.network import Network

ENGINES: dict[str, Callable[[Network], Engine]] = {
    "auto": AutoEngine,
    "planar": PlanarEngine,
    "compliance": ComplianceEngine,
    "frame": FrameEngine,
    "discrete": DiscreteEngine,
}
LIMITED: dict[str, Callable[[Network, Mortar], Engine]] = {
    "auto": AutoEngine,
    "discrete": DiscreteEngine,
}  # engines whose joints hold only what their mortar does


def make_engine(name: str, network: Network, mortar: Mortar | None = None) -> Engine:
    """Return an engine by name, with a mortar in place of the study's epoxy.

    Raises
    ------
    SceneError
        If the engine's joints hold anything, or cannot be those of the scene.
    """
    if mortar is None:
        return ENGINES[name](network)
    if name not in LIMITED:
        raise SceneError(
            f"engine {name}: its joints hold anything, so that a mortar changes nothing; "
            f"use --engine {' or '.join(LIMITED)}"
        )
    return LIMITED[name](network, mortar)
