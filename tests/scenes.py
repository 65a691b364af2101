"""Scenes and grip sets for property tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from experiments.harness.walls import running_bond
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.study.presets import ROBOTS

angles = st.floats(-0.3, 0.3)


@st.composite
def arches(draw, max_bricks=7, min_bricks=1):
    """An arch of a few bricks, bent, rolled and yawed at random, with unequal joint stiffnesses."""
    count = draw(st.integers(min_bricks, max_bricks))
    bend = draw(st.floats(-0.5, 0.2))
    start = draw(st.floats(0.2, 1.5))
    stiffness = st.tuples(*[st.floats(1e7, 1e9)] * 3)
    turning = st.tuples(*[st.floats(1e5, 1e7)] * 3)
    shape = ArchShape(
        pitch=[start + bend * i for i in range(count)],
        roll=draw(st.lists(angles, min_size=count, max_size=count)),
        yaw=draw(st.lists(angles, min_size=count, max_size=count)),
        pattern=draw(st.sampled_from(["VLR", "V", "LR", "VL"])),
        gap=draw(st.floats(0.0, 0.03)),
        translational_stiffness=draw(stiffness),
        rotational_stiffness=draw(turning),
        closed=draw(st.booleans()),
    )
    return arch_scene(shape, robots=ROBOTS)


@st.composite
def walls(draw):
    """A small wall in running bond: bricks with several joints, loops from the start."""
    return running_bond(draw(st.integers(2, 4)), draw(st.integers(2, 3)))


@st.composite
def states(draw, scenes=None, max_grips=3):
    """A scene, a brick count and a set of different free nodes."""
    scene = draw(arches() if scenes is None else scenes)
    bricks = draw(st.integers(1, len(scene.bricks)))
    free = [n for b in scene.placed[:bricks] for n in b.nodes if n not in scene.blocked_nodes]
    size = st.integers(0, min(max_grips, len(free)))
    grips = draw(
        size.flatmap(lambda k: st.lists(st.sampled_from(free), min_size=k, max_size=k, unique=True))
    )
    return scene, bricks, np.array([grips], dtype=np.int64).reshape(1, -1)


def moved(scene, change):
    """Return the scene with positions passed through a function, axes through its linear part."""

    def axis(v):
        a, o = np.array(change(np.array(v))), np.array(change(np.zeros(3)))
        d = a - o
        return tuple((d / np.linalg.norm(d)).tolist())

    def point(v):
        return tuple(np.array(change(np.array(v))).tolist())

    def spring(s):
        out = replace(s, position=point(s.position), along=axis(s.along), across=axis(s.across))
        return replace(out, anchor=point(s.anchor)) if hasattr(s, "anchor") else out

    return replace(
        scene,
        bricks=tuple(
            replace(
                b,
                position=point(b.position),
                length_axis=axis(b.length_axis),
                width_axis=axis(b.width_axis),
            )
            for b in scene.bricks
        ),
        joints=tuple(map(spring, scene.joints)),
        grounds=tuple(map(spring, scene.grounds)),
    )


def solve(engine_type, scene, bricks, grips, want):
    return engine_type(build_network(scene)).solve(bricks, grips, want)
