"""The double-cross network: a scene as nodes, edges and springs, sorted by when they appear.

>>> from seqopt.network import build_network
>>> from seqopt.scene import load_scene
>>> network = build_network(load_scene("arch25"))
>>> network
<Network arch25: 25 bricks, 26 springs, 78 nodes, 77 edges>

The parts of a partial structure come first in every array, so its brick count is enough:

>>> network.count_nodes(3), network.count_edges(3), network.springs.acting(3)
(11, 10, array([0, 1, 2]))

Linear maps give the motion of nodes from that of bricks, and edge forces from spring forces:

>>> from seqopt.network import build_statics, node_motion
>>> node_motion(network, 3).shape, build_statics(network).edge_of_spring.shape
((33, 18), (77, 78))
"""

from seqopt.network._mechanics import Statics, build_statics, node_motion
from seqopt.network.build import build_network
from seqopt.network.network import GROUND, Network, PartKind, Springs

__all__ = [
    "GROUND",
    "Network",
    "PartKind",
    "Springs",
    "Statics",
    "build_network",
    "build_statics",
    "node_motion",
]
