"""Scenes and grip sets at the limits of the engines: long, slender, loose, badly held."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from experiments.harness.scenes import running_bond
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene import Scene
from tests.builders import on_soft_ground

Grips = tuple[int, ...]
LOOSE_AT = 11  # the joint that is loosened: between bricks 12 and 13 of 25
HELD = (40, 45, 49)  # three grips off one line, all beyond that joint


class Case(NamedTuple):
    """One point of a sweep: the worst of its grip sets counts."""

    sweep: str
    value: float
    label: str
    network: Network
    grips: tuple[Grips, ...]


def chain(count: int, **shape: object) -> Scene:
    """Return a chain that leans forward and stays off the ground."""
    pitch = np.linspace(1.4, -0.2, count)
    return arch_scene(ArchShape(pitch=pitch, closed=False, **shape))  # type: ignore[arg-type]


def loosened(scene: Scene, factor: float, *, only_turning: bool) -> Scene:
    """Return the scene with one joint's stiffness multiplied."""
    joints = list(scene.joints)
    joint = joints[LOOSE_AT]
    a, b, c = joint.rotational_stiffness
    joint = replace(joint, rotational_stiffness=(factor * a, factor * b, factor * c))
    if not only_turning:
        a, b, c = joint.translational_stiffness
        joint = replace(joint, translational_stiffness=(factor * a, factor * b, factor * c))
    joints[LOOSE_AT] = joint
    return replace(scene, joints=tuple(joints))


def far_grips(count: int) -> tuple[Grips, ...]:
    """Return no grip, one at the tip, two apart, three close together at the tip."""
    last = 2 * count - 1
    sets: list[Grips] = [(), (last,)]
    if count >= 5:
        sets += [(count | 1, last), (last - 3, last - 2, last), (count // 2 * 2, count + 2, last)]
    return tuple(dict.fromkeys(sets))


def long_chains(counts: list[int]) -> Iterator[Case]:
    for count in counts:
        yield Case("bricks", count, str(count), build_network(chain(count)), far_grips(count))


def walls(sizes: list[tuple[int, int]]) -> Iterator[Case]:
    for columns, courses in sizes:
        scene = running_bond(columns, courses)
        last = scene.placed[-1].nodes[1]
        grips: tuple[Grips, ...] = ((), (last,), (last - 2, last), (last - 4, last - 2, last))
        count = columns * courses
        yield Case("wall", count, f"{columns} × {courses}", build_network(scene), grips)


def slender(ratios: list[float]) -> Iterator[Case]:
    for ratio in ratios:
        scene = chain(25, dimensions=(0.116 * ratio, 0.116, 0.053))
        yield Case("slenderness", ratio, f"{ratio:g}", build_network(scene), far_grips(25))


def loose(factors: list[float]) -> Iterator[Case]:
    """Yield a chain with one loose joint: all of it or only turning, its far end held or free."""
    for turning, name in ((False, "joint"), (True, "turning")):
        for grips, end in ((HELD, "held"), ((), "free")):
            for factor in factors:
                scene = loosened(chain(25), factor, only_turning=turning)
                yield Case(f"{name} {end}", factor, f"{factor:g}", build_network(scene), (grips,))


def placements(count: int) -> Iterator[Case]:
    """Yield grips close together at the tip of a long chain, and grips in one line."""
    net, n = build_network(chain(count)), 2 * count - 1
    sets: dict[str, Grips] = {
        "1 grip": (n,),
        "2, one brick": (n - 1, n),
        "2, neighbors": (n - 2, n),
        "2 + 1": (n - 3, n - 2, n),
        "3, neighbors": (n - 4, n - 2, n),
        "3, apart": (count // 2 | 1, count | 1, n),
    }
    for place, (label, grips) in enumerate(sets.items()):
        yield Case("grips", place, label, net, (grips,))
    pitch = np.full(count, 0.3)
    straight = build_network(arch_scene(ArchShape(pitch=pitch, pattern="V", closed=False)))
    yield Case("grips", len(sets), "3 in a line", straight, ((n - 4, n - 2, n),))


def without_joint(scene: Scene) -> Network:
    joints = scene.joints[:LOOSE_AT] + scene.joints[LOOSE_AT + 1 :]
    return build_network(replace(scene, joints=joints))


def parted() -> Iterator[Case]:
    """Yield a chain without one of its joints: what lies beyond is held by robots alone."""
    apart = without_joint(chain(25))
    sets: dict[str, Grips] = {
        "no grip": (),
        "1 grip": (49,),
        "2 grips": (40, 49),
        "2, one brick": (48, 49),
        "2 + 1": (45, 48, 49),
        "3 grips": HELD,
    }
    for place, (label, grips) in enumerate(sets.items()):
        yield Case("parted", place, label, apart, (grips,))
    straight = ArchShape(pitch=np.full(25, 0.3), pattern="V", closed=False)
    in_line = without_joint(arch_scene(straight))
    yield Case("parted", len(sets), "3 in a line", in_line, (HELD,))


def softened(arch, i):
    """A scene as it is, on soft ground, or with joints that barely turn or hold, in turn."""
    return (
        arch,
        on_soft_ground(arch, 1e4),
        loosened(arch, 1e-5, only_turning=True),
        loosened(arch, 1e-6, only_turning=False),
    )[i % 4]
