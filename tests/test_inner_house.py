"""The inner house stands alone: it plans the same where every outer room is taken away."""

import json
import os
import shutil
import subprocess
import sys

import pytest

import seqopt
from seqopt.arms import Arm
from tests.builders import ROOT

pytestmark = pytest.mark.slow  # what inner rooms import is read every day
OUTER = ("arms", "exchange", "times", "report", "_cli")
SOLVED = """
import json, seqopt
plan = seqopt.optimize("arch25", formulation="cascade")
print(json.dumps([plan.objective, [step.grips for step in plan.steps], seqopt.__file__]))
"""
ARMED = """
import seqopt
try:
    seqopt.load_scene("s.json")
except seqopt.SeqoptError as error:
    print(type(error).__name__, error)
"""


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """A copy of both packages without the outer rooms."""
    home = tmp_path_factory.mktemp("house")
    left_out = shutil.ignore_patterns("__pycache__", *OUTER)
    for package in ("seqopt", "formulations"):
        shutil.copytree(ROOT / package, home / package, ignore=left_out)
    assert not {*OUTER} & {path.name for path in (home / "seqopt").iterdir()}
    return home


def run(house, code):
    """Return what code prints in a fresh interpreter that has the copy."""
    path = os.pathsep.join(filter(None, (str(house), os.environ.get("PYTHONPATH"))))
    env = {**os.environ, "PYTHONPATH": path}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=house, env=env)
    return done.stdout


def test_the_inner_house_plans_without_outer_rooms(house):
    objective, grips, file = json.loads(run(house, SOLVED))
    assert file.startswith(str(house))
    plan = seqopt.optimize("arch25", formulation="cascade")
    assert objective == pytest.approx(plan.objective)
    assert grips == [list(step.grips) for step in plan.steps]


def test_arms_without_their_room_are_refused_in_a_line(house):
    scene = seqopt.load_scene("chain:bricks=6")
    arm = Arm(urdf="any.urdf", position=(0.0, 1.5, 0.0), tool_length=0.3, tool_radius=0.05)
    robots = [seqopt.Robot(name=r.name, payload=r.payload, arm=arm) for r in scene.robots]
    seqopt.save_scene(scene.with_robots(*robots), house / "s.json")
    (line,) = run(house, ARMED).splitlines()
    assert line.startswith("ExtraError Arm is of the subpackage seqopt.arms, which is not there")
