"""Documents with something in the wrong place: a scene, or one line; never anything else."""

from __future__ import annotations

import copy
import json

import compas
from compas.geometry import Box
from hypothesis import given
from hypothesis import strategies as st

from seqopt.errors import SeqoptError
from seqopt.exchange._building import build_scene
from seqopt.exchange._content import Given
from seqopt.exchange._formats import DOCUMENTS as READERS
from seqopt.exchange._formats import sniffed
from tests.documents import DOCUMENTS as OTHERS

JUNK = (None, True, -1, 0, 3, 1e308, -1e-300, 10**400, "", "x", [], {}, [[1]], {"data": 1}, [0] * 3)


def places(held, before=()):
    """Where something stands in a document."""
    if before:
        yield before
    rows = held.items() if isinstance(held, dict) else []
    for key, value in enumerate(held) if isinstance(held, list) else rows:
        yield from places(value, (*before, key))


def by_compas():
    """A document that COMPAS writes: a dictionary of shapes."""
    return {"meshes of compas": json.loads(compas.json_dumps({"a": Box(1), "b": [Box(1)]}))}


DOCUMENTS = OTHERS | by_compas()
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
