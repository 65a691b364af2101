"""The engines by name."""

from __future__ import annotations

from collections.abc import Callable

from seqopt.compliance import ComplianceEngine
from seqopt.fields import Engine
from seqopt.frame import FrameEngine
from seqopt.network import Network

ENGINES: dict[str, Callable[[Network], Engine]] = {
    "compliance": ComplianceEngine,
    "frame": FrameEngine,
}
