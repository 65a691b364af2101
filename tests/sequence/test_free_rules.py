"""Rules of the free schedule: what is accepted, and what is said of what is not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.errors import StepError
from seqopt.exchange._doubts import find_doubts
from seqopt.judge._rule_moves import check_free
from seqopt.network.network import build_network
from seqopt.scene.parts import Prop
from seqopt.scene.scene import _hang_free, with_robots
from seqopt.sequence._space import free_space
from seqopt.sequence.rules import FreeRules, _require_buildable
from seqopt.sequence.steps import Site, Step, StepKind
from tests.brute_force import ONES
from tests.builders import small_arch
from tests.plain_rules import PlainBook
from tests.refusals import one_line
from tests.strategies import free_builds


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        ({"newest": "never"}, "rule newest: 'never'; give one of either, placing, free"),
        ({"least_grips": -1}, "rule least_grips: -1; give a whole number from 0 on"),
        ({"regrips": "few"}, "rule regrips: 'few'; give a whole number"),
        ({"ending": "soon"}, "rule ending: 'soon'; give one of held, released, one-by-one"),
        ({"robots": ("rob1", "rob1")}, "rule robots: rob1 occurs twice"),
        ({"robots": ("rob9", "rob1")}, "robot 'rob9' does not exist"),
        ({"robots": ("rob1",), "least_grips": 2}, "least_grips: 2 grips of 1 robots; give at"),
        ({"least_grips": 4}, "rule least_grips: 4 grips of 3 robots; give at most 3"),
        ({"robots": ("rob1", "rob2"), "placers": ("rob3",)}, "rule placers: rob3 takes no part"),
    ],
)
def test_wrong_rules_and_those_that_do_not_fit_a_scene_get_one_line(rules, said):
    with one_line(StepError, said):
        FreeRules(**rules).team(small_arch(4))


def test_what_hangs_free_once_robots_let_go_is_named():
    """A brick without its joint and its ground end; a prop keeps it until the last one comes."""
    scene = small_arch(4)
    loose = replace(scene, joints=scene.joints[:-1], grounds=scene.grounds[:1])
    rules = {k: FreeRules(finish=Site(k, (None,) * len(scene.robots))) for k in (3, 4)}
    engine = seqopt.make_engine("compliance", loose)
    with pytest.raises(StepError, match="brick 4 hangs free: no joint leads to the ground"):
        seqopt.pose(engine, FreeRules(), ONES, "steps")
    _require_buildable(engine.network, FreeRules(ending="held"))
    _require_buildable(engine.network, rules[3])  # it is not there yet
    joints = (scene.joints[0], scene.joints[2])  # brick 3 hangs from brick 4, which is not there
    part = build_network(replace(scene, joints=joints))
    with pytest.raises(StepError, match="brick 3 hangs free"):
        _require_buildable(part, rules[3])
    node = scene.placed[2].nodes[0]
    _require_buildable(build_network(part.scene.with_props(Prop(node=node))), rules[3])


def test_scene_method_and_rules_say_alike_that_a_brick_hangs_free():
    scene = small_arch(4)
    loose = replace(scene, joints=scene.joints[:-1], grounds=scene.grounds[:1])
    said = "brick 4 hangs free: no joint leads to the ground"
    assert f"{said}; tie it" in [*find_doubts(loose)]
    with pytest.raises(StepError, match=f"{said}, and no robot is sure to hold on"):
        seqopt.sequential(loose)
    with pytest.raises(StepError, match=f"{said}; tie it, or let robots hold on"):
        _require_buildable(build_network(loose), FreeRules())
    assert _hang_free(range(9, 0, -1)).startswith("bricks 1, 2, 3, 4, 5, 6 and 3 more hang free")


def test_further_robots_are_mobile():
    scene = small_arch(4)
    assert [robot.name for robot in with_robots(scene, 5).robots][3:] == ["rob4", "rob5"]
    assert len(with_robots(scene, 2).robots) == 2
    for count in (0, 6, 2.5):
        with pytest.raises(StepError, match="from 1 to 5"):
            with_robots(scene, count)


def test_robots_of_one_kind_are_found():
    network = build_network(with_robots(small_arch(5), 5))
    kinds = free_space(network, FreeRules()).kinds
    assert max(len(kind.robots) for kind in kinds) >= 3
    apart = free_space(network, FreeRules(placers=("rob3",))).kinds
    assert len(apart) == len(kinds) + 1
    capped = free_space(network, FreeRules(), {"rob4": 100.0}).kinds
    assert len(capped) == len(kinds) + 1


def named(space, bricks, states):
    """States as a plain value: by kind the set of nodes held, and the regrips."""
    numbers = np.array([0, *space.network.scene.placed_nodes])
    for row in states.tolist():
        held = tuple(frozenset(int(numbers[n]) for n in row[a:b] if n > 0) for a, b in space.slots)
        yield bricks, held, row[-1] if space.rules.regrips is not None else 0


def all_of_space(space):
    """Every state that many-at-a-time moves reach, and the pairs of states they join."""
    states, joined = set(), set()
    level = space.start()
    for bricks in range(space.levels + 1):
        entry = level
        while len(entry):
            fresh = set(named(space, bricks, entry)) - states
            states |= fresh
            keep = [i for i, name in enumerate(named(space, bricks, entry)) if name in fresh]
            entry = entry[keep]
            level = np.concatenate([level, entry])
            parts = [moves for moves, _ in space.within(bricks, entry)] if bricks else []
            for moves in parts:
                ends = zip(
                    named(space, bricks, entry[moves.source]),
                    named(space, bricks, moves.states),
                    strict=True,
                )
                joined |= set(ends)
            entry = np.concatenate([entry[:0], *(moves.states for moves in parts)])
        if bricks < space.levels:
            ((moves, _),) = space.onward(bricks, level)
            ends = zip(
                named(space, bricks, level[moves.source]),
                named(space, bricks + 1, moves.states),
                strict=True,
            )
            joined |= set(ends)
            level = moves.states
    return states, joined


def all_of_book(network, rules):
    """The same by plain rules, one state after the other, robots of one kind as a set."""
    book, kinds = PlainBook(network, rules), free_space(network, rules).kinds

    def name(bricks, grips, regrips):
        held = tuple(frozenset(grips[r] for r in k.robots if grips[r] is not None) for k in kinds)
        return bricks, held, regrips if rules.regrips is not None else 0

    start = (0, (None,) * len(network.scene.robots), 0)
    seen, work, joined = {start}, [start], set()
    while work:
        state = work.pop()
        for _, *after in book.follow(*state):
            joined.add((name(*state), name(*after)))
            counted = (*after[:2], after[2] if rules.regrips is not None else 0)
            if counted not in seen:
                seen.add(counted)
                work.append(counted)
    return {name(*state) for state in seen}, joined


@pytest.mark.slow
@given(build=free_builds(most_bricks=3, most_robots=3))
@settings(max_examples=24)
def test_many_at_a_time_and_one_after_the_other_agree(build):
    scene, rules = build
    network = build_network(scene)
    states, joined = all_of_space(free_space(network, rules))
    expected_states, expected_joined = all_of_book(network, rules)
    assert states == expected_states
    assert joined == expected_joined


def test_a_rule_less_is_seen():
    """The negative control of the test above."""
    network = build_network(small_arch(3))
    strict = all_of_space(free_space(network, FreeRules()))
    loose = all_of_book(network, FreeRules(least_grips=1))
    assert strict[0] < loose[0]
    assert strict[1] < loose[1]


def steps_of(*states):
    return [Step(i, kind, b, grips) for i, (kind, b, grips) in enumerate(states, start=1)]


def test_a_sequence_that_breaks_a_rule_is_seen():
    place, release = StepKind.PLACE, StepKind.RELEASE
    network = build_network(small_arch(4))
    first, second = (brick.nodes for brick in network.scene.placed[:2])
    begun = [(place, 1, (first[1], None, None)), (place, 2, (first[1], second[0], None))]
    with pytest.raises(StepError, match="1 grips, fewer than least_grips=2"):
        check_free(network, FreeRules(), steps_of(*begun, (release, 2, (None, second[0], None))))
    with pytest.raises(StepError, match="nobody holds the newest brick"):
        check_free(
            network,
            FreeRules(least_grips=1),
            steps_of(*begun, (release, 2, (first[1], None, None))),
        )
    with pytest.raises(StepError, match="the build does not end there"):
        check_free(network, FreeRules(), steps_of(*begun))
    with pytest.raises(StepError, match="no rule allows it"):
        check_free(network, FreeRules(placers=("rob2", "rob3")), steps_of(*begun))
    own = FreeRules(robots=("rob2", "rob3"), newest="free")
    with pytest.raises(StepError, match=r"step 1 .* no rule allows it"):  # who takes no part holds
        check_free(network, own, steps_of((place, 1, (first[0], first[1], None))))


def test_too_many_states_to_number_are_refused():
    network = build_network(small_arch(4))
    with pytest.raises(StepError, match="more states than can be numbered"):
        free_space(network, FreeRules(regrips=10**17))


@given(st.integers(0, 3))
def test_loosened_rules_allow_more(least):
    rules = FreeRules(least_grips=least, newest="placing", regrips=1, placers=("rob1", "rob2"))
    texts = [text for text, _ in rules.loosened(small_arch(4))]
    assert texts[:least] == [f"least_grips={n}" for n in range(least - 1, -1, -1)]
    assert {"newest=either", "newest=free", "regrips=2", "regrips=any"} <= {*texts}
    assert {"placers=any", "payload=ignored", "ending=held"} <= {*texts}
