"""What cannot be answered is one line that says why, with its status; nothing is written.

``ARCH`` stands for a scene of five bricks, ``SIX`` for one of six, ``FAR`` and ``BARE`` for the
first with robots that reach nothing and without any, ``PLAN`` for the folder of a plan of it.
"""

import re
from dataclasses import replace

import pytest

from seqopt._cli.arguments import parser
from seqopt._cli.registry import COMMANDS
from seqopt.scene.parts import Sphere
from seqopt.scene.scene_file import save_scene
from tests.builders import six_bricks, small_arch
from tests.commands import command

VLR = "assess arch:span=1,rise=0.4,pattern=VLR --method sequential"
FREE = "optimize ARCH --schedule free"
TIMED = f"{FREE} --durations fetch=30,place=10,approach=10,grip=5,release=5"
ROBUST = "optimize SIX --robust"
WALL = "wall:columns=2,courses=2"
BAD = {
    # commands, scenes, files
    "--engine": "COMMAND",
    "analyze arch52 --method sequential": "scene arch52",
    "assess arch25 --method sequential --friction 25": "a coefficient up to 2; 25° is 0.466",
    f"{FREE} --stands dry --friction 25": "a coefficient up to 2; 25° is 0.466",
    "scene arc:span=2,rise=.8": "did you mean arch?",
    "times arch25 --method cantilever --curing 15min": "give --stands epoxy",
    "optimize BARE --schedule free": "it has no robots; give at least one",
    "assess BARE": "it has no robots; give at least one",
    "analyze no/such.json --method sequential": "no/such.json",
    "analyze --plan no.csv": "no.csv",
    "analyze --method sequential --plan no.csv": "not allowed with",
    "analyze --method sequential --out no/dir/x.csv": "no/dir/x.csv",
    "analyze --method sequential --robots rob1,rob9": "robot 'rob9'",
    "analyze --method published --robots rob1,rob2": "--robots rob1,rob2: a plan",
    "assess --method sequential --mortar glue": "--mortar glue: give epoxy, dry",
    # schedules, formulations, criteria, limits
    "optimize ARCH --formulation overlap_dp --schedule ring": "schedule 'ring' does not exist",
    "optimize ARCH --formulation beam --option depth=3": "--option depth=3: beam has width",
    "optimize ARCH --formulation beam --option width=wide": "width is 'wide'; give a whole number",
    "optimize ARCH --criterion T_max=heavy": "'heavy' is not a positive",
    "optimize ARCH --limit T_max": "--limit T_max",
    "optimize ARCH --limit payload=9": "values with --payload",
    # budgets
    "optimize ARCH --formulation labels --budget robot_use:rob9=80:3": "has no F_rob9; give",
    f"compare {WALL} --reference frame": "--reference: it values the plans of --speed",
    f"compare {WALL} --speed 9 --reference rigid": "reference 'rigid' does not exist; give one of",
    "optimize ARCH --budget travel=2m --budget travel=0.5": "budget travel=2m: it stands there",
    # scenarios
    f"{ROBUST} cvar=2": "cvar=2.0: give a level",
    f"{ROBUST} worst-total --formulation minimax": "use overlap_dp",
    f"{ROBUST} worst-peak --formulation minimax --budget travel=2m": "couples all moves; use",
    f"{ROBUST} worst-total --schedule free --aim steps": "of one sum alone",
    f"{ROBUST} worst-peak --scenarios x": "--scenarios x: give a whole number",
    f"{ROBUST} worst-peak --vary density=-1": "not a positive number",
    f"{ROBUST} worst-peak --vary grips=2": "they are rigid; say how stiff with --grips",
    f"{FREE} --robust worst-peak --aim sum": "no total of worst states",
    f"{ROBUST} worst-peak --vary wind=2": "--vary wind=2 does not exist; give one of stiffness",
    # the free schedule
    f"{FREE} --aim speed": "aim 'speed' does not exist",
    f"{FREE} --robots 7": "7 robots: give a number from 1 to 5",
    f"{FREE} --option width=0": "options width=0, growth=1.1: give a whole number",
    f"{FREE} --option speed=1": "--option speed=1: schedule_search has width",
    f"{FREE} --formulation minimax --aim steps": "minimax: a sum comes first",
    f"{FREE} --formulation pareto_zones": "pareto_zones is for Pareto sets",
    f"{FREE} --criterion equations-2-3": "it ranks the choices of a move",
    f"{FREE} --tilt 3": "--tilt: it goes with --stands",
    f"{FREE} --stands dry --tilt 90": "--tilt 90: give an angle from 0 to below 90 degrees",
    f"{FREE} --stands dry --rule payload=ignored": "holds up anything",
    f"{FREE} --budget trips=0.8": "give travel=3.5m, makespan=600s, regrips=2",
    f"{FREE} --budget makespan=60": "budget makespan=60: give it as makespan=60s",
    "times ARCH --durations speed=200mm/s": "speed is '200mm/s'; give a number of m/s",
    "times ARCH --durations fetch=30s": "fetch is '30s'; give a number of s, as fetch=30,place=10",
    "reach BARE": "it has no robots; give at least one",
    "export ARCH --format tasks --distance 150": "distance is 150 m; give at most 10, in meters",
    f"{FREE} --direction takedown": "did you mean take-down?",
    f"{FREE} --direction take-down --keep 1..2": "unrecognized arguments: --keep",
    f"{FREE} --direction take-down --order search": "give an order",
    f"{FREE} --props evry": "'evry' is no node (did you mean every?); give nodes, as 13,27",
    f"{FREE} --from PLAN:99": "the plan has 0 to",
    f"{FREE} --from 9": "site: 9 bricks",
    f"{FREE} --to PLAN:x": "give PLAN:STEP",
    f"{FREE} --order search --formulation pareto_zones": "or order_search",
    f"{FREE} --order search --max-memory 1B": "error: --max-memory: it is too little",
    "optimize ARCH --order search --schedule loop": "orders, parts of builds, and steps",
    # what does not go together, as help says
    "optimize ARCH --limits payload": "--limits payload (did you mean --limit?)",
    "analyze ARCH --strict": "unrecognized arguments: --strict (see",
    "optimize ARCH --lost rob1": "--lost rob1: a build that goes on has changed; say where",
    "optimize ARCH --rule least_grips=1": "only the free schedule has them; give --schedule free",
    "optimize ARCH --direction take-down": "it goes with --schedule free",
    "optimize ARCH --friction 0.5": "it goes with --stands",
    # numbers and sizes
    "optimize ARCH --workers 0": "--workers 0: give a whole number from 1",
    "optimize ARCH --max-memory much": "--max-memory much: give a size, as 500MB or 2GB",
    "optimize ARCH --time-limit 5min": "not a positive number or zero; give a number of s",
    "optimize ARCH --limit D_max=20": "--limit D_max=20: 20 m is more than the structure's size, ",
    "optimize ARCH --limit D_max=2in": "'2in' is not a positive number; give a number of m, or a",
    "optimize ARCH --limit F_largest=300N": "'300N' is not a positive number; give a number of N",
    "optimize ARCH --grips -1e6": "rob1: stiffness is -1000000.0; give one number or three",
    "optimize ARCH --robots rob1 --aim minmx": "aim 'minmx' does not exist (did you mean minmax?)",
    "scene arch25 --grips=soft": "--grips soft: 'soft' is no stiffness; give rigid, 1e6 or",
    "scene arch25 --grips=1e6,2e4": "give a stiffness, and after a comma turning=STIFFNESS",
    "compare arch25 --speed=x": "--speed: 'x' is not a positive number",
    f"{VLR} --mortar dry --margins tillt": "margin 'tillt' (did you mean tilt?): give all, or",
    f"{VLR} --map wind": "--map wind: give friction or tilt, with values as",
    f"{VLR} --map tilt=60": "--map tilt=60: 60 is too much; give tilt from 0 to 45",
    f"{VLR} --map friction=x": "--map friction=x: 'x' is not a positive number or zero",
    f"{VLR} --map friction --holds glue": "--holds glue: give epoxy, dry, or bond=",
    f"{VLR} --map friction --margins bond": "--margins: not allowed with --map; leave one",
    f"{VLR} --map friction --friction 0.3": "of them out, or give --map friction=0.3",
    f"{VLR} --map friction --mortar dry": "--mortar: not allowed with --map; leave one of them",
    f"{VLR} --map friction --workers 2": "--workers: not allowed with --map; leave one of them",
    f"{VLR} --holds dry": "--holds dry: it goes with --map; give --map friction, say",
}
NO_ANSWER = {
    f"{FREE} --order 1,3,2,4,5": "brick 3 (2 of 5) is never placed: brick 3 hangs free: no joint",
    f"{FREE} --order 1,4,2,3,5": "no joint leads to the ground; give another order (--order)",
    "optimize FAR --schedule free": "never placed: of robots that may, none reaches a free node of",
    "optimize FAR --schedule free --rule placers=rob2": "may, none reaches a free node of",
    f"{TIMED} --budget makespan=1s": "within all budgets; --aim makespan finds its least, and 1 s",
    f"{FREE} --payload 20": "grips that give way (--grips 1e6) may do with a smaller payload",
    f"{ROBUST} worst-peak --scenarios 2 --budget travel=0.8": "within all budgets; travel is at",
    f"{ROBUST} worst-total --scenarios 2 --limit F_largest=1": "F_largest",
    f"{FREE} --stands bond=1e-9 --friction 0.01": "a bond of ",
    f"{FREE} --limit F_largest=1": "it becomes possible with F_largest=",
    f"{FREE} --payload 30": "more than the payload of rob1 (30 N), rob2 (30 N), rob3 (30 N)",
    f"{FREE} --budget sum(T_max)=0": "no plan is within all budgets; sum(T_max) is at least",
    "optimize arch25 --limit F_largest=9": "in which no grip is open, has F_largest=",
    "optimize SIX --limit T_max=17": "it becomes possible with T_max=18.6",
    "optimize SIX --budget travel=0.1m": "travel is at least 1.42463 m, and 0.1 m is",
}
NOT_FOUND = {  # by a search that left something out, or had no time
    "optimize arch25 --formulation cascade --no-proof --limit T_max=64": "no grip is allowed",
    "optimize arch25 --schedule free --time-limit 0": "time is over: .*no plan was found yet; give",
    "optimize arch25 --schedule free --stands dry --aim bond --time-limit 0": "no plan was found",
    "optimize arch25 --schedule free --order search --time-limit 0": "no plan was found yet; give",
    "optimize arch25 --formulation cascade --no-proof --time-limit 0": "no grip was chosen yet",
}


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    """Paths of scenes, and of a plan, by the words that stand for them."""
    home = tmp_path_factory.mktemp("scenes")
    bare = small_arch(5).with_robots()
    away = Sphere(center=(50.0, 0.0, 0.0), radius=1.0)
    far = small_arch(5).with_robots(*(replace(r, reach=away) for r in small_arch(5).robots))
    made = {"ARCH": small_arch(5), "SIX": six_bricks(), "BARE": bare, "FAR": far}
    for name, scene in made.items():
        save_scene(scene, home / f"{name}.json")
    (home / "PLAN").mkdir()
    rows = "step,type,bricks,rob1_node,rob2_node,rob3_node\n1,place,1,1,,\n"
    (home / "PLAN" / "plan.csv").write_text(rows, encoding="utf-8")
    return {"PLAN": home / "PLAN"} | {name: home / f"{name}.json" for name in made}


CASES = [(BAD, 2), (NO_ANSWER, 3), (NOT_FOUND, 4)]


@pytest.mark.parametrize(
    ("words", "said", "code"),
    [(words, said, status) for each, status in CASES for words, said in each.items()],
)
def test_it_is_a_line_and_writes_nothing(capsys, monkeypatch, scenes, tmp_path, words, said, code):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("seqopt.work.GRACE", 60.0)  # posing is not late on a busy machine
    words = re.sub("ARCH|SIX|BARE|FAR|PLAN", lambda found: str(scenes[found[0]]), words).split()
    more = ["--out", "out"] if words[0] == "optimize" else []
    found, out, err = command(capsys, *words, *more)
    assert (found, out, err.count("\n")) == (code, "", 1), err
    assert re.search(said if code == 4 else re.escape(said), err), err
    assert not [*tmp_path.iterdir()]


# every command runs with a scene alone, and says what it takes for the rest
ALONE = sorted(COMMANDS.keys() - {"import", "judge"})  # these are of files


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Return a folder to write to, in which there is a small arch."""
    save_scene(small_arch(4), tmp_path / "arch.json")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ALONE)
def test_a_command_runs_with_a_scene_alone(capsys, here, name):
    status, out, err = command(capsys, name, "arch.json")
    assert (status, bool(out)) == (0, True), err


def test_no_command_that_takes_a_scene_is_left_out():
    takes = set()
    for name in COMMANDS:
        actions = parser(name)._subparsers._group_actions[0].choices[name]._actions
        words = [action.metavar or "" for action in actions if not action.option_strings]
        takes |= {name for word in words if "SCENE" in word}
    assert takes == {*ALONE}


def test_what_is_taken_is_said_in_one_line(capsys, here):
    _, _, err = command(capsys, "analyze", "arch.json")
    assert err.startswith("steps: of the sequential method; --method, --plan or a plan's folder")
    _, _, err = command(capsys, "times", "arch.json")
    assert "durations: not known, taken as fetch=30,place=10" in err
    _, _, err = command(capsys, "analyze", "arch.json", "--method", "cantilever")
    assert "steps: of" not in err


def test_times_names_every_file_that_it_writes(capsys, here):
    _, said, _ = command(capsys, "times", "arch.json", "--out", "out")
    names = said.splitlines()[-1].removeprefix("written to out: ").split(", ")
    assert {*names} == {path.name for path in (here / "out").iterdir()}
    assert {"plan.csv", "times.csv"} < {*names}


def test_files_are_named_by_the_scene(capsys, here):
    _, _, err = command(capsys, "instance", "arch.json")
    (written,) = here.glob("*.npz")
    assert f"file: {written.name}; --out names another" in err
    command(capsys, "report", "arch.json")
    assert (here / "arch.html").is_file()


def test_a_folder_of_a_plan_is_its_scene_and_its_steps(capsys, here):
    command(capsys, "optimize", "arch.json", "--schedule", "free", "--out", "plan")
    for name in ("analyze", "export"):
        alone = command(capsys, name, "arch.json")
        status, out, err = command(capsys, name, "plan")
        assert status == 0, err
        assert "steps: of" not in err
        assert out != alone[1]
        if name != "export":
            assert command(capsys, name, "arch.json", "--plan", "plan")[1] == out


def test_where_no_method_fits_a_plan_is_made(capsys, here, monkeypatch):
    monkeypatch.setattr("seqopt.questions.METHODS", {})
    status, _, err = command(capsys, "analyze", "arch.json")
    assert status == 0
    assert err.startswith("steps: of the best free schedule, minmax")
