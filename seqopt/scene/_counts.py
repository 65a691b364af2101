"""Scenes in words, of the same shape, of other numbers of bricks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import sqrt
from typing import Any

from seqopt.errors import SceneError
from seqopt.scene.library.arch_form import ArchForm
from seqopt.scene.library.wall import WallShape
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import _in_words, _made_of_words

_Given = Mapping[str, Any]


def scene_of_bricks(words: str, bricks: int) -> Scene:
    """Return a scene like that of words, as large, of about another number of bricks.

    Bricks are shorter where there are more; those of a wall are also lower. A chain is longer.
    Raises `SceneError` if words say no scene whose bricks can be counted otherwise, or that of so
    many is none.

    >>> scene_of_bricks("arch:span=2,rise=0.8,pattern=VLR", 30)
    <Scene circular arch 2 x 0.8: 30 bricks, 29 joints, 2 ground ends, 3 robots>
    """
    kind = words.partition(":")[0]
    if ":" not in words or kind not in _COUNTED:
        known = ", ".join(f"{name}:" for name in _COUNTED)
        raise SceneError(
            f"scene {words}: its number of bricks is fixed; others are for scenes in words "
            f"({known})"
        )
    given = _in_words(words)
    now = len(_made_of_words(kind, given).bricks)
    return _made_of_words(kind, _COUNTED[kind](given, now, bricks))


def _arch(given: _Given, now: int, bricks: int) -> _Given:
    """Return what makes an arch of more bricks that cover less of it each, joints as they are."""
    form = ArchForm(**given)
    cover = float(form.lengths(now).mean())
    share = (now * (cover + form.gap) / bricks - form.gap) / cover
    long, width, thick = form.dimensions
    across = share if set(form.pattern) - {"V"} else 1.0
    return {**given, "bricks": bricks, "dimensions": (share * long, across * width, thick)}


def _wall(given: _Given, now: int, bricks: int) -> _Given:
    """Return what makes a wall as long and as high, and as far out, of smaller bricks."""
    shape = WallShape(**given)
    columns, courses = _grown(shape.columns, now, bricks), _grown(shape.courses, now, bricks)
    long, width, high = shape.dimensions
    long = (long + shape.gap) * shape.columns / columns - shape.gap
    high = (high + shape.gap) * shape.courses / courses - shape.gap
    corbel = shape.corbel * shape.courses / courses
    sizes = {"dimensions": (long, width, high), "corbel": corbel}
    return {**given, "columns": columns, "courses": courses, **sizes}


def _dome(given: _Given, now: int, bricks: int) -> _Given:
    around = _grown(given["around"], now, bricks)
    return {**given, "courses": _grown(given["courses"], now, bricks), "around": around}


def _grown(count: int, now: int, bricks: int) -> int:
    """Return how many of something there are in one of two ways, where all grow from now on."""
    return max(1, round(count * sqrt(bricks / now)))


_COUNTED: Mapping[str, Callable[[_Given, int, int], _Given]] = {
    "arch": _arch,
    "chain": lambda given, _, bricks: {**given, "bricks": bricks},
    "wall": _wall,
    "dome": _dome,
}
