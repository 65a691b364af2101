"""Forces on bricks beside their weight: a load test, a worker, a tie."""

from __future__ import annotations

from dataclasses import dataclass

from seqopt.arrays import Terse, Vector
from seqopt.scene._checks import check, settle, unless_none, vector, whole


@dataclass(frozen=True, kw_only=True, repr=False)
class Load(Terse):
    """A force on a brick.

    Parameters
    ----------
    brick : int
        Name of the brick.
    force : Vector
        N, in the scene's axes.
    position : Vector, optional
        Where it acts, m; the brick's centroid by default.
    since : int, optional
        Name of the brick with whose placing it begins to act, if that is placed later than
        ``brick``; by default it acts as soon as its own brick is placed.

    Raises
    ------
    SceneError
        If a value is not finite.

    Examples
    --------
    >>> Load(brick=13, force=(0.0, 0.0, -800.0), since=25)
    Load(brick=13, force=(0, 0, -800), since=25)
    """

    brick: int
    force: Vector
    position: Vector | None = None
    since: int | None = None

    def __post_init__(self) -> None:
        settle(self, brick=whole("load: brick", self.brick))
        since, position = unless_none(whole), unless_none(vector)
        check(self, self.label, force=vector, position=position, since=since)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"load on brick {self.brick}"

    @property
    def starts_with(self) -> int:
        """Name of the brick with whose placing it acts, unless its own is placed later."""
        return self.brick if self.since is None else self.since
