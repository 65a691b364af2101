"""Make a scene of what a file says and what the user adds; say what was assumed.

A scene inside an assembly is read as it is while the blocks are its own. Every part stands where
COMPAS has it: a brick and its ground ends on its node, joints on the edge between two nodes, robots
and all else on the graph. Who deletes a block there deletes its joints.
"""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from seqopt.errors import SceneError
from seqopt.exchange._content import (
    GROUND,
    MOST_CORNERS,
    UNITS,
    UPS,
    Carried,
    Content,
    Entry,
    FileBlock,
    FileJoint,
    Given,
    entry,
    listing,
    mapping,
    number,
)
from seqopt.exchange._meshes import Repaired, repair_shape, same_points
from seqopt.exchange.contacts import Contacts, _find_contacts, _widest_gap, face_ground, face_joint
from seqopt.scene._checks import LARGEST_NUMBER, one_of, positive, rows, short, whole_between
from seqopt.scene._overlaps import Overlap, find_overlaps
from seqopt.scene.boxes import as_vector, block_brick, spring_fields, vertices_of
from seqopt.scene.library.common import MASONRY, JointLaw, a_law, mobile_robots, touching_order
from seqopt.scene.parts import Brick, Ground, Joint
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import _scene_from_document, scene_to_dict
from seqopt.scene.shape import Polyhedron, plane_axes

_HELD = ("bricks", "joints", "grounds")  # what stands on nodes and edges
_KEY = "seqopt"  # of the rest, among the attributes of the graph
_SAME_MASS = 0.01  # share by which a mass and a density may differ by rounding
_SAME = 1e-9  # by how much rounding may move a corner, over the size of the block and its distance


def carry(graph: Entry, keys: Mapping[int, str], scene: Scene, unit: str | None) -> None:
    """Write a scene into a graph whose nodes have the given keys by the names of bricks.

    ``order`` of nodes is expected there. ``unit``: of the graph's lengths, where it is known.
    """
    document = scene_to_dict(scene)
    held = {kind: [*enumerate(document.pop(kind))] for kind in _HELD}
    del document["build_order"]
    nodes, edges = entry("source", graph, "node", "vertex"), graph.setdefault("edge", {})
    for left in (*nodes.values(), *(e for ends in edges.values() for e in ends.values())):
        for name in ("brick", "grounds", "joints"):  # of a scene that it carried before
            (left or {}).pop(name, None)
    for place, brick in held["bricks"]:
        nodes[keys[brick["name"]]] |= {"brick": {"place": place, **brick}, "grounds": []}
    for place, ground in held["grounds"]:
        nodes[keys[ground["brick"]]]["grounds"].append({"place": place, **ground})
    for place, joint in held["joints"]:
        a, b = (keys[name] for name in joint["bricks"])
        ends = edges.setdefault(b if a in edges.get(b, {}) else a, {})
        edge = ends[a if a in ends else b] = ends.get(a if a in ends else b) or {}
        edge.setdefault("joints", []).append({"place": place, **joint})
    graph.setdefault("attributes", {})[_KEY] = {"unit": unit, "scene": document}


def carried(graph: Entry, source: str) -> Carried | None:
    """Return the scene that a graph carries; None if it carries none."""
    attributes, where = graph.get("attributes"), f"{source}: {_KEY}"
    if not isinstance(attributes, dict) or attributes.get(_KEY) is None:
        return None
    own = mapping(where, attributes[_KEY])
    document = {**mapping(where, entry(where, own, "scene"))}
    found = mapping(where, entry(where, graph, "node", "vertex"))
    held = {key: mapping(where, node or {}) for key, node in found.items()}
    nodes = {key: node for key, node in held.items() if node.get("brick") is not None}
    ends = [mapping(where, e or {}) for e in mapping(where, graph.get("edge") or {}).values()]
    edges = [mapping(where, edge or {}) for row in ends for edge in row.values()]
    parts = {
        "bricks": [node["brick"] for node in nodes.values()],
        "grounds": _gathered(where, [*nodes.values()], "grounds"),
        "joints": _gathered(where, edges, "joints"),
    }
    document |= {kind: _sorted(f"{where}: {kind}", rows) for kind, rows in parts.items()}
    names = {key: entry(f"{where}: brick", node["brick"], "name") for key, node in nodes.items()}
    turn = {key: number(where, entry(where, node, "order")) for key, node in nodes.items()}
    document["build_order"] = [names[key] for key in sorted(nodes, key=turn.__getitem__)]
    return Carried(document, names, own.get("unit"))


def own_density(where: str, node: Entry) -> float | None:
    """Return the density of the brick on a node, kg/m³, if it has one."""
    brick = node.get("brick")
    value = None if brick is None else entry(f"{where}: brick", brick, "density")
    return None if value is None else number(f"{where}: density", value)


def _gathered(where: str, holders: Sequence[Entry], name: str) -> list[Any]:
    """Return what stands in lists of the same name on nodes or edges."""
    return [part for held in holders for part in listing(where, held.get(name) or [])]


def _sorted(where: str, found: Sequence[Any]) -> list[Entry]:
    """Return parts in the order that they had in their scene."""
    parts = sorted(found, key=lambda part: number(where, entry(where, part, "place")))
    return [{key: value for key, value in part.items() if key != "place"} for part in parts]


def own_scene(
    content: Content, given: Given, blocks: Sequence[Repaired], said: list[str]
) -> Scene | None:
    """Return the scene that a file carries, if its blocks are still those of its bricks.

    ``content``: in m, with z up; ``said``: a list that gets the reason where it is not used.
    """
    own = content.own
    asked = (given.supports, given.law, given.gap)
    if own is None or given.detect or any(value is not None for value in asked):
        return None
    try:
        scene = _scene_from_document(own.document, "it carries")
        changed = _changed(scene, content, blocks, own.bricks)
    except SceneError as error:
        said.append(f"it carries a scene that is not used, {error}")
        return None
    if changed:
        said.append(
            f"it carries a scene that is not used: block {changed} is not as that has it; joints, "
            "robots and nodes are made anew"
        )
        return None
    more: dict[str, Any] = {} if given.name is None else {"name": given.name}
    if given.robots is not None:
        more["robots"] = mobile_robots(scene.bricks, whole_between("robots", given.robots, 1))
    return replace(scene, **more)


def _changed(
    scene: Scene, content: Content, blocks: Sequence[Repaired], names: Mapping[str, int]
) -> str | None:
    """Return the key of the first block that is not where the scene has its brick."""
    bricks = {brick.name: brick for brick in scene.bricks}
    for held, block in zip(content.blocks, blocks, strict=True):
        name = names.get(held.key)
        if name is None and held.support:
            continue
        solid = block.solid
        if name is None or not isinstance(solid, Polyhedron):
            return held.key
        if not same_points(solid.points, vertices_of(bricks[name])[0], _SAME):
            return held.key
    return None


def upward_order(
    rank: Sequence[tuple[float, ...]],
    pairs: Iterable[tuple[int, int]],
    starts: Iterable[int],
    keys: Sequence[str],
    sunk: Collection[int] = (),
) -> list[int]:
    """Return blocks in an order in which each touches the ground or what stands before it.

    ``sunk``: those that interpenetrate, which a wider gap does not help.
    """
    order = touching_order(rank, pairs, starts)
    lost = sorted({*range(len(rank))} - {*order})
    if lost:
        inside = [keys[i] for i in lost if i in sunk]
        remedy = "name supports, or allow a wider gap between faces"
        if inside:
            remedy = f"move {inside[0]} out of the block that it interpenetrates"
        raise SceneError(
            f"{len(lost)} blocks touch nothing that leads to the ground, the first of them "
            f"{', '.join(keys[i] for i in lost[:5])}; {remedy}"
        )
    return order


ROBOTS = 3  # where nobody says how many
_STUB = 0.1  # of a ground end, over the smallest dimension of its block


def build_scene(content: Content, given: Given, source: str) -> Scene:
    """Return the scene of what a file and its user say, for which shapely is needed.

    ``source``: what the file is called. What was read, mended and assumed stands in the provenance.
    """
    try:
        said = list(content.said)
        _check_size(content)
        content = content.placed(_unit(content, given, said), _up(content, given, said))
        supports = _supports(content, given, said)
        blocks = [repair_shape(b, may_be_open=i in supports) for i, b in enumerate(content.blocks)]
        if (own := own_scene(content, given, blocks, said)) is not None:
            return own
        total = sum((block.mended for block in blocks), Counter[str]())
        said += [f"{text}: {count}" for text, count in total.items()]
        bricks = _bricks(content, given, blocks, supports, said)
        sunk, lines = _interpenetrating(content, given, blocks, bricks)
        touching = _find_contacts(content, given, blocks, bricks)
        said = [*lines, *said, *touching.said]
        law = _law(content, given, touching, said)
        springs = _springs(touching, bricks, law)
        order = _order(touching, content, bricks, sunk, said)
        count = whole_between("robots", ROBOTS if given.robots is None else given.robots, 1)
        robots = mobile_robots([*bricks.values()], count)
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


def _check_size(content: Content) -> None:
    corners = sum(len(face) for block in content.blocks for face in block.faces)
    if not content.blocks:
        raise SceneError("it has no blocks; give an assembly with some")
    if corners > MOST_CORNERS:
        raise SceneError(f"its blocks have {corners} corners; {MOST_CORNERS} is the most")


def _unit(content: Content, given: Given, said: list[str]) -> float:
    """Return the file's unit of length in m."""
    known = content.own.unit if content.own else content.unit
    usual = content.usual_unit if given.unit is None else None
    if known is None and usual is None and given.unit is None:
        points = np.vstack([block.vertices for block in content.blocks])
        size = " by ".join(f"{x:.4g}" for x in np.ptp(points, axis=0)) if points.size else "0"
        silent = given.density is None and any(
            b.density is None and b.mass is None for b in content.blocks
        )
        raise SceneError(
            f"it does not say its unit of length, and is {size} large; give one of "
            f"{', '.join(UNITS)} (--unit){', and a density (--density)' if silent else ''}"
        )
    unit = one_of("unit", (known or usual) if given.unit is None else given.unit, UNITS)
    if usual is not None:
        said.append(f"lengths are in {unit}, as the format has them; say --unit if they are not")
    elif known is None:
        said.append(f"lengths are in {unit}, as given")
    elif unit != known:
        raise SceneError(f"its lengths are known in {known}; give no other unit")
    return UNITS[unit]


def _up(content: Content, given: Given, said: list[str]) -> str:
    """Return the axis of the file that points up."""
    up = content.up if given.up is None else one_of("up", given.up, UPS)
    if up == "y":
        origin = "as given" if given.up else "as the format has it"
        said.append(f"y is up in the file, {origin}: (x, y, z) is (x, -z, y) here")
    return up


def _supports(content: Content, given: Given, said: list[str]) -> set[int]:
    named = defaultdict[str, set[int]](set)
    for i, block in enumerate(content.blocks):
        named[block.group].add(i)
    named.pop("", None)
    for i, block in enumerate(content.blocks):
        named[block.key].add(i)
    marked = [block.key for block in content.blocks if block.support]
    keys = marked if given.supports is None else rows("supports", given.supports, "keys of blocks")
    for key in keys:
        if not isinstance(key, str) or key not in named:
            known = short(", ".join(named), 200)
            raise SceneError(f"there is no block {short(key)}; known are {known}")
    if keys:
        shown = ", ".join(keys[:8])
        more = "" if len(keys) <= 8 else f" and {len(keys) - 8} more"
        origin = "as the file says" if given.supports is None else "as given"
        said.append(f"supports are blocks {shown}{more}, {origin}: the ground")
    supports = {i for key in keys for i in named[key]}
    if len(supports) == len(content.blocks):
        raise SceneError("all blocks are supports; leave one to be built")
    return supports


def _bricks(
    content: Content, given: Given, blocks: Sequence[Repaired], supports: set[int], said: list[str]
) -> dict[int, Brick]:
    """Return the bricks of the blocks that are built, by their places in the file."""
    keys = [block.key for block in content.blocks]
    numbers = block_numbers(keys)
    if [str(number) for number in numbers] != keys:
        said.append(f"blocks are numbered {_numbered(keys, numbers)}")
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


def _numbered(keys: Sequence[str], numbers: Sequence[int]) -> str:
    """Return in words which numbers blocks have."""
    shown = [f"{key} is {number}" for key, number in zip(keys, numbers, strict=True)]
    more = "" if len(shown) <= 8 else f" and {len(shown) - 8} more"
    own = numbers != [*range(1, len(keys) + 1)]
    how = "as in their names" if own else "from 1 in the file's order"
    return f"{how}: {', '.join(shown[:8])}{more}"


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


def _law(content: Content, given: Given, touching: Contacts, said: list[str]) -> JointLaw:
    law = a_law("law", given.law or content.law or MASONRY)
    if touching.faces or any(joint.translational is None for joint in touching.joints):
        origin = "as given" if given.law else "of the file" if content.law else "by default"
        along, across, _ = law.translational
        said.append(f"joints are {along:g} and {across:g} N/m³ stiff along and across, {origin}")
    return law


def _springs(
    touching: Contacts, bricks: Mapping[int, Brick], law: JointLaw
) -> tuple[tuple[Joint, ...], tuple[Ground, ...]]:
    made: list[Joint | Ground] = []
    for (a, b), face in touching.faces:
        last = bricks[b]
        if a == GROUND:
            made.append(face_ground(last.name, face, law, _STUB * min(last.dimensions)))
        else:
            made.append(face_joint((bricks[a].name, last.name), face, law))
    made += [_faceless(joint, bricks, law) for joint in touching.joints]
    grounds = tuple(spring for spring in made if isinstance(spring, Ground))
    if not grounds:
        raise SceneError(
            "no block stands on the ground: none is marked as a support, and none has a level face "
            "at the bottom; name supports"
        )
    return tuple(spring for spring in made if isinstance(spring, Joint)), grounds


def _faceless(joint: FileJoint, bricks: Mapping[int, Brick], law: JointLaw) -> Joint | Ground:
    a, b = joint.blocks
    shift, turn = law.stiffness(joint.side**2, (joint.side**4 / 12,) * 2)
    stiffness = (joint.translational or shift, joint.rotational or turn)
    fields = spring_fields(joint.position, joint.along, plane_axes(joint.along)[1], stiffness)
    if a != GROUND:
        return Joint(bricks=(bricks[a].name, bricks[b].name), **fields)
    behind = joint.position - _STUB * min(bricks[b].dimensions) * joint.along
    return Ground(brick=bricks[b].name, anchor=as_vector(behind), **fields)


def _order(
    touching: Contacts,
    content: Content,
    bricks: Mapping[int, Brick],
    sunk: Collection[int],
    said: list[str],
) -> list[int]:
    places = [*bricks]
    row = {i: k for k, i in enumerate(places)}
    courses = [content.blocks[i].course for i in places]
    known = None not in courses
    heights = [round(bricks[i].position[2], 6) for i in places]
    said.append(
        "blocks are placed by the file's courses"
        if known
        else "blocks are placed from the bottom up"
    )
    order = upward_order(
        [(c or 0.0 if known else 0.0, h) for c, h in zip(courses, heights, strict=True)],
        [(row[a], row[b]) for a, b in touching.pairs if a != GROUND],
        [row[b] for a, b in touching.pairs if a == GROUND],
        [content.blocks[i].key for i in places],
        {row[i] for i in sunk if i in row},
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
    found = islice(_overlaps(content, given, blocks, most), _MOST_OVERLAPS)
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


def _overlaps(
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
