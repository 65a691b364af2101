"""The engines by name, their recipes, and the provenance of results.

A recipe is enough to make an engine again elsewhere.
"""

from __future__ import annotations

import platform
import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from seqopt._registry import required
from seqopt.contact.mortar import EPOXY, ElasticLimits, Mortar, find_elastic_limits, find_mortar
from seqopt.engines.interface import (
    Engine,
    Fields,
    NamedEngine,
    Want,
    _merge_sets,
    keep_wanted,
    select_sets,
)
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import ProblemError, SceneError
from seqopt.network.network import Network, build_network, network_of
from seqopt.scene.scene import Scene

REASONS = {
    "compliance": "the simplest, until a joint leaves its elastic limits",
    "discrete": "a joint would leave its elastic limits",
}  # for levels of detail, by engine, cheapest first


class AutoEngine(NamedEngine):
    """Computes every grip set at the cheapest level whose condition it meets.

    ``mortar``: of joints; ``tally``: how many grip sets of all calls each engine answered.
    """

    def __init__(self, network: Network | Scene, mortar: Mortar = EPOXY) -> None:
        super().__init__(network)
        self.mortar, self.tally = mortar, Counter[str]()

    @cached_property
    def rigid(self) -> ComplianceEngine:
        """Bricks on springs that never break."""
        return ComplianceEngine(self.network)

    @cached_property
    def _discrete(self) -> Engine:
        return ENGINES["discrete"](self.network, mortar=self.mortar)

    @cached_property
    def _limits(self) -> tuple[ElasticLimits | None, str]:
        try:
            return find_elastic_limits(self.network, self.mortar), ""
        except SceneError as error:
            return None, f"elastic limits are not checked: {error}"

    @property
    def limits(self) -> ElasticLimits | None:
        """Elastic limits of joints, where they are known."""
        return self._limits[0]

    @property
    def unchecked(self) -> str:
        """Why they are not known; empty if they are."""
        return self._limits[1]

    def solve(
        self,
        bricks: int,
        grips: ArrayLike,
        want: Want = Want.RESPONSES,
        moved: ArrayLike | None = None,
    ) -> Fields:
        """Return the fields of a partial structure for grip sets (S, r)."""
        asked = want if self.limits is None else want | Want.JOINTS
        fields = self.rigid.solve(bricks, grips, asked, moved)
        beyond = np.zeros(len(fields.grip_force), dtype=bool)
        if self.limits is not None:
            beyond = self.limits.exceeded(fields.joint_wrench)
        if beyond.any():
            sets = np.asarray(grips)[beyond]
            far = None if moved is None else np.asarray(moved, dtype=float)[beyond]
            found = self._discrete.solve(bricks, sets, asked, far)
            fields = _merge_sets(beyond, keep_wanted(found, asked), select_sets(fields, ~beyond))
        levels = zip(REASONS, (~beyond, beyond), strict=True)
        self.answered, self.corrected = self.answered + len(beyond), self.rigid.corrected
        self.tally.update({level: int(mine.sum()) for level, mine in levels if mine.any()})
        return keep_wanted(fields, want)


@dataclass(frozen=True)
class Recipe:
    """An engine's name, scene and options, as `seqopt.engines.registry.make_engine` takes them.

    ``options``: values whose representation says all of them; ``simplest``: whether of `simplest`.
    """

    engine: str
    scene: Scene
    options: Mapping[str, object] = field(default_factory=dict)
    simplest: bool = False

    def __reduce__(self) -> tuple[object, ...]:
        return Recipe, (self.engine, self.scene, dict(self.options), self.simplest)

    def make(self, network: Network | Scene | None = None) -> Engine:
        """Return the engine, or one with the same settings of another scene or network."""
        made = make_engine(self.engine, self.scene if network is None else network, **self.options)  # type: ignore[arg-type]
        return simplest(made) if self.simplest else made

    @cached_property
    def name(self) -> str:
        """The name of the engine that answers grip sets."""
        return USUAL if self.simplest else self.engine

    @cached_property
    def network(self) -> Network:
        """The network of the scene; it is not sent along."""
        return build_network(self.scene)


def recipe_of(engine: object) -> Recipe | None:
    """Return the recipe of an engine made by name, or the ``recipe`` of one of your own."""
    found = getattr(engine, "recipe", None)
    return found if isinstance(found, Recipe) else None


def engine_for(engine: Engine, scene: Scene) -> Engine:
    """Return an engine of the same kind and settings for another scene; arms keep their postures.

    Raises `ProblemError` if the engine was not made by name.
    """
    recipe = recipe_of(engine)
    if recipe is None:
        raise ProblemError(
            f"engine {type(engine).__name__}: scenarios need engines of their own; take "
            "one of seqopt.make_engine"
        )
    nominal = engine.network.scene
    if nominal.grip_kinds.arms.any():
        scene = required("hold_alike")(nominal, scene)
    return replace(recipe, scene=scene).make()


def _frame(network: Network | Scene) -> Engine:
    from seqopt.engines.frame import FrameEngine  # noqa: PLC0415  # SciPy's sparse solvers load long

    return FrameEngine(network)


def _discrete(network: Network | Scene, **options: Any) -> Engine:
    from seqopt.engines.discrete import DiscreteEngine  # noqa: PLC0415  # as does the frame

    return DiscreteEngine(network, **options)


ENGINES: dict[str, Callable[..., Engine]] = {
    "auto": AutoEngine,
    "compliance": ComplianceEngine,
    "frame": _frame,
    "discrete": _discrete,
}
USUAL = "compliance"  # the engine of what is only drawn, or compared with itself; the simplest
DEFAULT = "auto"  # the engine where none is asked for
LIMITED = ("auto", "discrete")  # engines whose joints hold what mortar does


def make_engine(name: str, network: Network | Scene, mortar: Mortar | str | None = None) -> Engine:
    """Return an engine by name.

    Parameters
    ----------
    name : str
        One of `ENGINES`.
    network : Network or Scene
    mortar : Mortar or str, optional
        The strength of the joints, for the engines that need it; by default the epoxy.

    Returns
    -------
    Engine

    Raises
    ------
    SceneError
        If there is no such engine, a mortar would change nothing in it, or the engine cannot
        model the scene.

    Examples
    --------
    >>> from seqopt.network.network import build_network
    >>> from seqopt.scene.scene_file import load_scene
    >>> engine = make_engine("compliance", build_network(load_scene("arch25")))
    >>> engine.solve(1, [[1]]).grip_force.shape
    (1, 1, 3)
    """
    if name not in ENGINES:
        raise SceneError(f"engine {name} does not exist; known are {', '.join(ENGINES)}")
    network, options = network_of(network), dict[str, object]()
    _ = network.scene.held_postures  # goes along with it to other processes
    if mortar is not None and name in LIMITED:
        options["mortar"] = find_mortar(mortar)
    elif mortar is not None:
        raise SceneError(
            f"engine {name}: its joints never fail, so a mortar changes nothing; "
            f"use the engine {' or '.join(LIMITED)}"
        )
    engine: Any = ENGINES[name](network, **options)
    engine.recipe = Recipe(name, network.scene, options)
    made: Engine = engine
    return made


def find_engine(network: Network, engine: str | None, mortar: Mortar | str | None) -> Engine:
    """Return an engine by name; by default the simplest level of `DEFAULT` that fits the scene.

    With a mortar of its own an engine is asked where joints open: set by set.
    """
    found = make_engine(engine or DEFAULT, network, mortar)
    return simplest(found) if engine is None and mortar is None else found


def engine_mortar(
    engine: str | None, mortar: Mortar | str | None, *, verdicts: bool
) -> Mortar | None:
    """Return the mortar that an engine is asked with; that of ``verdicts`` may be theirs alone."""
    own = None if mortar is None else find_mortar(mortar)
    return None if verdicts and engine not in LIMITED else own


def simplest(engine: Engine) -> Engine:
    """Return the engine that answers all grip sets of a problem: of `auto` the level of its scene.

    Whether rigid bricks were enough is to be asked of the steps that are chosen.
    """
    if not isinstance(engine, AutoEngine):
        return engine
    found: Any = make_engine(USUAL, engine.network)
    found.chooser, recipe = engine, recipe_of(engine)
    if recipe is not None:
        found.recipe = replace(recipe, simplest=True)
    made: Engine = found
    return made


def _chooser_of(engine: Engine) -> AutoEngine | None:
    """Return the engine that chooses for every grip set, of which this one is `simplest`."""
    found = getattr(engine, "chooser", None)
    return found if isinstance(found, AutoEngine) else None


def provenance(engine: Engine) -> dict[str, object]:
    """Return the entries of a summary about packages and the engine, after it computed.

    Of an automatic one with the ``level`` that it took for all grip sets, or the ``levels`` for how
    many ``sets``, and why each.
    """
    recipe = recipe_of(engine)
    facts: dict[str, object] = {"name": type(engine).__name__, "reason": "given as an object"}
    if recipe is not None:
        why = "the default" if recipe.engine == DEFAULT else "asked for by name"
        facts = {"name": recipe.engine, "reason": why}
        facts |= {name: asdict(value) for name, value in recipe.options.items()}  # type: ignore[call-overload]
    if _chooser_of(engine) is not None:
        facts["level"] = {"engine": USUAL, "reason": REASONS[USUAL]}
    elif isinstance(engine, AutoEngine):
        facts["levels"] = [
            {"engine": level, "sets": sets, "reason": REASONS[level]}
            for level, sets in engine.tally.items()
        ]
        facts["unchecked"] = engine.unchecked or None
    return {"engine": facts, "versions": dict(versions())}


@cache
def versions() -> Mapping[str, str]:
    """Return the versions of Python, of seqopt and of the packages that it needs, by name."""
    lines = (line for line in requires("seqopt") or () if "extra ==" not in line)
    known = {"python": platform.python_version()}
    for name in ("seqopt", *(re.split(r"[^\w.-]", line)[0] for line in lines)):
        try:
            known[name] = version(name)
        except PackageNotFoundError:
            known[name] = "not installed"
    return known


def level_notes(named: str | None, engine: Engine) -> tuple[str, ...]:
    """Describe the levels an ``auto`` engine took, and why; of one not named only discrete."""
    if _chooser_of(engine) is not None:
        return (f"engine: {USUAL}: {REASONS[USUAL]}",) if named else ()
    if not isinstance(engine, AutoEngine):
        return ()
    lines = [
        f"engine: {level} for {sets} grip sets: {REASONS[level]}"
        for level, sets in engine.tally.items()
        if named or level == "discrete"
    ]
    return (*lines, *([f"engine: {engine.unchecked}"] if engine.unchecked else []))
