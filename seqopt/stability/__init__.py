"""Whether partial structures stand: verdicts with proofs, margins, and what fails first.

An assembly of blocks is assessed with the mortar in its joints. Every verdict is proven:

>>> from seqopt.contact import DRY, EPOXY, step_assembly
>>> from seqopt.network import build_network
>>> from seqopt.scene import load_scene
>>> from seqopt.stability import assess
>>> network = build_network(load_scene("arch25"))
>>> assembly = step_assembly(network, 3, (None, None, None))
>>> [assess(assembly, mortar).verdict.value for mortar in (DRY, EPOXY)]
['does not stand', 'stands']

`assess_steps` assesses every step of a build, and `stability_table` has a row for each.
`Screen` finds which of many grip sets stand, and `Margins` by how much, most without a solver.
`load_factors` finds the largest multiple of the scene's loads that every step bears.
"""

from typing import TYPE_CHECKING

from seqopt._registry import later

if TYPE_CHECKING:
    from seqopt.stability._screens import Margins, Screen
    from seqopt.stability._steps import assess_steps, stability_table
    from seqopt.stability.assessment import LoadFactor, Stability, assess, load_factors
    from seqopt.stability.verdict import Verdict

__all__ = [
    "LoadFactor",
    "Margins",
    "Screen",
    "Stability",
    "Verdict",
    "assess",
    "assess_steps",
    "load_factors",
    "stability_table",
]
HOMES = dict.fromkeys(__all__, "assessment")
HOMES |= dict.fromkeys(["Margins", "Screen"], "_screens")
HOMES["Verdict"] = "verdict"
HOMES |= dict.fromkeys(["assess_steps", "stability_table"], "_steps")
__getattr__, __dir__ = later(__name__, HOMES)
