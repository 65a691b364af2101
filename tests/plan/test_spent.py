"""Every run says what it spent and what had to be: each count against one of its own."""

from __future__ import annotations

import json
import re
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import seqopt
from seqopt._cli.remarks import spent_said
from seqopt.engines.rigid._refinement import Refinement
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.problem.problem import _goals
from seqopt.responses import _grip_sets
from seqopt.responses._grip_sets import GripSets, Resources
from seqopt.stability.standing import StandingSets
from seqopt.workflow import Search
from tests.builders import hinged, small_arch
from tests.commands import command

SMALL = "chain:bricks=7"


class Records:
    """What is solved, and what is asked: grip sets by digits, names, corrections, verdicts."""

    def __init__(self, patch):
        self.rows = {True: [], False: []}
        self.values = self.corrected = self.answered = 0
        self.verdicts = set()
        solved, corrects = _grip_sets.GripSets._found, Refinement.solve
        answers, verdict = ComplianceEngine.solve, StandingSets._verdicts
        sets, extremes = _grip_sets.solve_sets, ComplianceEngine._extremes

        def found(own, bricks, every):
            self.owner = own
            out = solved(own, bricks, every)
            self.owner = None
            return out

        def solve(engine, block, *args, **more):
            if self.owner is not None:
                rows = [(block.bricks, *sorted(row)) for row in block.grips.tolist()]
                self.rows[block.screen] += [(id(engine), *row) for row in rows]
                self.values += len(rows) * len(block.names)
            return sets(engine, block, *args, **more)

        def counted(name, at, function):
            def call(own, *args, **more):
                setattr(self, name, getattr(self, name) + len(args[at]))
                return function(own, *args, **more)

            return call

        def verdicts(own, bricks, held, payload):
            self.verdicts |= {(id(own), bricks, *row) for row in held.tolist()}
            return verdict(own, bricks, held, payload)

        self.owner = None
        patch.setattr(_grip_sets.GripSets, "_found", found)
        patch.setattr(_grip_sets, "solve_sets", solve)
        patch.setattr(Refinement, "solve", counted("corrected", 0, corrects))
        patch.setattr(ComplianceEngine, "solve", counted("answered", 1, answers))
        patch.setattr(ComplianceEngine, "_extremes", counted("answered", 1, extremes))
        patch.setattr(StandingSets, "_verdicts", verdicts)


@pytest.fixture
def records(monkeypatch):
    return Records(monkeypatch)


def distinct(plan):
    return {(step.bricks, *sorted(filter(None, step.grips))) for step in plan.steps}


@pytest.mark.parametrize("aim", ["minmax,steps", "T_max", None])
def test_models_digits_and_responses_are_what_was_solved(records, aim):
    plan = seqopt.optimize(SMALL, "free" if aim else None, aim=aim)
    spent, six, full = plan.spent, records.rows[True], records.rows[False]
    assert Counter(six + full).most_common(1)[0][1] <= 2  # once in six digits, once in full
    models = spent["models"]
    assert models["six_digits"] == len(six) > 0
    assert models["again"] == len({*six} & {*full})
    if aim:
        assert models["searched"] == len(six) + len(full)
        assert models["again"] > 0
    else:  # of ranks those that are solved again are counted once
        assert models["searched"] == len(six)
    assert models["searched"] == plan.models
    assert {*spent["responses"]["computed"]} <= {*spent["responses"]["asked"]}
    assert spent["responses"]["values"] == records.values
    assert spent["verdicts"] == {"asked": 0, "programs": 0}
    assert models["answered"] == records.answered > models["searched"]
    assert models["needed"] == max(len(distinct(plan)), plan.certificate.models)
    assert models["corrected"] == records.corrected == 0


def test_what_nobody_asked_for_is_seen():
    """Negative control: what a run computes beside what was asked is counted, and said."""
    plan = seqopt.optimize(SMALL, "free", aim="T_max")
    before = plan.spent
    assert before["responses"]["computed"] == before["responses"]["asked"] == ["T_max"]
    assert "(T_max, all asked for)" in spent_said(before)
    state = next(row for level, *row in plan.selection.states if level == 3)
    replace(plan.states, goals=_goals("D_max,M_sup")).values(3, np.array([state]))
    after = plan.spent
    assert after["responses"]["computed"] == ["D_max", "M_sup", "T_max"]
    assert after["responses"]["values"] == before["responses"]["values"] + 2
    assert after["models"]["answered"] == before["models"]["answered"] + 1
    assert after["models"]["searched"] == before["models"]["searched"]
    assert "nobody asked for D_max, M_sup)" in spent_said(after)


def test_without_proof_its_own_steps_had_to_be():
    plan = seqopt.optimize(SMALL, formulation="cascade", search=Search(proof=False))
    models = plan.spent["models"]
    assert models["proof"] is None
    assert models["needed"] == len(distinct(plan)) <= models["searched"]
    assert "; no proof; " in spent_said(plan.spent)


def test_corrections_are_counted_wherever_they_are_made(records):
    """Behind a joint that only turns, what one robot holds hangs loose: each set is corrected."""
    engine = seqopt.make_engine("compliance", hinged(seqopt.load_scene(SMALL), 3))
    grips = np.array([[2, 8, 11], [3, 9, 11], [9, 10, 11]])
    sets = GripSets(engine, ["T_max"])
    sets.of_grips(6, grips)
    assert engine.corrected == records.corrected == len(grips) == engine.answered
    with ThreadPoolExecutor(1) as executor:
        other = seqopt.make_engine("compliance", engine.network.scene)
        held = ([a, *two] for a in range(1, 8) for two in combinations(range(8, 12), 2))
        many = np.array([grips for grips in held if grips[1:] != [10, 11]])
        shared = GripSets(other, ["T_max"], Resources(2, executor))
        shared.of_grips(6, many)
    here = seqopt.make_engine("compliance", engine.network.scene)
    GripSets(here, ["T_max"]).of_grips(6, many)
    assert (other.answered, other.corrected) == (here.answered, here.corrected)
    assert 0 < here.corrected <= len(many) == here.answered


@pytest.mark.parametrize("count", [0, 2])
def test_verdicts_are_counted_in_all_scenarios(records, count):
    scene = small_arch(4)
    worlds = seqopt.scenarios(scene, count=count, seed=1).scenes if count else ()
    problem = seqopt.optimize(scene, "free", aim="minmax", stands="dry").problem
    records.verdicts.clear()
    plan = seqopt.solve(problem.but(scenarios=worlds))
    known = records.verdicts if count else {*records.verdicts}
    own = {id(each.stability) for each in plan.states.each or (plan.states,)}
    asked = len({row for row in known if row[0] in own})
    assert plan.spent["verdicts"]["asked"] == asked > 0
    stands = plan.summary()["stands"]
    assert (stands["looked_at"], stands["programs"]) == (*plan.spent["verdicts"].values(),)


def test_a_pareto_set_solves_every_model_once_and_says_so(records, tmp_path, capsys):
    words = ("pareto", "chain:bricks=6", "--details", "--out", tmp_path / "front")
    said = command(capsys, *words)[2]
    summary = json.loads((tmp_path / "front/summary.json").read_text())
    models, showing = summary["spent"]["models"], summary["spent_on_showing"]
    assert models["again"] == models["six_digits"] == len(records.rows[True]) == 0
    assert models["searched"] == models["proof"] == len({*records.rows[False]})
    assert spent_said(summary["spent"], showing) in said
    assert showing["verdicts"] >= showing["proven"] > showing["pictures"] == 1


def test_commands_say_it_in_one_line_where_details_are_asked(records, tmp_path, capsys):
    words = ("optimize", "chain:bricks=6", "--schedule", "free", "--aim", "makespan")
    words += ("--durations", "fetch=30,place=10,approach=10,grip=5,release=5")
    assert "spent:" not in command(capsys, *words, "--no-stability")[2]
    words += ("--out", tmp_path / "timed", "--details")
    (line,) = re.findall("spent: .*", command(capsys, *words)[2])
    report = json.loads((tmp_path / "timed/summary.json").read_text())
    assert line == spent_said(report["spent"], report["spent_on_showing"])
    assert report["spent_on_showing"]["pictures"] == 1  # in two files
    drawn = {path.suffix for path in (tmp_path / "timed").glob("times.*")}
    assert drawn == {".csv", ".png", ".svg"}
    records.answered = 0
    (line,) = re.findall("spent: .*", command(capsys, "analyze", SMALL, "--details")[2])
    steps = seqopt.sequential(seqopt.build_network(seqopt.load_scene(SMALL)))
    count = len({(step.bricks, step.grips) for step in steps})
    solved = records.answered  # also with grips that are misplaced, to say how far they may be
    assert line == f"spent: at least {count} had to be; {solved} solved in all, 0 corrected"
