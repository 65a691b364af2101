"""What people read first; commands of packages and users."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import pandas as pd
import pytest

import seqopt
from seqopt._cli.registry import COMMANDS, every_command
from seqopt.errors import InfeasibleError, PluginWarning, ProblemError, StepError
from seqopt.sequence.rules import FreeRules
from tests.builders import install
from tests.commands import command
from tests.commands import command as run

WALL = "wall:columns=2,courses=2"
FEW = "rules: least_grips=1, as 2 robots take part"


def test_optimize_begins_with_what_robots_hold(capsys, tmp_path):
    out = tmp_path / "out"
    status, said, _ = run(capsys, "optimize", WALL, "--schedule", "free", "--out", out)
    first, second, *_ = said.splitlines()
    number = r"([0-9.,]+)"
    found = re.match(
        rf"largest force {number} N; payloads used up to {number} % \(rob[123], step [0-9]+\); "
        rf"displacement {number} µm",
        first,
    )
    force, share, moved = map(float, found.groups())
    table = pd.read_csv(out / "plan.csv")
    most = table[[f"F_rob{k}_N" for k in (1, 2, 3)]].abs().max().max()
    payload = seqopt.load_scene(WALL).robots[0].payload
    assert (status, force) == (0, pytest.approx(most, rel=5e-3))
    assert share == pytest.approx(100 * most / payload, rel=5e-3)
    assert moved == pytest.approx(table["D_max_1e-3mm"].max(), rel=5e-3)
    assert all(len(digits.replace(".", "").lstrip("0")) <= 3 for digits in found.groups())
    assert re.search(r"; minmax [0-9.]+, optimal$", first)
    assert second.startswith("schedule_search (exact): ")


@pytest.mark.parametrize(
    ("words", "says"), [(["2"], True), (["3"], False), (["2", "--rule", "least_grips=1"], False)]
)
def test_two_robots_build_by_themselves(capsys, words, says):
    for asked in (["optimize"], ["pareto", "--aim", "F_largest,D_max"]):
        line = [asked[0], WALL, *asked[1:], "--schedule", "free", "--robots", *words]
        status, _, err = run(capsys, *line, "--no-stability")
        assert (status, FEW in err.splitlines()) == (0, says), err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["dry"], True),
        (["dry", "--engine", "compliance"], True),
        (["dry", "--engine", "auto"], False),  # whose joints are dry
        (["epoxy", "--engine", "compliance"], False),
    ],
)
def test_dry_joints_that_an_engine_does_not_have_are_said(capsys, words, says):
    _, _, err = run(capsys, "optimize", "chain:bricks=7", "--mortar", *words)
    said = "joints: bonded with epoxy in this engine; of steps dry verdicts alone speak"
    assert (said in err.splitlines()) == says, err


def test_a_limit_that_helps_has_three_digits_and_does_help():
    engine = seqopt.make_engine("auto", seqopt.load_scene(WALL))

    def asked(bound):
        limits = [seqopt.Limit("F_largest", bound)]
        rules, criterion = FreeRules(), seqopt.CRITERIA["worst-ratio"]
        return seqopt.solve(seqopt.pose(engine, rules, criterion, "minmax", limits))

    with pytest.raises(InfeasibleError) as error:
        asked(10.0)
    enough = re.search(r"F_largest=([0-9.]+) instead of 10", str(error.value))[1]
    assert len(enough.replace(".", "")) <= 3
    assert asked(float(enough)).steps
    with pytest.raises(InfeasibleError):
        asked(0.99 * float(enough))


ARCH = "arch:span=1.2,rise=0.5"


def refusal(make, *given, **options):
    """Return what an error says."""
    with pytest.raises((InfeasibleError, StepError)) as error:
        make(*given, **options)
    return str(error.value)


def said(text, pattern):
    """Return the values that a message names."""
    found = re.findall(pattern, text)
    assert found, text
    return found


@pytest.mark.parametrize("asked", [{}, pytest.param({"stands": "dry"}, marks=pytest.mark.slow)])
def test_a_payload_that_is_enough_for_a_free_schedule(asked):
    def make(payload):
        scene = seqopt.load_scene(ARCH)
        robots = (replace(robot, payload=payload) for robot in scene.robots)
        return seqopt.optimize(scene.with_robots(*robots), "free", aim="steps", **asked)

    (newton,) = said(refusal(make, 20.0), r"a payload of (\d+) N \(--payload \1\)")
    assert make(float(newton)).steps
    refusal(make, float(newton) - 1)


# commands of packages and users: a function whose signature and docstring say its options
def weigh(
    scene: str = "arch25", *, per: str = "scene", least: float = 0.0, names: tuple[str, ...] = ()
):
    """Say what the bricks of a scene weigh.

    Parameters
    ----------
    scene : SCENE
        what is weighed
    per : WORD
        scene, or brick for a table
    least : KG
        leave out lighter bricks
    names : NAME
        bricks to weigh

    Examples
    --------
    seqopt weigh arch25 --per brick
    """
    found = seqopt.load_scene(scene)
    weights = {str(brick.name): brick.mass for brick in found.placed if brick.mass >= least}
    weights = {name: each for name, each in weights.items() if not names or name in names}
    if per == "brick":
        return pd.DataFrame({"brick": [*weights], "kg": [*weights.values()]})
    return f"{found.name}: {len(weights)} bricks weigh {sum(weights.values()):.4g} kg"


WEIGH = seqopt.Command("weigh", weigh)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a package that has a command, by its entry point."""

    def installed(entry):
        install(tmp_path, "seqopt.parts", weigh=entry)
        monkeypatch.syspath_prepend(tmp_path)

    return installed


def test_a_package_adds_a_command(package, capsys):
    package(f"{__name__}:WEIGH")
    assert "    weigh     Say what the bricks of a scene weigh." in command(capsys, "--help")[1]
    page = command(capsys, "weigh", "--help")[1]
    assert "usage: seqopt weigh [SCENE] [options]" in page
    assert "--least KG" in page
    assert "seqopt weigh arch25 --per brick" in page
    scene = "chain:bricks=7"
    assert command(capsys, "weigh", scene)[1] == "chain 7: 7 bricks weigh 25.62 kg\n"
    words = ("--per", "brick", "--names", "1", "--names", "3")
    table = command(capsys, "weigh", scene, *words)[1].splitlines()
    assert (table[0], len(table)) == ("brick,kg", 3)
    assert '"text": "chain 7' in command(capsys, "weigh", scene, "--json")[1]
    status, _, said = command(capsys, "weigh", "arch26")
    assert (status, said.count("\n")) == (2, 1)
    for wrong, said in (
        (("weigh", "--least", "x"), "--least: 'x' is not a positive number"),
        (("weigh", "--leest", "1"), "did you mean --least?"),
        (("weig",), "did you mean weigh?"),
    ):
        assert said in command(capsys, *wrong)[2]


def test_a_package_that_fails_is_left_out(package, capsys):
    package("nothing_of_this_name:WEIGH")
    with pytest.warns(PluginWarning, match="plug-in nothing_of_this_name:WEIGH"):
        status, page, _ = command(capsys, "--help")
    assert (status, "weigh" in page) == (0, False)
    assert command(capsys, "scene", "chain:bricks=7")[2] == ""  # nobody asks for plug-ins there


def count(
    folder: Path,
    *,
    kind: Literal["all", "odd"] = "all",
    most: Annotated[int, {"least": 0, "most": 5}] = 3,
    loud: bool = False,
):
    """Count.

    Parameters
    ----------
    folder : DIR
        where
    kind : CHOICE
        which
    most : N
        up to
    loud :
        say it louder
    """
    return f"{folder.name} {kind} {most}{'!' * loud}"


@pytest.mark.usefixtures("alone")
def test_a_function_is_registered_as_a_command(capsys, tmp_path):
    seqopt.register(seqopt.Command("count", count))
    assert {*every_command()} == {*COMMANDS, "count"}
    assert command(capsys, "count", tmp_path / "a", "--loud")[1] == "a all 3!\n"
    assert command(capsys, "count", tmp_path, "--most", "0", "--kind", "odd")[0] == 0
    assert "from 0 to 5" in command(capsys, "count", tmp_path, "--most", "6")[2]
    assert "did you mean odd?" in command(capsys, "count", tmp_path, "--kind", "od")[2]
    assert "arguments are required: DIR" in command(capsys, "count")[2]
    with pytest.raises(ProblemError, match="this name has a meaning already"):
        seqopt.register(seqopt.Command("scene", count))
    own = seqopt.Command("say", lambda scene="arch25", *, engine="x": f"{scene} {engine}")
    seqopt.register(own)  # what these words mean elsewhere is not meant
    assert command(capsys, "say", "mine", "--engine", "own")[1] == "mine own\n"
    seqopt.register(seqopt.Command("five", lambda: 5))
    assert "it returns int; return a text or a table" in command(capsys, "five")[2]
