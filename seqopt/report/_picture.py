"""Pictures of builds by name: those of the room, and those that packages and users register."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pandas as pd

from seqopt._registry import Part, registered
from seqopt._showing import display
from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.plan.build import ShownBuild
from seqopt.sequence.steps import Step

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Draw = Callable[[Engine, Sequence[Step], "pd.DataFrame"], "Figure"]  # pandas is loaded late


@dataclass(frozen=True, repr=False)
class Picture(Part):
    """A picture of a build.

    Parameters
    ----------
    name : str
        By which it is asked for, and which ends the names of its files.
    draw : callable
        Takes the engine, the steps, and the table of `seqopt.analyze`; returns a figure.

    Examples
    --------
    >>> Picture("moments", lambda engine, steps, table: table.plot(x="step").figure)
    Picture('moments')
    """

    name: str
    draw: Draw = field(compare=False)

    def __repr__(self) -> str:
        return f"Picture({self.name!r})"

    def reserved(self) -> Sequence[str]:
        """Return the names of the pictures that are always there."""
        return (*BUILT_IN, "responses")  # the latter is of several builds


def _steps(engine: Engine, steps: Sequence[Step], table: pd.DataFrame) -> Figure:  # noqa: ARG001
    figure: Figure = display(ShownBuild, "plot")(engine, steps)
    return figure


def _grips(engine: Engine, steps: Sequence[Step], table: pd.DataFrame) -> Figure:
    figure: Figure = display(ShownBuild, "gantt")(engine.network.scene, steps, table)
    return figure


BUILT_IN = {each.name: each for each in (Picture("steps", _steps), Picture("grips", _grips))}


def pictures() -> dict[str, Picture]:
    """Return all pictures of builds by name, registered ones last."""
    return {**BUILT_IN, **registered(Picture)}


def picture(plan: ShownBuild, name: str) -> Figure:
    """Return a picture of a plan.

    Parameters
    ----------
    plan : Plan or GivenSequence
    name : str
        ``steps``, ``grips``, or that of a `Picture` of your own.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ProblemError
        If there is no such picture.
    ExtraError
        If matplotlib is not installed.

    Examples
    --------
    >>> import seqopt
    >>> plan = seqopt.optimize("chain:bricks=7", "free")
    >>> picture(plan, "steps").axes[0].get_title()
    'step 2 of 12: brick 2 is placed'
    """
    known = pictures()
    if name not in known:
        raise ProblemError(f"picture {name}: there is none; give one of {', '.join(known)}")
    return known[name].draw(plan.engine, plan.steps, plan.responses())
