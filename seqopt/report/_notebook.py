"""What a notebook shows of a value: a small table and, with matplotlib, small pictures.

The table has the notebook's own colors, so that it can be read on a dark background too; pictures
have a white background. Nothing slow is computed for the display.
"""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import singledispatch
from html import escape
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from seqopt._showing import display
from seqopt.errors import ExtraError, ProblemError
from seqopt.plan.build import ShownBuild
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.report.comparison import largest
from seqopt.report.text import IN_UNITS, typed
from seqopt.responses.quantities import _number_text
from seqopt.responses.table import OUTSIDE, REMEDY
from seqopt.scene.boxes import boxes
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Schedule
from seqopt.stability._builds import BuildProver

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Rows = Mapping[str, object]
SMALL = 60  # bricks up to which responses of a plan are computed and several steps drawn
DPI = 90
COLORS = 128  # of a picture: a quarter of the bytes; an octree keeps colors of small areas
WIDTH = 4.5  # of a structure, inches
STEPS = 34  # of a build whose grips are drawn


class _Card(NamedTuple):
    """A value in a notebook: a title, rows of a table by name, and its pictures."""

    title: str
    rows: Rows
    draw: Callable[[], list[Figure]] = list


def card(value: object) -> str:
    """Return a table of a value and, with matplotlib, small pictures of it, as HTML."""
    shown = facts(value)
    title = escape(shown.title)
    cells = "".join(
        f'<tr><th style="text-align:left;vertical-align:top">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(str(content))}</td></tr>'
        for name, content in shown.rows.items()
    )
    images = ""
    with suppress(ExtraError):
        for figure in shown.draw():
            from PIL import Image  # noqa: PLC0415  # comes with matplotlib, an extra

            large, small = io.BytesIO(), io.BytesIO()
            figure.savefig(large, format="png", dpi=DPI)
            few = Image.open(large).convert("RGB").quantize(COLORS, Image.Quantize.FASTOCTREE)
            few.save(small, format="png", optimize=True)
            source = f"data:image/png;base64,{b64encode(small.getvalue()).decode()}"
            images += (
                f'<img alt="{title}" src="{source}" style="display:block;max-width:100%;'
                'height:auto;background:#fff;border-radius:6px;margin-bottom:0.5em">'
            )
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'<table><thead><tr><th colspan="2" style="text-align:left">{title}</th></tr>'
        f"</thead><tbody>{cells}</tbody></table>"
        f'<div style="flex:1 1 20em;min-width:0">{images}</div></div>'
    )


@singledispatch
def facts(value: object) -> _Card:
    """Return the title, table and pictures of a value."""
    return _Card(type(value).__name__, {"": repr(value)})


@facts.register
def _scene(value: Scene) -> _Card:
    by_payload: dict[float, list[str]] = {}
    for robot in value.robots:
        by_payload.setdefault(robot.payload, []).append(robot.name)
    teams = (f"{', '.join(names)}: payload {load:.4g} N" for load, names in by_payload.items())
    size = np.ptp(boxes(value.bricks).corners().reshape(-1, 3), axis=0)
    rows = {
        "bricks": len(value.bricks),
        "joints": len(value.joints),
        "supports": len(value.grounds),
        "size, m": " × ".join(f"{length:.3g}" for length in size),
        "mass, kg": f"{sum(brick.mass for brick in value.bricks):.4g}",
        "robots": "; ".join(teams),
        "nodes that may be held": 2 * len(value.bricks) - len(value.blocked_nodes),
        **({"beside the weight": value.loading} if value.loading else {}),
    }
    return _Card(f"Scene {value.name}", rows, lambda: [display(Scene, "plot")(value, width=WIDTH)])


@facts.register
def _schedule(value: Schedule) -> _Card:
    counts = [len(move.candidates) for move in value.moves]
    rows: dict[str, object] = {
        "scene": value.scene.name,
        "steps": len(value.steps),
        "grips to choose": len(counts),
    }
    if counts:
        rows["nodes to choose from"] = f"{min(counts)} to {max(counts)} for a grip"
        rows["choices of all grips"] = f"10^{np.log10(counts).sum():.0f}"
    if value.left_out:
        rows["left out"] = value.left_out
    last = min(len(value.steps), STEPS)
    return _Card(f"Schedule {value.method}", rows, lambda: [value.gantt(1, last)])


@facts.register
def _problem(value: Problem) -> _Card:
    scene = value.scene
    if isinstance(value.moves, Schedule):
        title, rows, draw = _schedule(value.moves)
        name = f"Problem: which nodes to hold ({title[0].lower()}{title[1:]})"
    else:
        team = value.moves.robots or tuple(robot.name for robot in scene.robots)
        rows = {"scene": scene.name, "bricks": len(scene.bricks), "robots": ", ".join(team)}
        name, draw = "Problem: who does what next, and where", _scene(scene).draw
    limits = ", ".join(f"{limit.response} up to {limit.bound:.4g}" for limit in value.limits)
    more = {
        "to be least, in this order": ", ".join(map(str, value.goals)),
        "criterion": value.criterion.name,
        "limits": limits or "none",
        "budgets": ", ".join(value.budgets),
        "every step must stand": "yes" if value.stands is not None else "",
        "scenarios": f"{len(value.scenarios)}, {value.over}" if value.scenarios else "",
        "orders": "" if value.orders is None else value.orders.value,
        "engine": repr(value.engine),
    }
    return _Card(name, {**rows, **{name: said for name, said in more.items() if said}}, draw)


@facts.register
def _build(value: ShownBuild) -> _Card:
    try:
        scene = value.engine.network.scene
    except ProblemError:  # costs alone were given
        return _Card("Plan", {"": repr(value)})
    small = len(scene.bricks) <= SMALL
    rows: dict[str, object] = {} if small else {"linear range": "see departures: not computed here"}
    if small and (left := "; ".join(map(str, value.departures))):
        rows[OUTSIDE] = f"{left}. {REMEDY}"
    rows["found by"] = typed(value.title)
    if isinstance(value, Plan):
        name = value._of_scene.criterion.name
        rows |= {"criterion": name} if name else {}
    rows |= {"result": value.result, "steps": len(value.steps)}
    rows |= _computed(value) if small else {"stability": "see verdicts: not computed here"}
    if value.seconds:
        rows["time to find it, s"] = f"{sum(value.seconds.values()):.3g}"

    def draw() -> list[Figure]:  # some steps and, of a small build, its first grips
        paint, count = display(ShownBuild, "plot"), len(value.steps)
        from seqopt.report._pictures import spread_steps  # noqa: PLC0415  # matplotlib is an extra

        if not small:
            return [paint(value.engine, value.steps, value.steps[count // 2].number)]
        last = value.steps[min(count, STEPS) - 1].number
        shown = spread_steps(value.steps, 3)
        return [paint(value.engine, value.steps, shown), value.gantt(None, last)]

    return _Card(f"Plan for {scene.name}", rows, draw)


def _computed(value: ShownBuild) -> Rows:
    """Return the largest responses of any step, and whether steps stand."""
    found = largest(value.engine.network.scene, value.responses())
    rows = {f"largest {said}": _number_text(found[name]) for name, said in IN_UNITS.items()}
    grips = value.grips()
    row = grips.iloc[int(grips["largest_force_N"].argmax())]
    where = f"{row['robot']} at node {row['node']} of brick {row['brick']}, step {row['at_step']}"
    rows["at the largest grip force"] = where
    prover = BuildProver(value.engine.network)
    verdicts = prover.of_builds({"": value.steps}).get("", ())
    said = {f"stability, {each.how}": str(each).partition(": ")[2] for each in verdicts}
    return rows | (said or {"stability": f"not proven; {prover.refusal}"})
