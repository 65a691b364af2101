"""Array types, the cross-product matrix, and frozen values that hold arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Vector = tuple[float, float, float]


def skew(vectors: Floats) -> Floats:
    """Return the matrices that take the cross product with vectors from the left.

    Parameters
    ----------
    vectors : (..., 3) float

    Returns
    -------
    (..., 3, 3) float
    """
    out = np.zeros((*vectors.shape, 3))
    out[..., [2, 0, 1], [1, 2, 0]] = vectors
    out[..., [1, 2, 0], [2, 0, 1]] = -vectors
    return out


class FrozenValue:
    """Base of frozen dataclasses that hold arrays.

    Arrays become read-only when the value is made, and again after unpickling. Values are equal if
    all their fields are, arrays element by element; equal values have equal hashes. Subclasses are
    decorated with ``@dataclass(frozen=True, eq=False, repr=False)``.
    """

    def __post_init__(self) -> None:
        _freeze(vars(self))

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        _freeze(vars(self))

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self is other or all(_same(*pair) for pair in zip(_parts(self), _parts(other)))  # noqa: B905  # one class, as many fields

    def __hash__(self) -> int:
        return hash((type(self), *map(_hashable, _parts(self))))

    def __repr__(self) -> str:
        names = [field.name for field in fields(self) if field.repr]  # type: ignore[arg-type]
        text = ", ".join(f"{name}={_short(getattr(self, name))}" for name in names)
        return f"{type(self).__name__}({text})"


def _parts(value: object) -> list[object]:
    """Return the contents of the fields that count when values are compared."""
    return [getattr(value, field.name) for field in fields(value) if field.compare]  # type: ignore[arg-type]


def _freeze(content: object) -> None:
    """Make the arrays in a dictionary, tuple or array read-only."""
    if isinstance(content, np.ndarray):
        content.flags.writeable = False
    elif isinstance(content, sparse.csr_array):
        _freeze([content.data, content.indices, content.indptr])
    elif isinstance(content, Mapping):
        _freeze([*content.values()])
    elif isinstance(content, list | tuple):
        for part in content:
            _freeze(part)


def _same(first: object, second: object) -> bool:
    """Return whether two contents are equal, arrays element by element, NaN like NaN."""
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        return first.dtype == second.dtype and np.array_equal(
            first, second, equal_nan=first.dtype.kind == "f"
        )
    if isinstance(first, sparse.csr_array) and isinstance(second, sparse.csr_array):
        stored = ((m.shape, m.data, m.indices, m.indptr) for m in (first, second))
        return _same(*stored)
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return first.keys() == second.keys() and all(_same(first[k], second[k]) for k in first)
    if isinstance(first, list | tuple) and type(first) is type(second):
        return len(first) == len(second) and all(map(_same, first, second))
    return bool(first == second)


def _hashable(content: object) -> object:
    """Return something with a hash that equal contents share."""
    if isinstance(content, np.ndarray):
        plain = content + 0.0 if content.dtype.kind == "f" else content  # -0.0 equals 0.0
        return content.shape, plain.tobytes()
    if isinstance(content, sparse.csr_array):
        return content.shape
    if isinstance(content, Mapping):
        return frozenset((key, _hashable(value)) for key, value in content.items())
    if isinstance(content, list | tuple):
        return tuple(map(_hashable, content))
    return content


def _short(content: object) -> str:
    """Return a representation of a few words: an array is its shape and type."""
    if isinstance(content, np.ndarray | sparse.csr_array):
        return f"<{' x '.join(map(str, content.shape)) or 'one'} {content.dtype}>"
    if isinstance(content, Mapping):
        return "{" + ", ".join(f"{key!r}: {_short(content[key])}" for key in content) + "}"
    if isinstance(content, list | tuple) and len(content) > 3:
        return f"<{len(content)} {type(content[0]).__name__}>"
    if isinstance(content, list | tuple):
        return "(" + ", ".join(map(_short, content)) + ")"
    return repr(content)
