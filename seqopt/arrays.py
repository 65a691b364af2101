"""Array types, the cross-product matrix, and frozen values that hold arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from enum import Enum
from itertools import accumulate
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Vector = tuple[float, float, float]
_Content = TypeVar("_Content")
_LONGEST = 240  # letters of what is shown of a value without its name

_COMPRESSED = (sparse.csr_array, sparse.csc_array)


def skew(vectors: Floats) -> Floats:
    """Return the matrices (..., 3, 3) that take the cross product with vectors (..., 3).

    >>> skew(np.array([1.0, 2.0, 3.0])) @ np.array([0.0, 0.0, 1.0])
    array([ 2., -1.,  0.])
    """
    out = np.zeros((*vectors.shape, 3))
    out[..., [2, 0, 1], [1, 2, 0]] = vectors
    out[..., [1, 2, 0], [2, 0, 1]] = -vectors
    return out


class Terse:
    """Base of dataclasses with a short representation.

    Arrays are shown by shape and type, long tuples by length, numbers with six digits; fields at
    their defaults are left out, and what would go beyond `_LONGEST` letters is counted. Subclasses
    are decorated with ``@dataclass(repr=False)``.
    """

    def __repr__(self) -> str:
        own = vars(type(self)).get("__annotations__", {})  # before those of a base
        plain = (str, int, float, tuple, type(None), Enum)
        shown = []
        for field in sorted(fields(self), key=lambda field: field.name not in own):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            usual = field.default is not MISSING and isinstance(value, plain)
            if field.repr and not (usual and value == field.default):
                shown.append(f"{field.name}={_short(value)}")
        ends = accumulate(len(text) + 2 for text in shown)
        kept = max(1, sum(end <= _LONGEST for end in ends))
        more = [f"and {len(shown) - kept} more"] if kept < len(shown) else []
        return f"{type(self).__name__}({', '.join(shown[:kept] + more)})"


class FrozenValue(Terse):
    """Base of frozen dataclasses that hold arrays.

    A value takes over the arrays it is made of: they become read-only at once, and again after
    unpickling; so do those of cached properties that end in `frozen`. Values of one class are equal
    if all their fields are, arrays element by element and NaN like NaN; equal values have equal
    hashes. Subclasses are decorated with ``@dataclass(frozen=True, eq=False, repr=False)``.

    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, eq=False, repr=False)
    ... class Load(FrozenValue):
    ...     force: Floats
    >>> Load(np.ones(3)) == Load(np.ones(3)), Load(np.ones(3))
    (True, Load(force=<3 float64>))
    """

    def __post_init__(self) -> None:
        frozen(vars(self))

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(frozen(state))

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self is other or all(map(_same, _parts(self), _parts(other)))

    def __hash__(self) -> int:
        return hash((type(self), *map(_hashable, _parts(self))))


def frozen(content: _Content) -> _Content:
    """Return the content with arrays read-only, also sparse ones and within tuples and mappings."""
    if isinstance(content, np.ndarray):
        content.setflags(write=False)
    elif isinstance(content, _COMPRESSED):
        for part in (content.data, content.indices, content.indptr):
            part.flags.writeable = False
    elif isinstance(content, dict | list | tuple):
        for part in content.values() if isinstance(content, dict) else content:
            if type(part) is np.ndarray:
                part.setflags(write=False)
            elif not isinstance(part, str | int):  # names are many
                frozen(part)
    return content


def _parts(value: FrozenValue) -> list[object]:
    """Return the values of the fields that comparisons use."""
    return [getattr(value, field.name) for field in fields(value) if field.compare]  # type: ignore[arg-type]


def _same(first: object, second: object) -> bool:
    """Return whether two contents are equal, arrays element by element, NaN like NaN."""
    if first is None or second is None:
        return first is second
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        return first.dtype == second.dtype and np.array_equal(
            first, second, equal_nan=first.dtype.kind == "f"
        )
    if isinstance(first, _COMPRESSED) and isinstance(second, _COMPRESSED):
        names = ("format", "shape", "data", "indices", "indptr")
        return all(_same(getattr(first, name), getattr(second, name)) for name in names)
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return first.keys() == second.keys() and all(_same(first[k], second[k]) for k in first)
    if isinstance(first, list | tuple) and type(first) is type(second):
        return len(first) == len(second) and all(map(_same, first, second))
    return bool(first == second) or (_is_nan(first) and _is_nan(second))


def _is_nan(content: object) -> bool:
    return isinstance(content, float) and content != content  # noqa: PLR0124  # NaN alone does


def _hashable(content: object) -> object:
    """Return a hashable value, equal for equal contents."""
    if isinstance(content, np.ndarray):
        if content.dtype.kind == "f":  # -0.0 equals 0.0, and one NaN another
            content = np.where(np.isnan(content), np.nan, content + 0.0)
        return content.shape, content.tobytes()
    if isinstance(content, _COMPRESSED):
        return content.shape
    if isinstance(content, Mapping):
        return frozenset((key, _hashable(value)) for key, value in content.items())
    if isinstance(content, list | tuple):
        return tuple(map(_hashable, content))
    return "NaN" if _is_nan(content) else content


def _short(content: object) -> str:
    """Return a representation of a few words: an array is its shape and type."""
    if isinstance(content, Enum):
        return repr(content.value)
    if isinstance(content, float):
        return f"{content:.6g}"
    if isinstance(shape := getattr(content, "shape", None), tuple):
        size, kind = " x ".join(map(str, shape)) or "one", getattr(content, "dtype", "table")
        return f"<{size} {kind}>"
    if isinstance(content, Mapping):
        return "{" + ", ".join(f"{key!r}: {_short(content[key])}" for key in content) + "}"
    if isinstance(content, list | tuple):
        many = f"<{len(content)} {type(content[0]).__name__}>" if len(content) > 3 else ""
        return many or "(" + ", ".join(map(_short, content)) + ")"
    return repr(content)


class KnownRows:
    """Cached rows of values by a key and a code.

    ``count``: the number computed; ``nbytes``: what they and their codes take, bytes.

    >>> rows = KnownRows()
    >>> codes = np.array([3, 1, 3])
    >>> rows.of("squares", codes, lambda places: codes[places, None] ** 2.0).ravel()
    array([9., 1., 9.])
    >>> rows.count, rows.nbytes
    (2, 32)
    """

    def __init__(self) -> None:
        self._known: dict[object, tuple[Ints, Floats]] = {}
        self.count = self.nbytes = 0

    def known(self, key: object, codes: Ints, column: int = 0) -> Floats:
        """Return values (n,) of cached rows; NaN of others."""
        known, values = self._known.get(key, (codes[:0], None))
        if values is None or not len(known):
            return np.full(len(codes), np.nan)
        at = np.searchsorted(known, codes).clip(max=len(known) - 1)
        return np.where(known[at] == codes, values[at, column], np.nan)

    def shared(self, other: KnownRows) -> int:
        """Return how many rows both have."""
        pairs = ((codes, other._known.get(key)) for key, (codes, _) in self._known.items())
        return sum(len(np.intersect1d(codes, found[0])) for codes, found in pairs if found)

    def of(self, key: object, codes: Ints, compute: Callable[[Ints], Floats]) -> Floats:
        """Return the rows of codes; those not cached are computed as one batch.

        ``key``: codes of other keys are others; ``codes`` (n,); ``compute``: returns the rows (m,
        k) of distinct codes, given the places (m,) of their first occurrence in the request.
        Result (n, k).
        """
        distinct, first = np.unique(codes, return_index=True)
        known, values = self._known.get(key, (distinct[:0], None))
        fresh = first[~np.isin(distinct, known, assume_unique=True)]
        if values is None or len(fresh):
            computed = compute(fresh)
            known = np.concatenate([known, codes[fresh]])
            values = computed if values is None else np.concatenate([values, computed])
            order = np.argsort(known, kind="stable")
            known, values = known[order], values[order]
            self._known[key] = known, values
            self.count += len(fresh)
            self.nbytes += codes[fresh].nbytes + computed.nbytes
        return np.asarray(values[np.searchsorted(known, codes)])
