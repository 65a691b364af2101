"""Which steps stand of builds that are shown, against the verdict of every step on its own."""

import json
from dataclasses import replace

import pytest

import seqopt
from seqopt._cli.main import main
from seqopt.contact.assembly import step_assembly
from seqopt.scene.scene_file import dump_scene
from seqopt.stability import _steps, failure_map
from seqopt.stability._steps import VerdictChain, each_verdict
from seqopt.stability.assessment import verdict
from seqopt.stability.failure_map import SHOWN, BuildProver, BuildVerdicts
from seqopt.stability.verdict import Verdict

pytestmark = pytest.mark.xdist_group("builds")  # what all look at is made once


@pytest.fixture(scope="module")
def flat():
    return seqopt.build_network(seqopt.load_scene("arch:span=2,rise=0.8,pattern=VLR"))


@pytest.fixture(scope="module")
def builds(flat):
    return {"sequential": seqopt.sequential(flat), "cantilever": seqopt.cantilever(flat)}


@pytest.fixture(scope="module")
def found(flat, builds):
    return BuildProver(flat).of_builds(builds)


@pytest.mark.slow
def test_they_are_those_of_every_step_on_its_own(flat, builds, found, monkeypatch):
    monkeypatch.setattr(failure_map, "_SHARED", 0)
    assert BuildProver(flat).of_builds(builds, workers=2) == found
    for name, steps in builds.items():
        for each, (mortar, held) in zip(found[name], SHOWN.items(), strict=True):
            assert each.mortar == mortar
            for step, said in [*zip(steps, each.verdicts, strict=True)][::8]:
                assert verdict(step_assembly(flat, step.bricks, step.grips), held) is said
    counts = {name: [each.count(Verdict.FALLS) for each in found[name]] for name in builds}
    assert counts == {"sequential": [18, 0], "cantilever": [20, 0]}


def test_what_one_mortar_proves_is_not_proven_with_another(flat, builds, monkeypatch):
    """What stands dry stands with epoxy; what falls with epoxy falls dry, and here nothing does."""
    asked, real = {}, failure_map.each_stability

    def noted(parts, steps, mortar, shared):
        asked.setdefault(mortar, {(step.bricks, step.grips) for step in steps})
        return real(parts, steps, mortar, shared=shared)

    monkeypatch.setattr(failure_map, "each_stability", noted)
    prover, steps = BuildProver(flat), builds["cantilever"]
    (said, _) = prover.of_builds({"a": steps})["a"]
    pairs = zip(steps, said.verdicts, strict=True)
    open_ = {(step.bricks, step.grips) for step, v in pairs if v is Verdict.FALLS}
    assert asked[SHOWN["epoxy"]] == open_
    assert asked[SHOWN["dry"]] == {(step.bricks, step.grips) for step in steps}
    assert len(open_) < len(steps)


@pytest.mark.slow
def test_what_is_not_known_has_a_reason(arch25, tmp_path, capsys):
    narrow = tuple(replace(brick, dimensions=(0.246, 0.09, 0.053)) for brick in arch25.bricks)
    scene = replace(arch25, bricks=narrow)  # those across are 26 mm apart
    network = seqopt.build_network(scene)
    prover = BuildProver(network)
    assert prover.of_builds({"a": seqopt.sequential(network)}) == {}
    assert "mm between its faces" in prover.refusal
    (path := tmp_path / "apart.json").write_text(dump_scene(scene), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["optimize", str(path), "--schedule", "free", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "stability: not proven; " in said.err
    assert "stability" not in said.out
    assert (out / "report.html").exists()


@pytest.mark.slow
def test_what_is_tried_ahead_changes_no_verdict(flat, builds, found, monkeypatch):
    """Steps of as many bricks are tried by what they have in common, of use or not."""
    tried, real = [], VerdictChain.__call__

    def counted(self, bricks, grips):
        tried.append(grips)
        return real(self, bricks, grips)

    monkeypatch.setattr(VerdictChain, "__call__", counted)
    monkeypatch.setattr(_steps, "_LARGE", 0)
    for name, steps in builds.items():
        for said in found[name]:
            each = each_verdict(flat, steps, SHOWN[said.mortar])
            assert tuple(one.verdict for one in each) == said.verdicts
    assert len(tried) > 2 * sum(map(len, builds.values()))  # some were tried ahead


def test_what_was_asked_before_fails_alike_after_lower_builds(flat, builds):
    late = [step for step in builds["sequential"] if step.bricks >= 15]
    early = [step for step in builds["sequential"] if step.bricks <= 6]
    prover, mortars = BuildProver(flat), tuple(SHOWN)
    first = prover.of_builds({"late": late})["late"]
    assert [each.mortar for each in first if each.first] == [mortars[0]]  # dry, it falls
    assert prover.of_builds({"early": early, "late": late})["late"] == first


@pytest.mark.parametrize(
    ("words", "falls"),
    [
        ((), {"dry": True, "epoxy": False}),
        (("--stands", "bond=2e4", "--friction", "0.7"), {"dry": True, "bond=2e4": False}),
        (("--no-stability",), {}),
    ],
)
def test_the_command_line_says_it(capsys, words, falls):
    asked = ["optimize", "chain:bricks=7", "--schedule", "free", "--json", *words]
    assert main(asked) == 0
    answer = json.loads(capsys.readouterr().out)
    assert {n: each["falls"] > 0 for n, each in answer["summary"]["stability"].items()} == falls


def test_words_count_what_falls_and_what_is_open():
    falls, open_ = Verdict.FALLS, Verdict.UNDECIDED
    assert str(BuildVerdicts("dry", (Verdict.STANDS,) * 2)) == "dry: every step stands"
    first = BuildVerdicts("epoxy", (falls, falls, open_), 1, "3", "2-3")
    wanted = "with epoxy: 2 of 3 steps fall; 1 of 3 steps is undecided, first step 1 "
    assert str(first) == f"{wanted}(brick 3, joint 2-3)"
