r"""Scenes from files of other programs: COMPAS, meshes, tables of boxes, frames.

The packages that wrote the files are not needed:

>>> import tempfile
>>> from pathlib import Path
>>> from seqopt.scene.imports import Given, import_scene
>>> with tempfile.TemporaryDirectory() as folder:
...     path = Path(folder, "two.csv")
...     _ = path.write_text("x,y,z,length,width,height\n0,0,1,2,1,2\n0,0,2.5,2,1,1\n")
...     scene = import_scene(path, given=Given(unit="m", density=2000.0))
>>> print(scene.provenance.splitlines()[1])
a table of boxes: no faces
"""

from seqopt.scene.imports._content import Content, Given
from seqopt.scene.imports.formats import FORMATS, import_scene

__all__ = ["FORMATS", "Content", "Given", "import_scene"]
