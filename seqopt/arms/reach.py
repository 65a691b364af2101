"""The posture table of a scene, computed once, or taken from a folder."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from seqopt.arms._reached import Site
from seqopt.arms._stored import stored_table
from seqopt.arms.table import PostureTable, _compute_table
from seqopt.scene.scene import Scene
from seqopt.work.progress import Tell

_SITES = 16  # of which tables are kept, the last ones that were asked for


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
        Told in a few words how far it is.

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
    """
    if not scene.has_arms:
        return None
    site = Site.of(scene)
    known = _known(site)
    if "table" not in known:
        tell = progress or (lambda _: None)
        if cache is None:
            known["table"] = _compute_table(site, tell)
        else:
            known["table"] = stored_table(Path(cache), site, tell)
    return known["table"]


@lru_cache(maxsize=_SITES)
def _known(site: Site) -> dict[str, PostureTable]:  # noqa: ARG001  # what it holds is kept by site
    return {}
