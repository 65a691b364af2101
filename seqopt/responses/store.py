"""Answers to blocks of states in a folder, by content, so that a run can go on where one ended.

Every block is a file of its own, written whole. A file is believed only if it is complete and its
block's own: whatever is damaged, or was put there by others, is computed again.
"""

from __future__ import annotations

import io
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np

from seqopt.engines.auto import Level, LevelChoice
from seqopt.engines.interface import Engine
from seqopt.engines.recipe import Recipe
from seqopt.errors import FileError, SceneError
from seqopt.files import HIDDEN, make_folder, require_folder, write_bytes
from seqopt.responses.shipping import known_recipe
from seqopt.responses.states import Answers, Block

LEFT = 3600.0  # s after which a file that is not complete is one that was given up
DAMAGED = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error, SyntaxError)


class Store:
    """The answers of one engine in a folder.

    Parameters
    ----------
    folder : pathlib.Path
        Made if it is not there.
    engine : Engine
        Made by name.

    Raises
    ------
    FileError
        If the folder cannot be written.
    SceneError
        If nobody can say what the engine's answers depend on.
    """

    def __init__(self, folder: Path, engine: Engine) -> None:
        require_folder(folder)
        recipe = known_recipe(engine)
        if recipe is None:
            raise SceneError(
                f"cache {folder}: a {type(engine).__name__} does not say what its answers depend "
                "on; take one of seqopt.make_engine, or no cache"
            )
        self._recipe: Recipe = recipe
        self._folder = folder / recipe.key[:32]
        make_folder(self._folder)
        _tidy(self._folder)

    def path(self, block: Block) -> Path:
        """Return the file of a block.

        Parameters
        ----------
        block : Block

        Returns
        -------
        pathlib.Path
        """
        return self._folder / f"{block.bricks}-{block.key[:48]}.npz"

    def find(self, block: Block) -> Answers | None:
        """Return the answers to a block, if they are there and whole.

        Parameters
        ----------
        block : Block

        Returns
        -------
        Answers or None
        """
        try:
            content = self.path(block).read_bytes()
            with np.load(io.BytesIO(content), allow_pickle=False) as found:
                return self._unpacked(block, found)
        except DAMAGED:
            return None

    def keep(self, block: Block, answers: Answers) -> None:
        """Write the answers to a block.

        Parameters
        ----------
        block : Block
        answers : Answers

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        arrays = {f"value {name}": values for name, values in answers.values.items()}
        if answers.tally:
            arrays["tally"] = np.array([_words(what, count) for what, count in answers.tally])
        buffer = io.BytesIO()
        mark = np.array(self._mark(block))
        np.savez(buffer, allow_pickle=False, mark=mark, forces=answers.forces, **arrays)
        write_bytes(self.path(block), buffer.getvalue())

    def _mark(self, block: Block) -> str:
        return f"{self._recipe.key} {block.key}"

    def _unpacked(self, block: Block, found: np.lib.npyio.NpzFile) -> Answers | None:
        """Return the answers of a file, None if they are not those of the block."""
        if str(found["mark"]) != self._mark(block):
            return None
        values = {name: found[f"value {name}"] for name in block.names}
        forces = found["forces"]
        sets = len(block.grips)
        whole = forces.shape == block.grips.shape and all(
            v.shape == (sets,) for v in values.values()
        )
        if not whole or not all(np.isfinite(a).all() for a in (forces, *values.values())):
            return None
        rows = found["tally"].tolist() if "tally" in found else []
        tally = [(LevelChoice(Level(level), reason), int(n)) for level, reason, n in rows]
        return Answers(values, forces, tuple(tally))


def open_store(folder: Path | str | None, engine: Engine) -> Store | None:
    """Return the store of an engine's answers in a folder.

    Parameters
    ----------
    folder : str or pathlib.Path or None
        None for none.
    engine : Engine

    Returns
    -------
    Store or None

    Raises
    ------
    FileError, SceneError
        As of `Store`.
    """
    return None if folder is None else Store(Path(folder), engine)


def _words(what: object, count: int) -> list[str]:
    if not isinstance(what, LevelChoice):
        raise SceneError(f"cache: an engine that counts {what!r} cannot be kept; take no cache")
    return [what.level.value, what.reason, str(count)]


def _tidy(folder: Path) -> None:
    """Take away what runs that were killed left half-written."""
    for path in folder.glob(f"{HIDDEN}*"):
        try:
            if time.time() - path.stat().st_mtime > LEFT:
                path.unlink()
        except FileNotFoundError:  # another run was faster
            continue
        except OSError as error:
            raise FileError(
                f"cannot tidy {folder}: {error.strerror}; name another cache"
            ) from error
