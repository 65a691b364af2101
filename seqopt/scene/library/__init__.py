"""Scenes from numbers: chains, walls, domes and vaults of any size.

Each generator takes the numbers that shape what it builds and returns a checked scene in which no
two bricks are in one place and every joint lies between the faces of its bricks:

>>> from seqopt.scene.library import DomeShape, WallShape, chain, dome, wall
>>> chain(100)
<Scene chain 100: 100 bricks, 99 joints, 2 ground ends, 3 robots>
>>> wall(WallShape(columns=6, courses=4))
<Scene wall 6 x 4: 24 bricks, 53 joints, 6 ground ends, 3 robots>
>>> dome(DomeShape(courses=6, around=20, bond="herringbone")).grounds[0].brick
1

A vault grows in herringbone from an arch that stands in its middle:

>>> from seqopt.scene import load_scene
>>> from seqopt.scene.library import VaultShape, herringbone_vault
>>> herringbone_vault(load_scene("arch25"), VaultShape(bricks=100))
<Scene vault 100: 100 bricks, 241 joints, 6 ground ends, 3 robots>

Arches of other shapes come from `seqopt.scene.arch_scene`.
"""

from seqopt.scene.library.chain import chain
from seqopt.scene.library.dome import dome
from seqopt.scene.library.dome_shape import DomeShape
from seqopt.scene.library.law import JointLaw
from seqopt.scene.library.vault import herringbone_vault
from seqopt.scene.library.vault_surface import VaultShape
from seqopt.scene.library.wall import WallShape, wall

__all__ = [
    "DomeShape",
    "JointLaw",
    "VaultShape",
    "WallShape",
    "chain",
    "dome",
    "herringbone_vault",
    "wall",
]
