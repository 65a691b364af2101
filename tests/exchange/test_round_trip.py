"""What a scene loses that goes out and is read again: each format says all of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from experiments.harness.scenes import running_bond
from seqopt.exchange._content import Given
from seqopt.exchange._formats import formats, readable, writable
from seqopt.exchange.exports import export_plan
from seqopt.exchange.imports import import_scene
from seqopt.scene.boxes import vertices_of
from seqopt.sequence.steps import Step, StepKind

ENDS = {"obj": "obj"}


def first_step(scene):
    """A plan of one step that every scene has: a robot that need not reach it places a brick."""
    grips = (scene.placed[0].placing_node, *[None] * (len(scene.robots) - 1))
    return (Step(1, StepKind.PLACE, 1, grips),)


def written(scene, form, folder):
    """A scene as a file of a format."""
    path = folder / f"scene.{ENDS[form]}"
    path.write_text(export_plan(scene, first_step(scene), form), encoding="utf-8")
    return path


def rounded(vector):
    return tuple(round(x, 6) + 0.0 for x in vector)


PARTS = {  # what a scene is without, by the words of LOST
    "shapes": lambda s: [sorted(map(rounded, vertices_of(b)[0])) for b in s.bricks],
    "densities": lambda s: [brick.density for brick in s.bricks],
    "the order": lambda s: s.build_order,
    "nodes": lambda s: [rounded(b.node_position(n)) for b in s.bricks for n in b.nodes],
    "joints": lambda s: [joint.translational_stiffness for joint in s.joints],
    "ground ends": lambda s: [rounded(ground.anchor) for ground in s.grounds],
    "robots": lambda s: s.robots,
    "loads": lambda s: (s.loads, s.wind, s.gravity, s.weight_factor),
}


def full(scene):
    """A scene that has something of each part that a format may lose."""
    bricks = [*scene.bricks]
    lying = replace(bricks[-1], density=900.0, node_offsets=((-0.01, 0, 0), (0.02, 0, 0)))
    return replace(scene, bricks=(*bricks[:-1], lying), wind=(0.1, 0.0, 0.0))


@pytest.mark.parametrize("form", ENDS)
def test_what_is_said_to_be_lost_is_lost_and_nothing_else(tmp_path, form):
    """Said and not lost would be as wrong as lost and not said."""
    scene = full(with_order(running_bond(3, 2)))
    path = written(scene, form, tmp_path)
    given = Given(unit="m", density=2000.0, gap=1e-3)
    back = import_scene(path, given=given)
    assert [b.name for b in back.bricks] == [b.name for b in scene.bricks]
    lost = [name for name, part in PARTS.items() if part(back) != part(scene)]
    assert sorted([*lost, "steps"]) == sorted(formats()[form].lost)


def with_order(scene):
    """Another order than from the bottom up, in which each brick touches what stands."""
    order = [*scene.build_order]
    order[0], order[1] = order[1], order[0]
    return replace(scene, build_order=tuple(order))


def test_every_format_that_goes_both_ways_says_what_it_loses():
    lose = {name for name, each in formats().items() if each.lost}
    assert lose == {*ENDS}
    assert {*readable()} & {*writable()} == lose | {"compas_assembly"}  # what was imported stays
