"""The engines by name."""

from __future__ import annotations

from collections.abc import Callable

from seqopt.assembly import Mortar
from seqopt.compliance import ComplianceEngine
from seqopt.discrete import DiscreteEngine
from seqopt.errors import SceneError
from seqopt.fidelity import AutoEngine
from seqopt.fields import Engine
from seqopt.frame import FrameEngine
from seqopt.network import Network
from seqopt.planar import PlanarEngine

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
