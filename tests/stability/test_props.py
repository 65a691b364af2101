"""What stands on props: the cone program, chains of verdicts and screens agree on which way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt import Prop
from seqopt.contact.faces import PartialAssemblies, _prop_grips, step_assembly
from seqopt.errors import SceneError
from seqopt.stability._load_factor import load_factors
from seqopt.stability._screens import FALLS, STANDS, Margins, Screen
from seqopt.stability.assessment import Verdict, assess

UP = (0.0, 0.0, 1.0)
DOWN = (0.0, 0.0, -1.0)
HELD = {
    "none": (),
    "both ways": (Prop(node=8),),
    "pushes up": (Prop(node=8, direction=UP),),
    "pushes down": (Prop(node=8, direction=DOWN),),
    "weak": (Prop(node=8, direction=UP, capacity=5.0),),
    "two that push": (Prop(node=8, direction=UP), Prop(node=4, direction=(0.0, 0.6, 0.8))),
}


def bonds(scene, bricks=5):
    """The least bond of a part that no robot holds, by the cone program and by linear programs."""
    network = seqopt.build_network(scene)
    none = (None,) * len(scene.robots)
    cone = assess(step_assembly(network, bricks, none), seqopt.DRY, margins=("bond",)).bond
    part = PartialAssemblies(network, bricks)(bricks, none)
    again = assess(part, seqopt.DRY, margins=("bond",)).bond
    low, high = Margins(network, seqopt.DRY).bond(bricks, np.zeros((1, 3), int))[0]
    assert again == pytest.approx(cone, rel=1e-5)
    assert low * (1 - 1e-5) <= cone <= high * (1 + 1e-5)
    return cone


def test_props_help_as_far_as_they_reach(arch25):
    found = {name: bonds(arch25.with_props(*props)) for name, props in HELD.items()}
    assert found["both ways"] < 0.1 * found["pushes up"] < 0.1 * found["weak"]
    assert found["weak"] < 0.99 * found["none"]
    assert found["pushes down"] == pytest.approx(found["none"])
    assert found["two that push"] <= found["pushes up"] * (1 + 1e-6)


def test_a_weak_prop_takes_off_its_capacity_times_its_lever(arch25):
    """Within what it can, a bond that is lacking grows as much as each newton less bears."""
    at = [bonds(arch25.with_props(Prop(node=8, direction=UP, capacity=c))) for c in (2.0, 4.0, 6.0)]
    assert at[0] - at[1] == pytest.approx(at[1] - at[2], rel=1e-3)
    assert at[0] > at[1] > at[2]


def test_props_are_struck_with_the_last_grip(arch25):
    """The finished arch stands or falls bare: a prop that would pull it down does not count."""
    network = seqopt.build_network(arch25.with_props(Prop(node=26)))
    screen = Screen(network, seqopt.DRY)
    sets = np.array([[0, 0, 0], [0, 0, 50]])
    assert (screen.stands(25, sets) == STANDS).all()
    assert _prop_grips(network, 25, held=False).nodes == ()
    assert _prop_grips(network, 25, held=True).nodes == (26,)
    assert screen.stands(14, sets[:1]) == STANDS
    assert screen.stands(13, sets[:1]) == FALLS  # its brick is not there
    none = step_assembly(network, 25, (None,) * 3)
    assert len(none.payload) == 0
    assert len(step_assembly(network, 25, (49, None, None)).payload) == 2


def test_steps_of_plans_say_the_same_alone_and_together(arch25):
    scene = arch25.with_props(Prop(node=20), Prop(node=30, direction=UP))
    network = seqopt.build_network(scene)
    steps = seqopt.sequential(network)[10:30]
    chained = [found.verdict for found in seqopt.assess_steps(network, steps, "dry")]
    alone = [
        assess(step_assembly(network, s.bricks, s.grips), seqopt.DRY, margins=()).verdict
        for s in steps
    ]
    assert chained == alone
    assert Verdict.STANDS in alone


def test_what_is_not_found_with_props_that_push_is_said(arch25):
    scene = arch25.with_props(*HELD["pushes up"])
    network = seqopt.build_network(scene)
    with pytest.raises(SceneError, match="the least payload is not found where props only push"):
        Margins(network, seqopt.DRY).grip(5, [[10, 7]])
    (found,) = seqopt.assess_steps(network, seqopt.sequential(network)[9:10], "dry", ["payload"])
    assert np.isnan(found.grip)
    windy = seqopt.build_network(replace(scene, wind=(0.1, 0.0, 0.0)))
    with pytest.raises(SceneError, match="load factors know no props that only push"):
        load_factors(windy, seqopt.sequential(windy)[:1], "dry")
