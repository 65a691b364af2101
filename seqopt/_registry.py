"""Extension points of the core: offers of outer rooms, found by name and loaded on demand.

A room with another amount, filter or picture adds a line here. The core works without any of them.
Plug-ins add amounts, filters, formats and pictures by entry points of the group ``seqopt.parts``,
users by `seqopt.register`.
"""

from __future__ import annotations

from collections.abc import Container
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

VIEWS = {
    "Shown.html": "seqopt.report._notebook:card",
    "Scene.plot": "seqopt.report._pictures:scene_picture",
    "Network.plot": "seqopt.report._pictures:network_picture",
    "Schedule.gantt": "seqopt.report._gantt:gantt_picture",
    "ShownBuild.plot": "seqopt.report._pictures:steps_picture",
    "ShownBuild.gantt": "seqopt.report._gantt:gantt_picture",
    "ShownBuild.animate": "seqopt.report._pictures:Film",
    "ShownBuild.report": "seqopt.report._pages:build_page",
    "Stability.plot": "seqopt.report.charts:tilt_picture",
    "FailureMap.plot": "seqopt.report.charts:failure_figure",
    "SpeedTable.plot": "seqopt.report._speed._chart:speed_chart",
}
"""By a class of values and a way, what shows them so; values of its subclasses, too."""
OFFERS = {
    "PostureRules": "seqopt.arms._judge",
    "check_postures": "seqopt.arms._judge",
    "compute_held_postures": "seqopt.arms._held",
    "find_postures": "seqopt.arms.reach",
    "hold_alike": "seqopt.arms._held",
    "permits": "seqopt.arms._permits",
    "with_postures": "seqopt.arms._kept",
    "makespan": "seqopt.times._twin",
    "mortar_waits": "seqopt.times._curing",
    "reassign": "seqopt.times._tables",
    "step_times": "seqopt.times._steps",
    "timed_graph": "seqopt.times._graph",
    "times_table": "seqopt.times._tables",
}
"""By name, the module of an outer room that has it."""
PARTS = ("makespan",)  # which of these are amounts or filters
ADDED: dict[tuple[type, str], Any] = {}
"""What users registered, by its kind and name."""


class Part:
    """Base of what outer rooms take from packages and users by name: formats, pictures."""

    name: str

    def reserved(self) -> Container[str]:
        """Return names that are always there."""
        raise NotImplementedError


def offered(name: str) -> Any:
    """Return the offer of an outer room by name; None if there is none, or the room is missing."""
    home = OFFERS.get(name, "")
    try:
        return getattr(import_module(home), name) if home else None
    except ModuleNotFoundError as error:
        if error.name != ".".join(home.split(".")[:2]):
            raise
        return None


def view(kind: type, way: str) -> Any:
    """Return what shows values of a class in a way, loaded on first use."""
    keys = (f"{each.__name__}.{way}" for each in kind.__mro__)
    home, name = next(VIEWS[key] for key in keys if key in VIEWS).split(":")
    return getattr(import_module(home), name)


def registered(kind: type) -> dict[str, Any]:
    """Return the parts of a kind that rooms, plug-ins and users registered, by name."""
    points = entry_points(group="seqopt.parts")
    every = [(name, offered(name)) for name in PARTS] + [(p.name, p.load()) for p in points]
    every += [(name, part) for (_, name), part in ADDED.items()]
    return {name: part for name, part in every if isinstance(part, kind)}
