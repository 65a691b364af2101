"""The double-cross network: a scene as nodes, edges and springs, sorted by when they appear.

>>> from seqopt.network import build_network
>>> from seqopt.scene import load_scene
>>> network = build_network(load_scene("arch25"))
>>> network
<Network arch25: 25 bricks, 26 springs, 78 nodes, 77 edges>

The parts of a partial structure come first in every array, so its brick count is enough:

>>> network.count_nodes(3), network.count_edges(3), network.springs.acting(3)
(11, 10, array([0, 1, 2]))
"""

from seqopt.network.network import Network, build_network

__all__ = ["Network", "build_network"]
