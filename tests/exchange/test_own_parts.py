"""Formats of others: registered by name, offered beside those that are there."""

import copy
import json
from dataclasses import replace

import compas
import numpy as np
import pytest
from compas.geometry import Box
from hypothesis import given
from hypothesis import strategies as st

import seqopt
from seqopt.errors import ProblemError, SceneError, SeqoptError, StepError
from seqopt.exchange import Content, FileBlock, Format, export, import_scene
from seqopt.exchange._building import build_scene
from seqopt.exchange._content import Given
from seqopt.exchange._formats import DOCUMENTS as READERS
from seqopt.exchange._formats import formats, readable, sniffed, writable
from seqopt.problem import Amount
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES, vertices_of
from seqopt.sequence.steps import Step, StepKind
from tests.builders import running_bond
from tests.documents import DOCUMENTS as OTHERS

pytestmark = pytest.mark.usefixtures("alone")

GIVEN = Given(density=2000.0)


def read(path):
    low, size = np.hsplit(np.loadtxt(path, ndmin=2)[0], 2)
    corners = low + 0.5 * (BOX_CORNERS + 1) * size
    return Content((FileBlock("1", corners, BOX_FACES),), unit="m")


@pytest.fixture
def path(tmp_path):
    found = tmp_path / "one.corners"
    found.write_text("0 0 0  .4 .2 .1\n", "utf-8")
    return found


def test_a_format_of_ones_own_is_read_and_written(path):
    with pytest.raises(SceneError, match="its format is not known"):
        import_scene(path, given=GIVEN)
    lines = Format("corners", ("corners",), read, lambda _, steps: f"{len(steps)}\n")
    seqopt.register(lines)
    assert "corners" in readable()
    assert "corners" in writable()
    with pytest.raises(SceneError, match="its lengths are known in m; give no other unit"):
        import_scene(path, given=Given(unit="mm", density=2000.0))
    scene = import_scene(path, given=GIVEN)
    assert scene.bricks[0].mass == pytest.approx(2000.0 * 0.4 * 0.2 * 0.1)
    steps = seqopt.sequential(seqopt.build_network(seqopt.load_scene("chain:bricks=7")))
    assert export(scene, steps, "corners") == f"{len(steps)}\n"
    with pytest.raises(StepError, match="format corners takes no distance; leave it out"):
        export(scene, steps, "corners", distance=0.1)


def test_what_a_function_of_others_returns_wrong_is_one_line(path):
    seqopt.register(Format("corners", ("corners",), lambda _: [1], lambda *_: None))
    with pytest.raises(SceneError, match=r"format corners: it reads \[1\]; return a Content"):
        import_scene(path, given=GIVEN)
    with pytest.raises(StepError, match="format corners: it writes None; return a text"):
        export(seqopt.load_scene("arch25"), (), "corners")


def test_names_that_are_taken_are_refused_by_kind():
    for part in (Format("obj"), Amount("steps", len)):
        with pytest.raises(ProblemError, match="this name has a meaning already"):
            seqopt.register(part)
    seqopt.register(Format("steps"))  # kinds do not share names


# what a scene loses that goes out and is read again: each format says all of it
ENDS = {"obj": "obj"}


def written(scene, form, folder):
    """A scene as a file of a format, with a step: a robot that need not reach it places a brick."""
    path = folder / f"scene.{ENDS[form]}"
    grips = (scene.placed[0].placing_node, *[None] * (len(scene.robots) - 1))
    steps = (Step(1, StepKind.PLACE, 1, grips),)
    path.write_text(export(scene, steps, form), encoding="utf-8")
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
    scene = running_bond(3, 2)
    first, second, *others = scene.build_order  # another order than from the bottom up
    scene = full(replace(scene, build_order=(second, first, *others)))
    path = written(scene, form, tmp_path)
    given = Given(unit="m", density=2000.0, gap=1e-3)
    back = import_scene(path, given=given)
    assert [b.name for b in back.bricks] == [b.name for b in scene.bricks]
    lost = [name for name, part in PARTS.items() if part(back) != part(scene)]
    assert sorted([*lost, "steps"]) == sorted(formats()[form].lost)


def test_every_format_that_goes_both_ways_says_what_it_loses():
    lose = {name for name, each in formats().items() if each.lost}
    assert lose == {*ENDS}
    assert {*readable()} & {*writable()} == lose | {"compas_assembly"}  # what was imported stays


# documents with something in the wrong place: a scene, or one line; never anything else
JUNK = (None, True, -1, 0, 3, 1e308, -1e-300, 10**400, "", "x", [], {}, [[1]], {"data": 1}, [0] * 3)


def places(held, before=()):
    """Where something stands in a document."""
    if before:
        yield before
    rows = held.items() if isinstance(held, dict) else []
    for key, value in enumerate(held) if isinstance(held, list) else rows:
        yield from places(value, (*before, key))


DOCUMENTS = OTHERS | {
    "meshes of compas": json.loads(compas.json_dumps({"a": Box(1), "b": [Box(1)]}))
}
PLACES = {name: sorted(places(held), key=repr) for name, held in DOCUMENTS.items()}
REMOVED = "removed"


@st.composite
def broken(draw):
    """A document in which something is removed, or junk, or a copy of another part."""
    name = draw(st.sampled_from(sorted(DOCUMENTS)))
    document = copy.deepcopy(DOCUMENTS[name])
    where = draw(st.sampled_from(PLACES[name]))
    holder = document
    for key in where[:-1]:
        holder = holder[key]
    what = draw(st.sampled_from((REMOVED, *JUNK)))
    if what == REMOVED:
        del holder[where[-1]]
    else:
        holder[where[-1]] = copy.deepcopy(what)
    return document


@given(document=broken())
def test_a_scene_or_one_line(document):
    said = ""
    try:
        form = sniffed(document, "file")
        build_scene(READERS[form](document, "file"), Given(unit="m", density=2000.0), "file")
    except SeqoptError as error:
        said = str(error)
    assert "\n" not in said
    assert len(said) < 600
