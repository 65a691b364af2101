"""What is built, in which order, and which robots hold it: a checked, frozen value.

A built-in scene by its name, or a file by its path:

>>> from seqopt.scene import ArchShape, arch_scene, load_scene
>>> load_scene("arch25")
<Scene arch25: 25 bricks, 24 joints, 2 ground ends, 3 robots>

An arch of your own from the angles of its bricks, with robots beside it that reach its line:

>>> shape = ArchShape(pitch=(1.2, 0.6, 0.0, -0.6, -1.2), pattern="V")
>>> scene = arch_scene(shape, "small")
>>> [robot.reach.covers(scene.node_position(9)) for robot in scene.robots]
[True, True, True]

Make any other scene from `Brick`, `Joint`, `Ground` and `Robot`, and `Load` where something else
than its weight loads it; `seqopt.save_scene` writes it to a file.
"""

from typing import TYPE_CHECKING

from seqopt._registry import later
from seqopt.scene.parts import Brick, Ground, Joint, Load, Robot
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene

if TYPE_CHECKING:
    from seqopt.scene.arch import ArchShape, arch_scene

__all__ = [
    "ArchShape",
    "Brick",
    "Ground",
    "Joint",
    "Load",
    "Robot",
    "Scene",
    "arch_scene",
    "load_scene",
]
__getattr__, __dir__ = later(__name__, {"ArchShape": "arch", "arch_scene": "arch"})
