"""Scenes from numbers: arches, barrel vaults and walls of any size.

Each generator takes the numbers that shape what it builds and returns a checked scene in which no
two bricks are in one place and every joint lies between the faces of its bricks:

>>> from seqopt.scene.library import WallShape, chain, wall
>>> chain(100)
<Scene chain 100: 100 bricks, 99 joints, 2 ground ends, 3 robots>
>>> wall(WallShape(columns=6, courses=4))
<Scene wall 6 x 4: 24 bricks, 53 joints, 6 ground ends, 3 robots>

An arch by its span and rise stands on level supports; a wall may be corbelled:

>>> from seqopt.scene.library import ArchForm, arch
>>> arch(ArchForm(span=2.0, rise=0.8, curve="catenary"))
<Scene catenary arch 2 x 0.8: 12 bricks, 11 joints, 2 ground ends, 3 robots>
>>> wall(WallShape(columns=6, courses=4, corbel=0.02)).placed[-1].position[1]
0.06

Arches of other shapes come from `seqopt.scene.arch_scene`. The same in words, wherever a scene is
named:

>>> from seqopt.scene import load_scene
>>> load_scene("vault:span=1.5,rise=0.5,columns=2").grounds[0].brick
1
"""

from typing import Any

from seqopt.scene.library.arch_form import ArchForm, arch, chain
from seqopt.scene.library.common import JointLaw
from seqopt.scene.library.wall import WallShape, _vault, wall

MAKERS: dict[str, Any] = {
    "arch": (arch, ArchForm),
    "chain": (chain, None),
    "vault": (_vault, None),
    "wall": (wall, WallShape),
}
"""What makes a kind of scene, and the shape that this takes, if it takes one."""

__all__ = ["ArchForm", "JointLaw", "WallShape", "arch", "chain", "wall"]
