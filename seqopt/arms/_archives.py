"""Archives of arrays (npz), all of whose sizes are checked before unpacking.

A directory may be forged, so unpacking is limited to the announced size of a part.
"""

from __future__ import annotations

import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterable

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import FileError

_LARGEST = 256_000_000  # bytes of all parts unpacked: 16 million arcs with one amount
_MOST = 1000  # parts; every one takes memory before the first is read
_ENTRY = b"PK\x01\x02"  # begins what the directory says of a part
_BROKEN = (
    *(zipfile.BadZipFile, EOFError, NotImplementedError, OSError, OverflowError, RuntimeError),
    *(ValueError, struct.error, zlib.error),
)  # what reading broken bytes raises


class Archive:
    """An archive, unpacked lazily.

    ``content``: its bytes; ``where``: its name in messages. Raises `FileError` if it is invalid,
    has too many parts, or is too large.
    """

    def __init__(self, content: bytes, where: str) -> None:
        self._where = where
        if content.count(_ENTRY) > _MOST:
            raise FileError(f"{where}: it has more than {_MOST} parts; leave out what is not asked")
        try:
            self._file = zipfile.ZipFile(io.BytesIO(content))
        except _BROKEN as error:
            raise FileError(f"{where}: no archive that can be read: {error}") from error
        every = self._file.infolist()
        self._parts = {each.filename: each for each in every}
        if len(self._parts) < len(every):
            raise FileError(f"{where}: it has a part twice; keep one")
        size = sum(each.file_size for each in every)
        if size > _LARGEST:
            raise FileError(
                f"{where}: unpacked it has {size / 1e6:.0f} MB, more than {_LARGEST / 1e6:.0f}; "
                "give a smaller one"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its parts."""
        return tuple(self._parts)

    def require(self, names: Iterable[str]) -> None:
        """Raise a `FileError` unless the archive has exactly the named parts."""
        wanted, there = {*names}, {*self._parts}
        for name in sorted(wanted - there):
            raise FileError(f"{self._where}: it has no {name}; write it again")
        for name in sorted(there - wanted):
            raise FileError(f"{self._where}: nothing says what {name[:60]!r} is; leave it out")

    def read(self, name: str) -> bytes:
        """Return the content of a part; raise a `FileError` if it is missing or damaged."""
        if name not in self._parts:
            raise FileError(f"{self._where}: it has no {name}; write it again")
        part = self._parts[name]
        if part.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise FileError(f"{self._where}: {name} is not packed by deflate; pack it so")
        try:
            with self._file.open(part) as stream:
                return stream.read(part.file_size + 1)  # of a number it unpacks no more than that
        except _BROKEN as error:
            raise FileError(f"{self._where}: {name} cannot be unpacked: {error}") from error

    def text(self, name: str) -> str:
        """Return a part as text; raise a `FileError` if it is not UTF-8, or as `read`."""
        try:
            return self.read(name).decode()
        except UnicodeDecodeError as error:
            raise FileError(f"{self._where}: {name} is not UTF-8 text; write it again") from error

    def array(self, name: str, kinds: str, shape: tuple[int | None, ...]) -> np.ndarray:
        """Return an array.

        ``kinds``: accepted type kinds, as letters of NumPy; ``shape``: required one, None for
        any size. Raises `FileError` for other content.
        """
        content = io.BytesIO(self.read(f"{name}.npy"))
        try:
            found = np.lib.format.read_array(content, allow_pickle=False)
        except (*_BROKEN, MemoryError, SyntaxError, TypeError, tokenize.TokenError):
            raise FileError(f"{self._where}: {name} is no array that numpy.save wrote") from None
        wanted = zip(found.shape, shape, strict=False)
        fits = found.ndim == len(shape) and all(want in (None, has) for has, want in wanted)
        if not fits or found.dtype.kind not in kinds:
            text = " x ".join("any" if each is None else str(each) for each in shape) or "one"
            raise FileError(
                f"{self._where}: {name} has shape {found.shape} of {found.dtype}; "
                f"{text} of kind {' or '.join(kinds)} belongs there"
            )
        return found

    def indices(self, name: str, shape: tuple[int | None, ...], least: int, end: int) -> Ints:
        """Return an array of integers from one bound on and below another; else as `array`."""
        found = self.array(name, "iu", shape)
        if found.size and not least <= int(found.min()) <= int(found.max()) < end:
            worst = int(found.min() if int(found.min()) < least else found.max())
            raise FileError(f"{self._where}: {name}: {worst} is not from {least} to {end - 1}")
        return found.astype(np.int64)

    def numbers(self, name: str, shape: tuple[int | None, ...], least: float = -np.inf) -> Floats:
        """Return an array of finite numbers, none below a bound; else as `array`."""
        found = self.array(name, "iuf", shape).astype(float)
        if not (np.isfinite(found) & (found >= least)).all():
            text = "" if np.isinf(least) else f" from {least:g}"
            raise FileError(f"{self._where}: {name}: give finite numbers{text}")
        return found
