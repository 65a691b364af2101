"""The posture table: which postures reach which node, and what they hit; kept in a folder.

It depends on bricks, robots and the direction of gravity, and on no build order: a posture that
hits a brick is usable as long as that brick does not stand.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from seqopt.scene.scene import Scene
from seqopt.work import Tell

if TYPE_CHECKING:
    from seqopt.arms._tables import PostureTable


def find_postures(
    scene: Scene, cache: Path | str | None = None, progress: Tell | None = None
) -> PostureTable | None:
    """Return the posture table of a scene, computed once; None if no robot has an arm.

    Parameters
    ----------
    scene : Scene
        In any build order.
    cache : pathlib.Path or str, optional
        A folder that keeps the table by content; it is made if it is not there.
    progress : callable, optional
        Called with the progress as a few words.

    Returns
    -------
    PostureTable or None

    Raises
    ------
    ExtraError
        If pinocchio and coal are not installed.
    SceneError
        If a model cannot be read, or a base stands in a brick or in another base.
    FileError
        If the folder cannot be used.

    Warns
    -----
    SceneWarning
        If links of an arm have no shapes for collisions: which, and what is checked instead.
    """
    if not scene.has_arms:
        return None
    from seqopt.arms._tables import known_table  # noqa: PLC0415  # few scenes have arms

    return known_table(scene, cache, progress)
