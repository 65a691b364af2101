"""Discrete elements: rigid bricks on beds of springs that open, slip and break.

`DiscreteEngine` lays a bed over every joint's face (`BedStiffness` and `Mortar` say what it
carries), holds nodes, and follows the structure to rest.
"""

from typing import TYPE_CHECKING

from seqopt._later import later
from seqopt.contact.mortar import BedStiffness

if TYPE_CHECKING:
    from seqopt.engines.discrete.engine import DiscreteEngine

__all__ = ["BedStiffness", "DiscreteEngine"]
__getattr__, __dir__ = later(__name__, {"DiscreteEngine": "engine"})
