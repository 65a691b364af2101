"""Kinds of engines that others tell apart, without what these compute with."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import dataclass
from enum import Enum

from seqopt.contact._elastic_limits import ElasticLimits
from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine, NamedEngine, SerialEngine
from seqopt.scene.scene import Scene

FAR = 0.1  # motion over a brick's length beyond which a structure has gone


def linear_limit(scene: Scene) -> float:
    """Return the displacement up to which a linear model holds, m: a tenth of the smallest side."""
    return FAR * min(min(brick.dimensions) for brick in scene.bricks)


class Level(Enum):
    """Levels of detail of a model, cheapest first; values are the engines' names."""

    PLANAR = "planar"
    RIGID = "compliance"
    DISCRETE = "discrete"


@dataclass(frozen=True)
class LevelChoice:
    """A level and why it was taken."""

    level: Level
    reason: str  # a clause that goes into a sentence


class ChoosingEngine(NamedEngine, ABC):
    """Base of the engine that chooses a level for every grip set.

    ``tally``: how many grip sets of all calls were answered at which level, and why. ``unchecked``:
    why elastic limits are not checked; empty if they are. ``limits``: those; none if they are not
    known. ``mortar``: of joints. ``rigid``: the engine of rigid bricks on springs that never break:
    for what need not be the last word. ``choice``: the level that answers all grip sets where it is
    asked of steps afterwards whether it was enough, and why.
    """

    rigid: Engine
    mortar: Mortar
    tally: Counter[LevelChoice]
    choice: LevelChoice

    @property
    @abstractmethod
    def limits(self) -> ElasticLimits | None:
        """Elastic limits of joints, where they are known."""

    @property
    @abstractmethod
    def unchecked(self) -> str:
        """Why they are not known; empty if they are."""


class FlatEngine(NamedEngine):
    """Base of the engine whose bricks stay in a plane. ``in_space``: the same, free to leave it."""

    in_space: Engine


class OpeningEngine(SerialEngine):
    """Base of the engine whose joints open, slip and break."""
