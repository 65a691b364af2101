"""A build as a film: a GIF that plays everywhere, or a video of the size of a slide.

Videos are written by an ffmpeg that is installed: wheels that bring one along bring parts of it
under the GPL.
"""

from __future__ import annotations

import io
import tempfile
from base64 import b64encode
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import CalledProcessError, run
from typing import Any

import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.figure import Figure
from PIL import Image  # comes with matplotlib

from seqopt.engines.interface import Engine
from seqopt.errors import ExtraError, FileError
from seqopt.report._pictures import VIEW, Stage
from seqopt.report._robots import Arms
from seqopt.report._style import new_picture, styled
from seqopt.report.draw import draw_grips
from seqopt.sequence.steps import Step

_DPI, _WIDTH, _COLORS = 80, 6.0, 128  # of a GIF; inches
_SLIDE, _SHARP = (9.6, 5.4), 200  # inches, and dots an inch: 1920 x 1080
_RATE = 25  # pictures a second of a video, so that every player shows it
_CODECS = {".mp4": "libx264", ".webm": "libvpx-vp9"}


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
        """Write the film to a file that ends in ``.gif``, ``.mp4`` or ``.webm``.

        Videos are 1920 by 1080 and need ffmpeg on the path. Raises `ExtraError` if it is not there;
        `FileError` if the film cannot be written.
        """
        path = Path(path)
        self.require(path)
        try:
            if path.suffix == ".gif":
                path.write_bytes(_gif(self._figures(), self.seconds))
            else:
                self._write_video(path)
        except OSError as error:
            raise FileError(f"cannot write {path}: {error.strerror}; name another") from error
        return path

    @staticmethod
    def require(path: Path) -> None:
        """Raise what `save` would, as far as it is known before anything is drawn."""
        if path.suffix not in (".gif", *_CODECS):
            raise FileError(f"film {path}: give a name that ends in .gif, .mp4 or .webm")
        if not path.parent.is_dir():
            raise FileError(f"cannot write {path}: there is no folder {path.parent}; name another")
        if path.suffix == ".gif":
            return
        if not FFMpegWriter.isAvailable():
            raise ExtraError(
                f"film {path}: a video needs ffmpeg, which is not on the path: install it from "
                "ffmpeg.org, or give a name that ends in .gif"
            )
        asked = [FFMpegWriter.bin_path(), "-hide_banner", "-encoders"]
        able = run(asked, capture_output=True, text=True, check=False).stdout.split()
        if _CODECS[path.suffix] not in able:
            raise FileError(f"film {path}: this ffmpeg has no {_CODECS[path.suffix]}; name a .gif")

    def _write_video(self, path: Path) -> None:
        """Write a video; first beside its place, so that none is left half written."""
        more = ["-pix_fmt", "yuv420p", "-r", str(_RATE), "-crf", "20", "-b:v", "0"]
        codec = _CODECS[path.suffix]
        writer = FFMpegWriter(fps=1 / self.seconds, codec=codec, extra_args=more)  # type: ignore[arg-type]
        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder) / f"film{path.suffix}"
            with suppress(CalledProcessError):  # then there is no film
                for at, figure in enumerate(self._figures(_SLIDE)):
                    if at == 0:
                        writer.setup(figure, str(made), _SHARP)
                    writer.grab_frame()
                writer.finish()
            if not made.is_file() or not made.stat().st_size:
                raise FileError(f"film {path}: this ffmpeg cannot write {codec}; name a .gif")
            path.write_bytes(made.read_bytes())

    def _figures(self, size: tuple[float, float] | None = None) -> Iterator[Figure]:
        """Yield a figure for every step: the same one, drawn anew."""
        how: Any = {"forces": self.forces, "magnify": self.magnify, "arms": self.arms}
        stage = Stage(self.engine, self.steps, **how)
        low, high = stage.box
        wide, tall = _WIDTH, max(_WIDTH * (high - low)[1] / (high - low)[0], 2.0) + 0.5
        if size is not None:  # what is seen fills it
            wide, tall = size
            ratio, middle, room = wide * 0.96 / (tall * 0.88), (low + high) / 2, high - low
            half = 0.5 * np.array([max(room[0], ratio * room[1]), max(room[1], room[0] / ratio)])
            stage.box = middle - half, middle + half
        figure = new_picture(wide, tall, "none")
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.88))
        for at, step in enumerate(self.steps):
            axes.clear()
            stage.draw(axes, at)
            draw_grips(axes, self.engine.network, step.grips, VIEW)
            yield figure


def _gif(figures: Iterator[Figure], seconds: float) -> bytes:
    """Return figures as a GIF of few colors, the same in all: less than half of the bytes."""
    frames = []
    for figure in figures:
        shown = io.BytesIO()
        figure.savefig(shown, format="png", dpi=_DPI)
        frames.append(Image.open(shown).convert("RGB"))
    wide, high = frames[0].size
    some = [frames[k * (len(frames) - 1) // 3] for k in range(4)]
    sample = Image.new("RGB", (wide, len(some) * high))
    for k, frame in enumerate(some):
        sample.paste(frame, (0, k * high))
    colors, plain = sample.quantize(_COLORS, Image.Quantize.FASTOCTREE), Image.Dither.NONE
    palette = np.array(colors.getpalette()).reshape(-1, 3)
    palette[palette.sum(axis=1).argmax()] = 255  # the background stays white
    colors.putpalette(palette.ravel().tolist())
    first, *more = (frame.quantize(palette=colors, dither=plain) for frame in frames)
    out = io.BytesIO()
    how: Any = {"save_all": True, "append_images": more, "loop": 0, "optimize": True}
    first.save(out, format="GIF", duration=round(1000 * seconds), **how)
    return out.getvalue()
