r"""Scenes from files of other programs, and plans in their formats.

COMPAS, meshes, tables of boxes and frames are read, and the packages that wrote the files are not
needed:

>>> import tempfile
>>> from pathlib import Path
>>> from seqopt.exchange import Given, import_scene
>>> with tempfile.TemporaryDirectory() as folder:
...     path = Path(folder, "two.csv")
...     _ = path.write_text("x,y,z,length,width,height\n0,0,1,2,1,2\n0,0,2.5,2,1,1\n")
...     scene = import_scene(path, given=Given(unit="m", density=2000.0))
>>> print(scene.provenance.splitlines()[1])
a table of boxes: no faces

Plans are written as tasks of robots, and for COMPAS (`export`). Tables of steps are read as plans
and as schedules with open grips (`read_plan`, `read_schedule`).
"""

from typing import TYPE_CHECKING

from seqopt._registry import later

if TYPE_CHECKING:
    from seqopt.exchange._content import Content, FileBlock, Given
    from seqopt.exchange._formats import Format
    from seqopt.exchange._tasks import plan_tasks
    from seqopt.exchange.exports import export
    from seqopt.exchange.imports import import_scene
    from seqopt.exchange.schedules import read_plan, read_schedule

__all__ = [
    "Content",
    "FileBlock",
    "Format",
    "Given",
    "export",
    "import_scene",
    "plan_tasks",
    "read_plan",
    "read_schedule",
]
__getattr__, __dir__ = later(
    __name__,
    {
        "Content": "_content",
        "FileBlock": "_content",
        "Format": "_formats",
        "Given": "_content",
        "export": "exports",
        "import_scene": "imports",
        "plan_tasks": "_tasks",
        "read_plan": "schedules",
        "read_schedule": "schedules",
    },
)
