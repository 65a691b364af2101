"""Bricks that touch: the faces of joints, the strength of their mortar, and when it is exceeded.

A partial structure and its grips become rigid blocks with faces between them:

>>> from seqopt.contact import DRY, EPOXY, step_assembly
>>> from seqopt.network import build_network
>>> from seqopt.scene import load_scene
>>> network = build_network(load_scene("arch25"))
>>> assembly = step_assembly(network, 2, (2, None, None))
>>> assembly.contact_name, assembly.area.round(4).tolist()
(('ground-1', '1-2'), [0.0061, 0.0061])

Joints stay elastic as long as the stress on their faces is less than the strength of the mortar:

>>> import numpy as np
>>> from seqopt.contact.mortar import find_elastic_limits
>>> wrench = np.zeros((1, 26, 6))
>>> wrench[0, 0, 0] = 1000.0  # N on the first brick
>>> [bool(find_elastic_limits(network, m).exceeded(wrench)[0]) for m in (DRY, EPOXY)]
[True, False]
"""

from seqopt.contact.assembly import Assembly, step_assembly
from seqopt.contact.mortar import DRY, EPOXY, Mortar

__all__ = ["DRY", "EPOXY", "Assembly", "Mortar", "step_assembly"]
