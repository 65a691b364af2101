"""Names in CSV files are no formulas for spreadsheets, and come back as they were."""

import csv
import io
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import seqopt
from seqopt.exchange._files import _FORMULA, csv_text, harmless, plain
from seqopt.exchange.schedules import parse_plan, parse_schedule, schedule_text
from seqopt.sequence.methods import METHODS, three_robot_loop
from tests.builders import small_arch

NAMES = ("=cmd|'/c calc'!A1", "+1", "'@sum", "-x", "rob")


def named(names):
    """An arch whose robots are called so."""
    scene = small_arch(6)
    robots = zip(scene.robots, names, strict=False)
    return replace(scene, robots=tuple(replace(robot, name=name) for robot, name in robots))


@given(st.text("'=+-@a1"))
def test_no_cell_begins_as_a_formula_and_every_one_comes_back(text):
    assert not harmless(text).startswith(_FORMULA)
    assert plain(harmless(text)) == text


@pytest.mark.parametrize("names", [NAMES[:3], NAMES[2:]])
def test_a_plan_of_robots_with_such_names_is_read_again(names):
    scene = named(names)
    network = seqopt.build_network(scene)
    steps = METHODS["sequential"](network, names[:2])
    table = csv_text(seqopt.analyze(seqopt.make_engine("compliance", network), steps))
    cells = [cell for row in csv.reader(io.StringIO(table)) for cell in row]
    assert not [c for c in cells if c.startswith(_FORMULA) and not is_number(c)]
    assert parse_plan(scene, table, "plan") == steps
    schedule = three_robot_loop(network, [robot.name for robot in scene.robots])
    text = schedule_text(schedule)
    assert not text.splitlines()[0].count(",=")
    assert parse_schedule(network, text, "schedule").steps == schedule.steps


def is_number(cell):
    try:
        float(cell)
    except ValueError:
        return False
    return True


def test_numbers_stay_numbers():
    table = pd.DataFrame({"-a": [-1.5, 2.0], "b": ["=1", "x"], "c": [pd.NA, -3]})
    assert csv_text(table) == "'-a,b,c\n-1.5,'=1,\n2,x,-3\n"


def test_rows_are_written_as_tables_are():
    """With and without pandas a table is the same file, byte by byte."""
    columns = {
        "step": [1, 2, 10],
        "type": ["place", 'a "b", c', "x\ny"],
        "=brick": ["=a", "", "'+1"],
        "tilt": [2 / 3, 1e-12, -123456789.0],
        "bond": [math.nan, math.inf, 0.0],
        "jammed": [False, True, True],
    }
    table = pd.DataFrame(columns)
    assert csv_text(table.to_dict("records")) == csv_text(table)
    counted = table.assign(share=np.float32(0.1), step=table["step"].astype(np.int64))
    own = [
        dict(zip(counted, row, strict=True)) for row in zip(*map(counted.get, counted), strict=True)
    ]
    assert csv_text(own) == csv_text(counted)
