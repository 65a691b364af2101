"""Answers to blocks of states in a folder, by content, so that a run can go on where one ended.

Every block is a file of its own, written whole: a checksum of all that follows, the numbers, then
what the engine counted. No more is read than an answer to the block can be, and a file is believed
only if it is whole and its block's own: whatever is damaged is computed again. Against somebody who
writes false numbers with their checksum there is `seqopt.placement.anew`.
"""

from __future__ import annotations

import hashlib
import json
import time
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
DIGEST = 32  # bytes of a checksum
WORDS = 2**16  # bytes that what an engine counted takes at most


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
        """Return the file of a block."""
        return self._folder / f"{block.bricks}-{block.key[:48]}.answers"

    def find(self, block: Block) -> Answers | None:
        """Return the answers to a block, if they are there and whole."""
        sets, columns = len(block.grips), len(block.names) + block.grips.shape[1]
        words = DIGEST + 8 * sets * columns
        try:
            with self.path(block).open("rb") as file:
                content = file.read(words + WORDS + 1)
        except OSError:
            return None
        whole = words <= len(content) <= words + WORDS
        if not whole or content[:DIGEST] != self._checksum(block, content[DIGEST:]):
            return None
        numbers = np.frombuffer(content[DIGEST:words], "<f8").reshape(columns, sets).astype(float)
        if not np.isfinite(numbers).all():
            return None
        try:
            rows = json.loads(content[words:])
            tally = tuple((LevelChoice(Level(level), why), int(n)) for level, why, n in rows)
        except (ArithmeticError, RecursionError, TypeError, ValueError):  # checked, and yet false
            return None
        values = dict(zip(block.names, numbers, strict=False))
        return Answers(values, numbers[len(values) :].T.copy(), tally)

    def keep(self, block: Block, answers: Answers) -> None:
        """Write the answers to a block.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        numbers = np.array([*(answers.values[name] for name in block.names), *answers.forces.T])
        words = json.dumps([_words(what, count) for what, count in answers.tally])
        content = numbers.astype("<f8").tobytes() + words.encode()
        write_bytes(self.path(block), self._checksum(block, content) + content)

    def _checksum(self, block: Block, content: bytes) -> bytes:
        """Return the checksum of what is to be known of a block."""
        return hashlib.sha256(f"{self._recipe.key} {block.key} ".encode() + content).digest()


def open_store(folder: Path | str | None, engine: Engine) -> Store | None:
    """Return the store of an engine's answers in a folder.

    Parameters
    ----------
    folder : str or pathlib.Path or None
        None for none.
    engine : Engine

    Raises
    ------
    FileError, SceneError
        As of `Store`.
    """
    return None if folder is None else Store(Path(folder), engine)


def _words(what: object, count: int) -> list[str | int]:
    if not isinstance(what, LevelChoice):
        raise SceneError(f"cache: an engine that counts {what!r} cannot be kept; take no cache")
    return [what.level.value, what.reason, count]


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
