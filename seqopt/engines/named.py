"""What engines say at the prompt."""

from __future__ import annotations

from typing import TYPE_CHECKING

from seqopt.network.network import Network


class NamedEngine:
    """Base of engines: they say what they are and which structure they compute."""

    if TYPE_CHECKING:

        @property
        def network(self) -> Network:
            """The network whose nodes and edges the fields follow."""

    def __repr__(self) -> str:
        scene = self.network.scene
        return f"<{type(self).__name__} of {scene.name}: {len(scene.bricks)} bricks>"
