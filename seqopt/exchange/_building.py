"""Make a scene from a file's content and the user's additions; report assumptions."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from heapq import heapify, heappop, heappush
from itertools import islice

import numpy as np

from seqopt.errors import SceneError
from seqopt.exchange._content import GROUND, MOST_CORNERS, UNITS, UPS, Content, FileBlock, Given
from seqopt.exchange._doubts import find_overlaps
from seqopt.exchange._meshes import Repaired, repair_shape
from seqopt.exchange.contacts import _find_contacts, _Held, _widest_gap, face_ground, face_joint
from seqopt.scene._checks import LARGEST_NUMBER, one_of, positive, rows, short, whole_between
from seqopt.scene.boxes import block_brick
from seqopt.scene.library.common import MASONRY, JointLaw, _mobile_robots, a_law
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.scene import Scene
from seqopt.scene.shape import Polyhedron

_SAME_MASS = 0.01  # share by which a mass and a density may differ by rounding


ROBOTS = 3  # where nobody says how many
_STUB = 0.1  # of a ground end, over the smallest dimension of its block


def build_scene(content: Content, given: Given, source: str) -> Scene:
    """Return the scene of a file's content and the user's additions; it needs shapely.

    ``source``: what the file is called. What was read, mended and assumed stands in the provenance.
    """
    try:
        said = list(content.said)
        corners = sum(len(face) for block in content.blocks for face in block.faces)
        if not content.blocks:
            raise SceneError("it has no blocks; give an assembly with some")
        if corners > MOST_CORNERS:
            raise SceneError(f"its blocks have {corners} corners; {MOST_CORNERS} is the most")
        unit = _unit(content, given, said)
        up = one_of("up", given.up or "z", UPS)
        if up == "y":
            said.append("y is up in the file, as given: (x, y, z) is (x, -z, y) here")
        content = content.placed(unit, up)
        supports = _supports(content, given, said)
        blocks = [repair_shape(b, may_be_open=i in supports) for i, b in enumerate(content.blocks)]
        total = sum((block.mended for block in blocks), Counter[str]())
        said += [f"{text}: {count}" for text, count in total.items()]
        bricks = _bricks(content, given, blocks, supports, said)
        sunk, lines = _interpenetrating(content, given, blocks, bricks)
        touching, found = _find_contacts(given, blocks, bricks)
        said = [*lines, *said, *found]
        law = a_law("law", given.law or MASONRY)
        origin = "as given" if given.law else "by default"
        along, across, _ = law.translational
        said.append(f"joints are {along:g} and {across:g} N/m³ stiff along and across, {origin}")
        springs = _springs(touching, bricks, law)
        order = _order(touching, content, bricks, sunk, said)
        count = whole_between("robots", ROBOTS if given.robots is None else given.robots, 1)
        robots = _mobile_robots([*bricks.values()], count)
    except SceneError as error:
        raise SceneError(f"{source}: {error}") from error
    said.append(f"{len(robots)} robots reach all and bear all; z is up")
    return Scene(
        name=given.name or source,
        provenance="\n".join((f"imported from {source}", *said)),
        bricks=tuple(bricks.values()),
        joints=springs[0],
        grounds=springs[1],
        build_order=tuple(bricks[i].name for i in order),
        robots=robots,
    )


def _unit(content: Content, given: Given, said: list[str]) -> float:
    """Return the file's unit of length in m."""
    unit = content.unit if given.unit is None else one_of("unit", given.unit, UNITS)
    if unit is None:
        points = np.vstack([block.vertices for block in content.blocks])
        size = " by ".join(f"{x:.4g}" for x in np.ptp(points, axis=0)) if points.size else "0"
        silent = given.density is None and any(
            b.density is None and b.mass is None for b in content.blocks
        )
        raise SceneError(
            f"it does not say its unit of length, and is {size} large; give one of "
            f"{', '.join(UNITS)} (--unit){', and a density (--density)' if silent else ''}"
        )
    if content.unit not in (None, unit):
        raise SceneError(f"its lengths are known in {content.unit}; give no other unit")
    said += [] if content.unit else [f"lengths are in {unit}, as given"]
    return UNITS[unit]


def _supports(content: Content, given: Given, said: list[str]) -> set[int]:
    named = {block.key: i for i, block in enumerate(content.blocks)}
    marked = [block.key for block in content.blocks if block.support]
    if isinstance(given.supports, str):
        keys = tuple(key.strip() for key in given.supports.split(",") if key.strip())
    else:
        wanted = marked if given.supports is None else given.supports
        keys = rows("supports", wanted, "keys of blocks")
    for key in keys:
        if not isinstance(key, str) or key not in named:
            known = short(", ".join(named), 200)
            raise SceneError(f"there is no block {short(key)}; known are {known}")
    if keys:
        shown = ", ".join(keys[:8])
        more = "" if len(keys) <= 8 else f" and {len(keys) - 8} more"
        origin = "as the file says" if given.supports is None else "as given"
        said.append(f"supports are blocks {shown}{more}, {origin}: the ground")
    supports = {named[key] for key in keys}
    if len(supports) == len(content.blocks):
        raise SceneError("all blocks are supports; leave one to be built")
    return supports


def _bricks(
    content: Content, given: Given, blocks: Sequence[Repaired], supports: set[int], said: list[str]
) -> dict[int, Brick]:
    """Return the bricks of the blocks that are built, by their places in the file."""
    keys = [block.key for block in content.blocks]
    if twice := [key for key, count in Counter(keys).items() if count > 1]:
        raise SceneError(f"block {twice[0]} occurs twice; give each its own name")
    numbers = block_numbers(keys)
    if [str(number) for number in numbers] != keys:
        shown = [f"{key} is {number}" for key, number in zip(keys, numbers, strict=True)]
        more = "" if len(shown) <= 8 else f" and {len(shown) - 8} more"
        own = numbers != [*range(1, len(keys) + 1)]
        how = "as in their names" if own else "from 1 in the file's order"
        said.append(f"blocks are numbered {how}: {', '.join(shown[:8])}{more}")
    density = None if given.density is None else positive("density", given.density, "kg/m³")
    built = [(i, block) for i, block in enumerate(content.blocks) if i not in supports]
    silent = [block.key for _, block in built if block.density is None and block.mass is None]
    if silent and density is None:
        raise SceneError(f"block {silent[0]} has no density; give one in kg/m³ (--density)")
    if silent:
        said.append(f"density of {len(silent)} blocks is {density:g} kg/m³, as given")
    if weighed := sum(block.mass is not None for _, block in built):
        said.append(f"density of {weighed} blocks is their mass over their volume")
    return {
        i: block_brick(numbers[i], solid, _density(block, solid, density or 0.0))
        for i, block in built
        if isinstance(solid := blocks[i].solid, Polyhedron)
    }


def _density(block: FileBlock, solid: Polyhedron, otherwise: float) -> float:
    """Return the density of a block, kg/m³: its own, that of its mass, or another one."""
    if block.mass is None:
        return otherwise if block.density is None else block.density
    found = block.mass / solid.volume
    if block.density is not None and not math.isclose(found, block.density, rel_tol=_SAME_MASS):
        raise SceneError(
            f"block {block.key}: its mass of {block.mass:g} kg is {found:.4g} kg/m³ in "
            f"{solid.volume:.4g} m³, its density {block.density:g} kg/m³; give one of both"
        )
    return found


def block_numbers(keys: Sequence[str]) -> list[int]:
    """Return names of bricks: the numbers in which all keys differ, else from 1.

    Keys are numbers, or end in one after the same letters, as stone_1 and stone_2 do.
    """
    found = [re.fullmatch(r"(.*?)([0-9]{1,9})", key) for key in keys]
    parts = [match.groups() for match in found if match]
    numbers = [int(number) for _, number in parts]
    alike = len({*numbers}) == len(keys) and len({letters for letters, _ in parts}) == 1
    if alike and max(numbers) < LARGEST_NUMBER // 4:
        return numbers
    return [*range(1, len(keys) + 1)]


def _springs(
    touching: Sequence[_Held], bricks: Mapping[int, Brick], law: JointLaw
) -> tuple[tuple[Joint, ...], tuple[Ground, ...]]:
    joints, grounds = list[Joint](), list[Ground]()
    for (a, b), face in touching:
        last = bricks[b]
        if a == GROUND:
            grounds.append(face_ground(last.name, face, law, _STUB * min(last.dimensions)))
        else:
            joints.append(face_joint((bricks[a].name, last.name), face, law))
    if not grounds:
        raise SceneError(
            "no block stands on the ground: none is marked as a support, and none has a level face "
            "at the bottom; name supports"
        )
    return tuple(joints), tuple(grounds)


def _order(
    touching: Sequence[_Held],
    content: Content,
    bricks: Mapping[int, Brick],
    sunk: Collection[int],
    said: list[str],
) -> list[int]:
    """Return blocks in an order in which each touches the ground or an earlier one.

    ``sunk``: those that interpenetrate.
    """
    places = [*bricks]
    row = {i: k for k, i in enumerate(places)}
    courses = [content.blocks[i].course for i in places]
    known = None not in courses
    heights = [round(bricks[i].position[2], 6) for i in places]
    how = "by the file's courses" if known else "from the bottom up"
    said.append(f"blocks are placed {how}")
    order = _touching_order(
        [(c or 0.0 if known else 0.0, h) for c, h in zip(courses, heights, strict=True)],
        [(row[a], row[b]) for (a, b), _ in touching if a != GROUND],
        [row[b] for (a, b), _ in touching if a == GROUND],
    )
    lost = sorted({*range(len(places))} - {*order})
    if lost:
        keys = {k: content.blocks[places[k]].key for k in lost}
        inside = [key for k, key in keys.items() if places[k] in sunk]
        remedy = "name supports, or allow a wider gap between faces"
        if inside:  # which a wider gap does not help
            remedy = f"move {inside[0]} out of the block that it interpenetrates"
        raise SceneError(
            f"{len(lost)} blocks touch nothing that leads to the ground, the first of them "
            f"{', '.join([*keys.values()][:5])}; {remedy}"
        )
    return [places[k] for k in order]


_MOST_OVERLAPS = 100  # pairs that interpenetrate, after which no more are sought
_SHOWN = 3  # of these in an error


def _interpenetrating(
    content: Content, given: Given, blocks: Sequence[Repaired], bricks: Mapping[int, Brick]
) -> tuple[set[int], list[str]]:
    """Return blocks that interpenetrate by more than faces tolerate, and a line on each pair.

    Raises `SceneError` unless the user accepts them. A gap that is wider than by default makes no
    overlap right, so that it counts where it is narrower.
    """
    most = min(_widest_gap(way, bricks) for way in (given, replace(given, gap=None)))
    solids = {i: b.solid for i, b in enumerate(blocks) if isinstance(b.solid, Polyhedron)}
    places = [*solids]
    found = find_overlaps([*solids.values()], [most] * len(solids), given.progress)
    pairs = (((places[o.pair[0]], places[o.pair[1]]), o) for o in islice(found, _MOST_OVERLAPS))
    overlaps = sorted(
        ((pair, each) for pair, each in pairs if {*pair} & bricks.keys()),
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


def _touching_order(
    rank: Sequence[float | tuple[float, ...]],
    pairs: Iterable[tuple[int, int]],
    starts: Iterable[int],
) -> list[int]:
    """Return an order in which every brick touches an earlier one, or the ground.

    Of what can be placed, the lowest ``rank`` is next; what cannot be reached is left out.
    """
    beside: list[set[int]] = [set() for _ in rank]
    for a, b in pairs:
        beside[a].add(b)
        beside[b].add(a)
    seen, order = {*starts}, list[int]()
    ready = [(rank[i], i) for i in seen]
    heapify(ready)
    while ready:
        i = heappop(ready)[1]
        order.append(i)
        for j in beside[i] - seen:
            seen.add(j)
            heappush(ready, (rank[j], j))
    return order
