"""A build as a film: an animated GIF, which plays everywhere."""

from __future__ import annotations

import io
import tempfile
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image  # comes with matplotlib

from seqopt.engines.interface import Engine
from seqopt.errors import FileError
from seqopt.report._pictures import VIEW, Stage
from seqopt.report._robots import Arms
from seqopt.report._style import new_picture, styled
from seqopt.report.draw import draw_grips
from seqopt.sequence.steps import Step

_DPI, _WIDTH, _COLORS = 80, 6.0, 128  # of a GIF; inches


@dataclass(frozen=True, eq=False, repr=False)
class Film:
    """A build as a film: a notebook plays it, `save` writes it; see `steps_picture`."""

    engine: Engine
    steps: Sequence[Step]
    forces: bool = False
    magnify: float = 0.0
    seconds: float = 0.4
    arms: Arms | None = None

    def __repr__(self) -> str:
        name, count = self.engine.network.scene.name, len(self.steps)
        return f"<Film of {name}: {count} steps; save('build.gif') writes it>"

    def _repr_html_(self) -> str:
        """Return the film as an animated GIF: it plays without scripts, and without a network."""
        with tempfile.TemporaryDirectory() as folder:
            film = self.save(Path(folder) / "film.gif").read_bytes()
        source = f"data:image/gif;base64,{b64encode(film).decode()}"
        return f'<img alt="{len(self.steps)} steps of a build" src="{source}">'

    @styled
    def save(self, path: str | Path) -> Path:
        """Write the film to a file that ends in ``.gif``. Raises `FileError` if it cannot."""
        path = Path(path)
        self.require(path)
        try:
            path.write_bytes(_gif(self._figures(), self.seconds))
        except OSError as error:
            raise FileError(f"cannot write {path}: {error.strerror}; name another") from error
        return path

    @staticmethod
    def require(path: Path) -> None:
        """Raise what `save` would, as far as it is known before anything is drawn."""
        if path.suffix != ".gif":
            raise FileError(f"film {path}: give a name that ends in .gif")
        if not path.parent.is_dir():
            raise FileError(f"cannot write {path}: there is no folder {path.parent}; name another")

    def _figures(self) -> Iterator[Figure]:
        """Yield a figure for every step: the same one, drawn anew."""
        how: Any = {"forces": self.forces, "magnify": self.magnify, "arms": self.arms}
        stage = Stage(self.engine, self.steps, **how)
        wide, tall = stage.box[1] - stage.box[0]
        figure = new_picture(_WIDTH, max(_WIDTH * tall / wide, 2.0) + 0.5, "none")
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.88))
        for at, step in enumerate(self.steps):
            axes.clear()
            stage.draw(axes, at)
            draw_grips(axes, self.engine.network, step.grips, VIEW)
            yield figure


def _gif(figures: Iterator[Figure], seconds: float) -> bytes:
    """Return figures as a GIF of few colors, those of the middle one: less than half the bytes."""
    frames = []
    for figure in figures:
        shown = io.BytesIO()
        figure.savefig(shown, format="png", dpi=_DPI)
        frames.append(Image.open(shown).convert("RGB"))
    colors = frames[len(frames) // 2].quantize(_COLORS, Image.Quantize.FASTOCTREE)
    palette = np.array(colors.getpalette()).reshape(-1, 3)
    palette[palette.sum(axis=1).argmax()] = 255  # the background stays white
    colors.putpalette(palette.ravel().tolist())
    first, *more = (frame.quantize(palette=colors, dither=Image.Dither.NONE) for frame in frames)
    out = io.BytesIO()
    how: Any = {"save_all": True, "append_images": more, "loop": 0, "optimize": True}
    first.save(out, format="GIF", duration=round(1000 * seconds), **how)
    return out.getvalue()
