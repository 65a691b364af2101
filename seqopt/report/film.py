"""A build as a film, a picture per step (extra ``plot``)."""

from __future__ import annotations

import tempfile
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.animation import PillowWriter

from seqopt.engines.interface import Engine
from seqopt.errors import FileError
from seqopt.report.canvas import VIEW, seen_box
from seqopt.report.draw import draw_grips
from seqopt.report.picture import new_picture
from seqopt.report.step_pictures import Drawn, caption, draw_step
from seqopt.report.style import styled
from seqopt.sequence.steps import Step

DPI = 80
SIZE = 6.0  # width, inches


@dataclass(frozen=True, eq=False, repr=False)
class Film:
    """A build as a film: a notebook plays it, `save` writes it.

    Attributes
    ----------
    engine : Engine
        Computes forces and displacements, if these are drawn.
    steps : sequence of Step
    forces : bool
        Whether the network is drawn, colored by axial force.
    magnify : float
        How many times larger displacements are drawn.
    seconds : float
        How long a step is shown, s.
    """

    engine: Engine
    steps: Sequence[Step]
    forces: bool = False
    magnify: float = 0.0
    seconds: float = 0.4

    def __repr__(self) -> str:
        name, count = self.engine.network.scene.name, len(self.steps)
        return f"<Film of {name}: {count} steps; save('build.gif') writes it>"

    def _repr_html_(self) -> str:
        """Return the film as an animated GIF: it plays without scripts, and without a network."""
        with tempfile.TemporaryDirectory() as folder:
            film = self.save(Path(folder) / "film.gif").read_bytes()
        source = f"data:image/gif;base64,{b64encode(film).decode()}"
        return f'<img alt="{len(self.steps)} steps of a build" src="{source}">'

    def save(self, path: str | Path) -> Path:
        """Write the film to a file.

        Parameters
        ----------
        path : str or pathlib.Path
            Ends in ``.gif``.

        Raises
        ------
        FileError
            If it ends in something else, or cannot be written.
        """
        path = Path(path)
        if path.suffix != ".gif":
            raise FileError(f"film {path}: give a name that ends in .gif")
        try:
            self._write(path)
        except OSError as error:
            raise FileError(f"cannot write {path}: {error.strerror}; name another") from error
        return path

    @styled
    def _write(self, path: Path) -> None:
        """Draw every step and hand it to the writer."""
        scene = self.engine.network.scene
        low, high = seen_box(scene)
        width, height = high - low
        figure = new_picture(SIZE, max(SIZE * height / width, 2.0) + 0.5, constrained=False)
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.88))
        rate: Any = 1.0 / self.seconds  # the writer takes fractions
        writer = PillowWriter(fps=rate)
        with writer.saving(figure, path, DPI):
            for step in self.steps:
                axes.clear()
                draw_step(axes, self.engine, step, Drawn(self.forces, self.magnify))
                draw_grips(axes, self.engine.network, step.grips, VIEW)
                axes.set_title(caption(scene, step, len(self.steps)), loc="center")
                axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
                writer.grab_frame()
