"""Blocks of a file that interpenetrate: named and refused, unless the user accepts them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice

from seqopt.errors import SceneError
from seqopt.scene._overlaps import Overlap, find_overlaps
from seqopt.scene.imports._content import Content, Given
from seqopt.scene.imports._meshes import Repaired
from seqopt.scene.imports.contacts import _widest_gap
from seqopt.scene.parts import Brick
from seqopt.scene.shape import Polyhedron

_MOST = 100  # pairs that interpenetrate, after which no more are sought
_SHOWN = 3  # of these in an error


def interpenetrating(
    content: Content, given: Given, blocks: Sequence[Repaired], bricks: Mapping[int, Brick]
) -> tuple[set[int], list[str]]:
    """Return blocks that interpenetrate by more than faces tolerate, and a line on each pair.

    Raises `SceneError` unless the user accepts them. A gap that is wider than by default makes no
    overlap right, so that it counts where it is narrower.
    """
    most = min(_widest_gap(way, bricks) for way in (given, replace(given, gap=None)))
    found = islice(_pairs(content, given, blocks, most), _MOST)
    overlaps = sorted(
        ((pair, each) for pair, each in found if {*pair} & bricks.keys()),
        key=lambda held: -held[1].depth,
    )
    keys = [block.key for block in content.blocks]
    lines = [f"blocks {keys[i]} and {keys[j]} interpenetrate {each}" for (i, j), each in overlaps]
    if lines and not given.accept_overlaps:
        more = f"; {len(lines) - _SHOWN} more pairs do" if len(lines) > _SHOWN else ""
        raise SceneError(
            f"{'; '.join(lines[:_SHOWN])}{more}; faces tolerate {1e3 * most:.3g} mm: move them "
            "apart, or accept it (--accept-overlaps)"
        )
    return {i for pair, _ in overlaps for i in pair}, [f"{line}, as accepted" for line in lines]


def _pairs(
    content: Content, given: Given, blocks: Sequence[Repaired], most: float
) -> Iterator[tuple[tuple[int, int], Overlap]]:
    """Yield overlaps with the places of their blocks.

    Bars of a frame, and beams that joints of the file hold together, run into each other by intent.
    """
    if content.joints and all(joint.translational for joint in content.joints):
        return
    intended = {frozenset(joint.blocks) for joint in content.joints}
    solids = {i: b.solid for i, b in enumerate(blocks) if isinstance(b.solid, Polyhedron)}
    places = [*solids]
    for each in find_overlaps([*solids.values()], [most] * len(solids), given.progress):
        pair = (places[each.pair[0]], places[each.pair[1]])
        if frozenset(pair) not in intended:
            yield pair, each
