"""Frozen values: read-only for good, compared by content, short at the prompt."""

import pickle
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property

import numpy as np
import pytest
from scipy import sparse

import seqopt
from seqopt.arms._arm import HeldPostures
from seqopt.arrays import Floats, FrozenValue
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import face_quadrature, find_elastic_limits
from seqopt.engines.diagnosis import diagnose
from seqopt.engines.discrete import _build_system, _held_nodes, _settle
from seqopt.engines.interface import RIGID, Want, read_compliance
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._mixed import Solution, mixed_system, share, ungripped_system
from seqopt.engines.rigid._operator import OperatorBuilder, ResponseMaps, scene_maps
from seqopt.engines.rigid._stacked import StackedOperator
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.exchange._doubts import _faces
from seqopt.exchange._meshes import Surface
from seqopt.exchange.contacts import touching_faces
from seqopt.network._mechanics import build_statics
from seqopt.stability._steps import each_verdict
from seqopt.stability.assessment import assess, bonded, load_factor
from seqopt.stability.limit_analysis import Prover
from tests.blocks import box

COMPRESSED = (sparse.csr_array, sparse.csc_array)


@pytest.fixture(scope="module")
def values(arch25):
    """Return a value of every class of the mechanics that holds arrays, by the class's name."""
    network = seqopt.build_network(arch25)
    tree = grow_tree(network)
    grips = np.array([2])
    assembly = step_assembly(network, 2, (2, None, None))
    system = _build_system(network, 2, seqopt.EPOXY, None)
    held = _held_nodes(network, system, grips, RIGID, [])
    parts = ungripped_system(network, 2)
    proven = Prover(assembly, _compiled())(bonded(assembly, seqopt.EPOXY))
    none = np.zeros((0, 3)), np.zeros((0, 3))
    maps, operator = scene_maps(network), OperatorBuilder(network, tree).operator(2)
    cube = box((1, 1, 1))
    ((_, touching),) = touching_faces([box((1, 1, 1)), box((1, 1, 1), at=(0, 0, 1))], 1e-3)
    every = (
        *(maps, ResponseMaps(maps, 2)),
        *_faces(np.array(cube.vertices), cube),
        *(touching, Surface(np.zeros((3, 3)), ((0, 1, 2),))),
        *(network, network.springs, network.compliances, build_statics(network)),
        *(assembly, face_quadrature(assembly), find_elastic_limits(network, seqopt.EPOXY)),
        *(tree, operator, StackedOperator.of([operator, operator]), operator.doubts, parts),
        share(network),
        mixed_system(parts, grips),
        Solution(np.zeros(6), np.zeros((1, 6)), *none, np.zeros(0, dtype=bool)),
        *(system, system.points),
        *(_settle(held), ComplianceEngine(network).solve(2, [[2]], Want.ALL)),
        *(diagnose(network, 2, [2]), proven, proven.answer, assess(assembly, seqopt.EPOXY)),
        *(load_factor(assembly, seqopt.EPOXY), arch25.grip_kinds),
        HeldPostures(np.array([0]), np.array([1]), np.array([[0]]), (np.ones((1, 6, 2)),)),
        read_compliance(network, grips[None], [[2]], np.ones((1, 1, 3))),
        *each_verdict(network, seqopt.sequential(network)[:1], seqopt.EPOXY),
    )
    return {type(value).__name__: value for value in every}


def _compiled():
    from formulations.contact.limit_analysis import compile_equilibrium  # noqa: PLC0415  # brings a solver

    return compile_equilibrium


def classes() -> set[type]:
    """Return every class of frozen values in the package."""
    found, left = set(), [FrozenValue]
    while left:
        below = left.pop().__subclasses__()
        left += below
        found |= {cls for cls in below if cls.__module__.startswith("seqopt.")}
    return found


def writable(content) -> list[str]:
    """Return the arrays within a value, a matrix or a container that can be written to."""
    if isinstance(content, np.ndarray):
        return ["array"] if content.flags.writeable else []
    if isinstance(content, COMPRESSED):
        return writable((content.data, content.indices, content.indptr))
    if isinstance(content, dict):
        return [f"{key}: {found}" for key, part in content.items() for found in writable(part)]
    if isinstance(content, tuple | list):
        return [found for part in content for found in writable(part)]
    return writable(vars(content)) if isinstance(content, FrozenValue) else []


MECHANICS = ("exchange", "scene", "network", "contact", "engines", "stability")


def test_every_class_has_a_value_here(values):
    mine = {c.__name__ for c in classes() if c.__module__.split(".")[1] in MECHANICS}
    assert mine | {"HeldPostures"} == set(values)  # of arms, which a scene holds


def test_arrays_are_read_only_also_after_a_round_trip(values):
    for value in values.values():
        for name in dir(type(value)):
            if isinstance(getattr(type(value), name), cached_property):
                getattr(value, name)
        assert writable(value) == []
        assert writable(pickle.loads(pickle.dumps(value))) == []


def test_an_array_that_can_be_written_is_seen(values):
    loose = replace(values["Springs"])
    vars(loose)["extra"] = np.zeros(3)
    assert writable(loose) == ["extra: array"]


def test_equal_contents_make_equal_values(values):
    for value in values.values():
        again = pickle.loads(pickle.dumps(value))
        assert again == value
        assert hash(again) == hash(value)
        assert value != "something else"


def test_one_other_number_makes_another_value(values):
    for value in values.values():
        for name in (field.name for field in fields(value)):
            old = getattr(value, name)
            if isinstance(old, np.ndarray) and old.dtype == float and np.isfinite(old).any():
                assert replace(value, **{name: 2 * old + 1}) != value


def test_classes_leave_comparison_to_their_base():
    """``@dataclass`` alone would compare arrays by ``==`` and print them whole."""
    for cls in classes():
        assert is_dataclass(cls)
        assert cls.__dataclass_params__.frozen
        assert cls.__eq__ is FrozenValue.__eq__, cls
        assert cls.__hash__ is FrozenValue.__hash__, cls


def test_zeros_and_nans_are_alike_whatever_their_bits():
    @dataclass(frozen=True, eq=False, repr=False)
    class Numbers(FrozenValue):
        row: Floats
        one: float

    first = Numbers(np.array([0.0, np.nan]), float("nan"))
    second = Numbers(np.array([-0.0, -np.nan]), -float("nan"))
    assert first == second
    assert hash(first) == hash(second)
    assert first != replace(first, one=1.0)
