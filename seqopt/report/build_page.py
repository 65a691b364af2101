"""The page that a plan shows of itself: beside the fixed methods, and beside other plans."""

from __future__ import annotations

from seqopt.errors import ProblemError
from seqopt.placement.shown_build import ShownBuild
from seqopt.report.plan_pages import plan_page
from seqopt.showing import Page


def build_page(plan: ShownBuild, *others: ShownBuild) -> Page:
    """Return a page that shows a plan step by step, beside others.

    Parameters
    ----------
    plan : plan
    *others : plan
        For the same scene.

    Raises
    ------
    ProblemError
        If another plan is for another scene.
    """
    engine = plan.engine
    scene = engine.network.scene
    names = [plan.title]
    beside = {}
    for other in others:
        if other.engine.network.scene != scene:
            raise ProblemError(
                f"plan {other.title} is for {other.engine.network.scene.name}, not for the same "
                f"scene {scene.name}; show it on its own"
            )
        name = _apart(other.title, names)
        names.append(name)
        beside[name] = other.responses()
    return Page(plan_page(engine, plan.title, plan.responses(), plan.worth, others=beside))


def _apart(name: str, taken: list[str]) -> str:
    """Return a name that is not taken yet."""
    found, number = name, 2
    while found in taken:
        found, number = f"{name} ({number})", number + 1
    return found
