"""The program of equilibrium with contact against limits by hand: a cube on the ground, or held.

Forces count in the cube's weight, strengths in that weight over its face, so that they add up.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import clarabel
import numpy as np
import pytest

from experiments.stability.parts.blocks import stack
from formulations.contact.limit_analysis import (
    CONE_OPTIONS,
    ENDS,
    SECONDS,
    _solve_cones,
    compile_equilibrium,
)
from seqopt.stability.limit_analysis import CAP, Case, Claim, Sense, limits
from tests.builders import held

MIDDLE = (0.5, 0.5, 0.5)
NONE = np.zeros((0, 3))
CUBE = stack([]).assembly(2000.0)


def floating(payload, *points):
    """The cube off the ground, held at points with a payload over its weight."""
    alone = replace(
        *(CUBE,),
        contact_name=(),
        bodies=np.zeros((0, 2), int),
        normal=NONE,
        corner=NONE,
        contact=np.zeros(0, int),
    )
    return held(alone, payload * CUBE.scales[0], *points)


def hanging():
    """The cube below what it is laid on: its weight pulls at the face."""
    return replace(CUBE, weight=-CUBE.weight)


def case(sense, **numbers):
    return Case(
        sense=sense, **({"friction": 0.3, "tension": (0.0, 0.0), "cohesion": (0.0, 0.0)} | numbers)
    )


STRONG = {"cohesion": (50.0, 0.0)}
ASIDE = (1.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("numbers", "z"),
    [
        ({"pull": ASIDE}, 0.3),  # slides
        ({"pull": (0.0, 1.0, 0.0)}, 0.3),
        ({"pull": (0.6, 0.0, 0.0)}, 0.5),
        ({"pull": (0.3, 0.4, 0.0)}, 0.6),  # friction is round
        ({"pull": (0.3, 0.0, -0.5)}, 0.3 / 0.15),  # a press adds to the friction
        ({"pull": ASIDE, "friction": 2.0}, 1.0),  # tips about its edge
        ({"pull": ASIDE, "cohesion": (0.1, 0.0)}, 0.4),
        ({"pull": ASIDE, "cohesion": (0.0, 0.5)}, 0.6),
        ({"pull": ASIDE, "tension": (0.2, 0.0)} | STRONG, 1.2),  # two corners hold its edge back
        ({"pull": UP, "tension": (0.2, 0.0)} | STRONG, 1.2),  # lifts
        ({"pull": UP, "tension": (0.0, 0.5)} | STRONG, 2.0),
        ({"pull": (0.0, 0.0, 0.0)}, CAP),
    ],
)
def test_the_largest_pull(numbers, z):
    answer = compile_equilibrium(CUBE)(case(Sense.LARGEST, **numbers))
    assert answer.claim is Claim.SOLVED
    assert answer.value == pytest.approx(z, rel=1e-5)


@pytest.mark.parametrize(
    ("numbers", "z"),
    [
        ({"tension": (0.0, 1.0)}, 1.0),
        ({"tension": (0.25, 1.0)}, 0.75),
        ({"tension": (0.0, 2.0)}, 0.5),
        ({"tension": (2.0, 1.0)}, 0.0),
    ],
)
def test_the_least_bond_that_holds_a_hanging_cube(numbers, z):
    answer = compile_equilibrium(hanging())(case(Sense.SMALLEST, **numbers, **STRONG))
    assert answer.value == pytest.approx(z, abs=1e-5)
    assert answer.contact_force[:, 0].sum() == pytest.approx(-1.0, abs=1e-5)


@pytest.mark.parametrize(
    ("own", "points", "payload", "z"),
    [
        (0.0, [MIDDLE], (1.0, 1.0), 1.0),
        (0.4, [MIDDLE], (1.0, 1.0), 0.6),
        (0.4, [MIDDLE], (2.0, 1.0), 0.2),
        (0.4, [MIDDLE], (1.0, 2.0), 0.3),
        (0.4, [(0.0, 0.5, 0.5), (1.0, 0.5, 0.5)], (1.0, 1.0), 0.1),
        (0.4, [(0.0, 0.5, 0.5), (0.6, 0.5, 0.5)], (1.0, 1.0), 5 / 6 - 0.4),  # the near one more
    ],
)
def test_the_least_force_of_robots_that_hold_a_cube(own, points, payload, z):
    assembly = floating(own, *points)
    answer = compile_equilibrium(assembly)(case(Sense.SMALLEST, payload=payload))
    assert answer.value == pytest.approx(z, abs=1e-5)
    assert answer.grip_force.shape == (len(points), 3)
    assert answer.contact_force.shape == (0, 3)
    assert answer.grip_force.sum(axis=0) == pytest.approx([0, 0, 1], abs=1e-5)


def test_the_ground_and_a_robot_share_a_pull():
    """Friction and the payload, one after the other in the same line."""
    both = held(CUBE, 0.5 * CUBE.scales[0], MIDDLE)
    answer = compile_equilibrium(both)(case(Sense.LARGEST, pull=ASIDE))
    lift = np.sqrt(0.5**2 / (1 + 0.3**2))  # the robot pulls back and presses: best of both
    best = 0.3 * (1 + 0.3 * lift) + lift
    assert answer.value == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize("pull", [ASIDE, (0.2, 0.3, -0.1)])
def test_an_answer_is_in_equilibrium_and_within_its_limits(pull):
    assembly = held(stack([0.2, 0.1]).assembly(2000.0), 3000.0, (0.9, 0.5, 2.5))
    asked = case(Sense.LARGEST, pull=pull, tension=(0.1, 0.02), cohesion=(0.2, 0.01))
    answer = compile_equilibrium(assembly)(asked)
    forces = assembly.contact_map @ answer.contact_force.ravel()
    forces = forces + assembly.grip_map @ answer.grip_force.ravel()
    load = assembly.load() + answer.value * assembly.load(pull)
    assert np.abs(forces + load).max() <= 1e-6
    tension, cohesion, payload = limits(assembly, asked, answer.value)
    normal, tangent = answer.contact_force[:, 0], answer.contact_force[:, 1:]
    assert (normal + tension).min() >= -1e-6
    assert (0.3 * normal + cohesion - np.linalg.norm(tangent, axis=1)).min() >= -1e-6
    assert (payload - np.linalg.norm(answer.grip_force, axis=1)).min() >= -1e-6
    assert answer.motion.shape == (3, 6)
    assert abs(np.vdot(answer.motion.ravel(), assembly.load(pull))) > 0.1  # it gives way


def test_a_program_is_asked_again():
    program = compile_equilibrium(CUBE)
    values = [program(case(Sense.LARGEST, pull=ASIDE, friction=m)).value for m in (0.3, 0.2, 0.3)]
    assert values == pytest.approx([0.3, 0.2, 0.3], rel=1e-5)
    other = program(case(Sense.LARGEST, pull=ASIDE), len(CONE_OPTIONS) - 1)
    assert other.value == pytest.approx(0.3, rel=1e-5)


def test_what_cannot_be_held_has_no_forces():
    answer = compile_equilibrium(floating(0.4, MIDDLE))(case(Sense.SMALLEST))
    assert answer.claim is Claim.INFEASIBLE
    assert np.isnan(answer.value)
    for part, shape in (("contact_force", (0, 3)), ("grip_force", (1, 3)), ("motion", (1, 6))):
        assert getattr(answer, part).shape == shape
        assert not getattr(answer, part).any()
    fallen = compile_equilibrium(hanging())(case(Sense.SMALLEST))
    assert fallen.contact_force.shape == (len(CUBE.corner), 3)
    assert fallen.grip_force.shape == (0, 3)


class Ended:
    """A solver that ends with a status, and keeps what it was given."""

    given: ClassVar[list[object]] = []

    def __init__(self, *given):
        self.given.append(given[-1])

    def solve(self):
        if self.status == "fails":
            raise RuntimeError("no")
        return SimpleNamespace(status=self.status, x=[0.0], z=[0.0])


@pytest.mark.parametrize("status", [*ENDS, "MaxTime", "NumericalError", "DualInfeasible", "fails"])
def test_how_a_solver_says_that_it_ended(monkeypatch, status):
    """Nothing but an optimum and infeasibility is taken from it, and it gets its options."""
    monkeypatch.setattr(Ended, "status", status, raising=False)
    monkeypatch.setattr(clarabel, "DefaultSolver", Ended)
    program = np.zeros(1), np.zeros((1, 1)), np.zeros(1), []
    for attempt, own in enumerate(CONE_OPTIONS):
        assert _solve_cones(*program, attempt)[0] is ENDS.get(status, Claim.STALLED)
        given, usual = Ended.given[-1], clarabel.DefaultSettings()
        assert (given.time_limit, given.max_threads, given.verbose) == (SECONDS, 1, False)
        assert given.equilibrate_enable is own.get("equilibrate_enable", usual.equilibrate_enable)
    assert 60 <= SECONDS <= 3600
    assert len({str(options) for options in CONE_OPTIONS}) == len(CONE_OPTIONS)
