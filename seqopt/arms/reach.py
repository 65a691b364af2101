"""The posture table of a scene, computed once, or taken from a folder."""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path

from seqopt.arms._reached import Site
from seqopt.arms._stored import stored_table
from seqopt.arms.table import PostureTable, _compute_table, _with_compliance
from seqopt.scene.arm import Arm
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
    compute = partial(_compute_table, site, progress or (lambda _: None))
    if cache is not None and Path(cache) not in known:
        known[Path(cache)] = stored_table(Path(cache), site, lambda: known.get(None) or compute())
        known.setdefault(None, known[Path(cache)])
    if None not in known:
        known[None] = compute()
    arms = tuple((robot.name, robot.arm) for robot in scene.robots if robot.arm is not None)
    if any(arm.joint_stiffness for _, arm in arms) and arms not in known:
        known[arms] = _with_compliance(known[None], arms)
    return known.get(arms, known[None])


_Arms = tuple[tuple[str, Arm], ...]


@lru_cache(maxsize=_SITES)
def _known(site: Site) -> dict[Path | _Arms | None, PostureTable]:  # noqa: ARG001  # kept by site
    """Return the table of a site, if it is known, under the folders and soft arms that have it."""
    return {}
