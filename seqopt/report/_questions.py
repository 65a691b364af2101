"""All ways to build a scene side by side, and pages, of scenes and plans by their names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from seqopt._files import Page
from seqopt.engines.interface import Engine
from seqopt.engines.registry import engine_mortar, find_engine
from seqopt.errors import ProblemError
from seqopt.network.network import build_network
from seqopt.plan.build import ShownBuild
from seqopt.problem.criteria import Criterion
from seqopt.questions import Built, find_build
from seqopt.report._pages import folder_page, plan_page
from seqopt.report._regret._measure import check_reference
from seqopt.report.comparison import Comparison
from seqopt.report.comparison import compare as compare_builds
from seqopt.scene.scene import Scene, find_postures
from seqopt.scene.scene_file import find_scene
from seqopt.stability.failure_map import BuildProver, find_prover
from seqopt.study import find_criterion
from seqopt.work import Tell
from seqopt.workflow import DEFAULTS


def compare(  # noqa: PLR0913  # every question is a word of its own
    scene: Scene | Engine | Path | str,
    criterion: Criterion | str | None = None,
    *,
    robots: int | Sequence[str] | None = None,
    engine: str | None = None,
    mortar: str | None = None,
    stability: bool = True,
    cache: Path | str | None = None,
    progress: Tell | None = None,
    speed: Annotated[float, ("value", "SECONDS"), ("const", "60")] = 0.0,
    reference: Annotated[str, ("value", "ENGINE")] = "",
    prover: BuildProver | None = None,
) -> Comparison:
    """Build a scene in every way that seqopt knows, on paper, and show all side by side.

    Parameters
    ----------
    scene, criterion, robots, engine, mortar, stability, cache, progress : optional
        As of `optimize`; an engine stands for its scene.
    speed : float, optional
        Also chart speed against regret: every engine, schedule and formulation, all within so many
        seconds together (60), each plan valued in the most detailed model that there is data for.
    reference : str, optional
        With ``speed``: the engine that values plans (compliance; with ``mortar`` every step has to
        stand, too; discrete lets joints open).
    prover : BuildProver, optional
        What has proven verdicts before.

    Returns
    -------
    Comparison

    Raises
    ------
    SeqoptError
        If the scene cannot be built in any way, or something that is asked does not exist.

    Examples
    --------
    >>> found = compare("wall:columns=2,courses=2", "worst-ratio", stability=False)
    >>> float(found.table.loc["sequential", "F_rob"].round(1))  # N
    37.3
    """
    if reference and not speed:
        raise ProblemError("reference: it values the plans of --speed; give --speed 60 with it")
    check_reference(reference)
    own = own_engine(scene, engine, mortar, robots=robots, stability=stability)
    find_postures(own.network.scene, cache, progress)
    costs = find_criterion(criterion or DEFAULTS["any other"][0])
    tell = progress or (lambda _: None)
    named = () if robots is None or isinstance(robots, int) else robots
    proven = prover or find_prover(own.network, mortar, progress, asks=stability)
    joints = engine_mortar(None, mortar, verdicts=False)
    return compare_builds(own, costs, tell, named, proven, speed, reference, joints)


def own_engine(
    scene: Scene | Engine | Path | str,
    engine: str | None = None,
    mortar: str | None = None,
    *,
    robots: int | Sequence[str] | None = None,
    stability: bool = True,
) -> Engine:
    """Return the engine of a scene; one that is given stays. ``mortar`` may be verdicts' alone."""
    if not isinstance(scene, Scene | Path | str):
        return scene
    scene = find_scene(scene, robots=robots)
    own = engine_mortar(engine, mortar, verdicts=stability)
    return find_engine(build_network(scene), engine, own)


def report(
    folder: Built,
    scene: Scene | Engine | Path | str | None = None,
    *,
    engine: str | None = None,
    mortar: str | None = None,
    stability: bool = True,
    cache: Path | str | None = None,
    progress: Tell | None = None,
) -> Page:
    """Return a page with a step viewer of a plan, or of the plans in a folder.

    Parameters
    ----------
    folder : Plan, GivenSequence, Scene, str or pathlib.Path
        Folder that holds plans as CSV; in place of it a scene, whose usual steps are shown.
    scene : Scene, str or pathlib.Path, optional
        That of the plans, if the folder has no scene.json; or the engine that has it.
    engine, mortar, stability, cache, progress : optional
        As of `optimize`.

    Returns
    -------
    Page
        A notebook shows it; ``save("report.html")`` writes it, ``open()`` shows it in a browser.

    Raises
    ------
    SeqoptError
        If there is no plan, or none for the scene.

    Examples
    --------
    >>> report("chain:bricks=6", stability=False)
    <Page of 0.7 MB: save('report.html') writes it, open() shows it>
    """
    place = None if isinstance(folder, Scene | ShownBuild) else Path(folder)
    if place is None or not place.is_dir():
        own = engine_mortar(engine, mortar, verdicts=stability)
        build = find_build(folder, None, engine, mortar=own, cache=cache, progress=progress)
        prover = find_prover(build.engine.network, mortar, progress, asks=stability)
        return Page(plan_page(build, prover))
    beside = place / "scene.json"
    named = beside if beside.is_file() and scene is None else scene or "arch25"
    computed = own_engine(named, engine, mortar, stability=stability)
    prover = find_prover(computed.network, mortar, progress, asks=stability)
    return Page(folder_page(computed, place, prover))
