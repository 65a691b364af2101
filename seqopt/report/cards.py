"""What a notebook shows of a value: a small table and, with matplotlib, a small picture.

The table has the notebook's own colors, so that it can be read on a dark background too; pictures
have a white background. Nothing slow is computed for the display.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping
from functools import singledispatch
from html import escape

import numpy as np

from seqopt.errors import ExtraError, ProblemError
from seqopt.network.network import Network
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.order_problem import OrderProblem
from seqopt.placement.problem import Problem
from seqopt.placement.requirements import Limit
from seqopt.placement.robust_problem import RobustProblem
from seqopt.placement.shown_build import ShownBuild
from seqopt.report.comparison import largest
from seqopt.report.page_builds import WORDS
from seqopt.report.wording import typed
from seqopt.responses.linear_range import OUTSIDE, REMEDY
from seqopt.responses.quantities import number_text
from seqopt.scene.boxes import boxes
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Schedule
from seqopt.showing import display
from seqopt.stability.assessment import Stability

Rows = Mapping[str, object]
SMALL = 60  # bricks up to which the responses of a plan are computed to be shown


def card(value: object) -> str:
    """Return a table of a value and small pictures of it, as HTML.

    Parameters
    ----------
    value : object
        A scene, network, schedule, problem, plan or stability.

    Returns
    -------
    str
        Without pictures where matplotlib is not installed.
    """
    title, rows = facts(value)
    cells = "".join(
        f'<tr><th style="text-align:left;vertical-align:top">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(str(content))}</td></tr>'
        for name, content in rows.items()
    )
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f'<table><thead><tr><th colspan="2" style="text-align:left">{escape(title)}</th></tr>'
        f"</thead><tbody>{cells}</tbody></table>"
        f'<div style="flex:1 1 20em;min-width:0">{_images(value, title)}</div></div>'
    )


def _images(value: object, title: str) -> str:
    """Return the pictures of a value; nothing where matplotlib is not installed."""
    try:
        draw: Callable[[object], list[bytes]] = display("thumbnails")
    except ExtraError:
        return ""
    return "".join(
        f'<img alt="{escape(title)}" src="data:image/png;base64,{b64encode(png).decode()}" '
        'style="display:block;max-width:100%;height:auto;background:#fff;border-radius:6px;'
        'margin-bottom:0.5em">'
        for png in draw(value)
    )


@singledispatch
def facts(value: object) -> tuple[str, Rows]:
    """Return what a value is, in a few words, and what there is to say about it.

    Returns
    -------
    title : str
    rows : mapping of str to object
        Of the table, by name.
    """
    return type(value).__name__, {"": repr(value)}


@facts.register
def _scene(value: Scene) -> tuple[str, Rows]:
    corners = boxes(value.bricks).corners().reshape(-1, 3)
    size = " × ".join(f"{length:.3g}" for length in np.ptp(corners, axis=0))
    return f"Scene {value.name}", {
        "bricks": len(value.bricks),
        "joints": len(value.joints),
        "supports": len(value.grounds),
        "size, m": size,
        "mass, kg": f"{sum(brick.mass for brick in value.bricks):.4g}",
        "robots": _robots(value),
        "nodes that may be held": 2 * len(value.bricks) - len(value.blocked_nodes),
    }


def _robots(scene: Scene) -> str:
    by_payload: dict[float, list[str]] = {}
    for robot in scene.robots:
        by_payload.setdefault(robot.payload, []).append(robot.name)
    return "; ".join(
        f"{', '.join(names)}: payload {payload:.4g} N" for payload, names in by_payload.items()
    )


@facts.register
def _network(value: Network) -> tuple[str, Rows]:
    supports = len(value.springs.support)
    return f"Network of {value.scene.name}", {
        "bricks": len(value.inner),
        "nodes": len(value.node_kind),
        "of these to hold": 2 * len(value.inner) - len(value.scene.blocked_nodes),
        "edges": len(value.edge_kind),
        "springs of joints": len(value.springs.since) - supports,
        "springs of supports": supports,
    }


@facts.register
def _schedule(value: Schedule) -> tuple[str, Rows]:
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
    return f"Schedule {value.method}", rows


@facts.register
def _problem(value: Problem) -> tuple[str, Rows]:
    title, rows = _schedule(value.schedule)
    return f"Problem: which nodes to hold ({title[0].lower()}{title[1:]})", {
        **rows,
        "criterion": value.criterion.name,
        "limits": _limits(value.limits),
        "budgets": ", ".join(budget.name for budget in value.budgets) or "none",
        "engine": repr(value.engine),
    }


@facts.register
def _robust_problem(value: RobustProblem) -> tuple[str, Rows]:
    _, rows = _problem(value.nominal)
    extras = {"scenarios": len(value.scenes), "aim over them": str(value.aim)}
    return "Problem over scenarios: which nodes to hold", {**rows, **extras}


@facts.register
def _free_problem(value: FreeProblem) -> tuple[str, Rows]:
    scene, columns = value.network.scene, value.space.kinds
    team = sorted(robot for kind in columns for robot in kind.robots)
    return f"Problem of the {value.title}: who does what next, and where", {
        "scene": scene.name,
        "bricks": len(scene.bricks),
        "robots": ", ".join(scene.robots[robot].name for robot in team),
        "to be least, in this order": ", ".join(map(str, value.goals)),
        "criterion": value.criterion.name,
        "limits": _limits(value.limits),
        "every step must stand": "yes" if value.standing is not None else "not asked",
        "engine": repr(value.engine),
    }


@facts.register
def _order_problem(value: OrderProblem) -> tuple[str, Rows]:
    _, rows = _free_problem(value.free)
    return "Problem of the order: which brick next, by whom, and where", {
        **rows,
        "orders": value.among.value,
    }


def _limits(limits: tuple[Limit, ...]) -> str:
    return ", ".join(f"{limit.response} up to {limit.bound:.4g}" for limit in limits) or "none"


@facts.register
def _build(value: ShownBuild) -> tuple[str, Rows]:
    try:
        scene = value.engine.network.scene
    except ProblemError:  # costs alone were given
        return "Plan", {"": repr(value)}
    criterion = _criterion(value)
    small = len(scene.bricks) <= SMALL
    rows: dict[str, object] = {
        **(_outside(value) if small else {"linear range": "see departures: not computed here"}),
        "found by": typed(value.title),
        **({"criterion": criterion} if criterion else {}),
        "result": value.worth,
        "steps": len(value.steps),
    }
    if small:
        rows |= _worst(value)
    if value.seconds:
        rows["time to find it, s"] = f"{sum(value.seconds.values()):.3g}"
    return f"Plan for {scene.name}", rows


def _criterion(value: ShownBuild) -> str:
    """Return the name of the criterion that a plan was chosen by; empty where none was."""
    problem = getattr(value, "problem", None)
    for inner in ("nominal", "free"):  # of problems over scenarios and orders
        problem = getattr(problem, inner, problem)
    return "" if problem is None else str(problem.criterion.name)


def _outside(value: ShownBuild) -> Rows:
    """Return how responses leave the linear range, if they do."""
    left = "; ".join(map(str, value.departures))
    return {OUTSIDE: f"{left}. {REMEDY}"} if left else {}


def _worst(value: ShownBuild) -> Rows:
    """Return the largest responses of any step."""
    found = largest(value.engine.network.scene, value.responses())
    rows = {f"largest {WORDS[name]}": number_text(found[name]) for name in WORDS}
    grips = value.grips()
    row = grips.iloc[int(grips["largest_force_N"].argmax())]
    rows["at the largest grip force"] = (
        f"{row['robot']} at node {row['node']} of brick {row['brick']}, step {row['at_step']}"
    )
    return rows


@facts.register
def _stability(value: Stability) -> tuple[str, Rows]:
    rows: dict[str, object] = {
        "verdict": value.verdict.value,
        "bond needed, Pa": f"{value.bond:.4g}",
        "friction needed": f"{value.friction:.4g}",
        "largest grip force, N": f"{value.grip:.4g}",
    }
    if value.jammed:
        rows["jammed"] = "stands only because it is wedged in place: do not trust it"
    if np.isfinite(value.tilt):
        rows["tilt survived, degrees"] = f"{np.degrees(value.tilt):.3g}"
    if value.first_block:
        joint = f", joint {value.first_contact}" if value.first_contact else ""
        rows["fails first"] = f"block {value.first_block}{joint}"
    return f"Stability: {value.verdict.value}", rows
