"""Engines: the fields of every partial structure under every choice of grips.

An engine is made by name from a network and answers grip sets in batches:

>>> from seqopt.engines import Want, make_engine
>>> from seqopt.network import build_network
>>> from seqopt.scene import load_scene
>>> network = build_network(load_scene("arch25"))
>>> engine = make_engine("compliance", network)
>>> fields = engine.solve(4, [[7, 1], [6, 1]])  # four bricks; nodes 7 and 1 held, or 6 and 1
>>> fields.grip_force.shape  # sets, grips, axes
(2, 2, 3)

Only what is wanted is evaluated; what supports and grips carry is all of the weight:

>>> fields = engine.solve(4, [[7, 1]], Want.SUPPORT)
>>> carried = fields.support[0, :, :3].sum(axis=0) + fields.grip_force[0].sum(axis=0)
>>> bool(abs(carried + network.weight[:4].sum(axis=0)).max() < 1e-9)
True

Whether an answer can be well_conditioned is asked apart:

>>> from seqopt.engines import diagnose
>>> diagnose(engine, 4, [7, 1]).finding.value
'SOLVED WELL'
"""

from typing import TYPE_CHECKING

from seqopt._registry import later
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.engines.registry import ENGINES, make_engine

if TYPE_CHECKING:
    from seqopt.engines.diagnosis import Diagnosis, diagnose

__all__ = ["ENGINES", "Diagnosis", "Engine", "Fields", "Want", "diagnose", "make_engine"]
__getattr__, __dir__ = later(__name__, {"Diagnosis": "diagnosis", "diagnose": "diagnosis"})
