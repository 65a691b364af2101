"""Whether an assembly stands, with what margins, what fails first, and how much load it bears.

The load factor is the largest multiple of a scene's loads: weights stay as they are, forces on
bricks and wind grow together. Forces that hold prove that a multiple is borne, a mechanism that no
larger one is.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from seqopt._registry import Shown
from seqopt.arrays import Floats, FrozenValue, Vector
from seqopt.contact.assembly import Assembly, step_assembly
from seqopt.contact.mortar import ROUGHEST, Mortar, find_mortar
from seqopt.errors import SceneError
from seqopt.network.network import Network, network_of
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, require_steps
from seqopt.stability.limit_analysis import (
    CAP,
    DIRECTIONS,
    EXACT,
    GAP,
    LARGEST_FORCE,
    Case,
    Claim,
    Compile,
    Proven,
    Prover,
    Sense,
    compile_equilibrium,
    safe_turn,
)
from seqopt.stability.verdict import ASSESSED, Verdict
from seqopt.work import Tell, with_progress

CONES = "cone program"  # what proves a verdict where nothing simpler does
_STILL = 1e-6  # motion slower than this, beside the fastest, is none
_LITTLE = 1e-3  # friction that holds nothing but what is jammed
_FRICTION_STEP = 1e-4  # to which the least one is found
_ENDLESS = (1 - GAP) * CAP  # multiples from which on none is the largest


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Shown, FrozenValue):
    """Verdict and margins of one assembly; a margin that is not proven, or not asked for, is NaN.

    Attributes
    ----------
    verdict : Verdict
        The verdict with the given mortar and payloads.
    proof : str
        What proves the verdict: ``forces`` or a ``motion``, those of an ``earlier`` step, or those
        of a ``cone program``.
    bond : float
        Least strength of a bond, in tension and at the same time in shear, with which it stands at
        the mortar's friction, Pa; inf if none is enough.
    friction : float
        Least coefficient of friction with which it stands at the mortar's bond; inf if none is.
    pull : (8,) float
        Largest sideways acceleration that it survives in each direction, relative to gravity, under
        all loads; NaN if it does not stand.
    tilt : float
        Tilt survived in every direction, rad: a safe bound by forces; NaN if it does not stand.
        Gravity turned by atan(a) mixes no load with gravity and a sideways a, all survived; other
        loads keep their size and direction. It is less than the largest such tilt by what
        `safe_pull` leaves, and for bonds and for grips at their payload by what weighs less once it
        is turned.
    grip : float
        The largest grip force, made as small as equilibrium with the mortar allows, N; inf if no
        payload is enough, 0 if nothing grips, NaN where props only push.
    motion : (B, 6) float
        How it fails: by itself if it does not stand, and otherwise when pulled to the limit in the
        worst direction. Translation (m) and rotation (rad) of the blocks; the largest translation,
        or rotation times lever, is 1 m; zero if unknown.
    first_block, first_contact : str
        The fastest block and the contact that opens fastest in that motion; empty if unknown.
    jammed : bool or None
        Whether it stands only because it is wedged in place: the least friction is enough, by
        contact forces that nothing makes develop. Do not trust that it stands. None if the friction
        is not asked for, or it does not stand.
    claims : mapping of Claim to int
        How the solver ended by its own account, over all cases that were solved.
    unproven : int
        Cases whose answers proved nothing.

    Examples
    --------
    >>> from seqopt.contact.assembly import step_assembly
    >>> from seqopt.contact.mortar import DRY
    >>> from seqopt.network.network import build_network
    >>> from seqopt.scene.scene_file import load_scene
    >>> network = build_network(load_scene("arch25"))
    >>> stability = assess(step_assembly(network, 3, (None, None, None)), DRY)
    >>> stability.verdict.value, stability.first_block, stability.grip
    ('does not stand', '3', 0.0)
    """

    verdict: Verdict
    proof: str
    bond: float = np.nan
    friction: float = np.nan
    pull: Floats = field(default_factory=lambda: np.full(DIRECTIONS, np.nan))
    tilt: float = np.nan
    grip: float = np.nan
    motion: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    first_block: str = ""
    first_contact: str = ""
    jammed: bool | None = None
    claims: Mapping[Claim, int] = field(default_factory=dict)
    unproven: int = 0

    def __repr__(self) -> str:
        tilt = f", survives a tilt of {np.degrees(self.tilt):.3g} degrees"
        margin = tilt if np.isfinite(self.tilt) else ""
        first = f", block {self.first_block} fails first" if self.first_block else ""
        jammed = ", but only jammed" if self.jammed else ""
        return f"<Stability: {self.verdict.value}{jammed}{margin}{first}>"


def assess(
    assembly: Assembly,
    mortar: Mortar,
    up: Vector = (0.0, 0.0, 1.0),
    compiled: Compile = compile_equilibrium,
    margins: Collection[str] = ASSESSED,
) -> Stability:
    """Return verdict and margins of an assembly.

    Parameters
    ----------
    assembly : Assembly
    mortar : Mortar
    up : Vector, optional
        Unit vector against gravity; it is pulled at right angles.
    compiled : callable, optional
        Makes the program to solve; the registered one by default.
    margins : collection of str, optional
        Of `ASSESSED`; those left out are NaN.

    Returns
    -------
    Stability
    """
    prove, growing = Prover(assembly, compiled), bonded(assembly, mortar)
    stand = prove(growing)
    verdict = _verdict_of(stand)
    fixed, stands = growing.fixed(), verdict is Verdict.STANDS
    pulls, worst = safe_turn(prove, fixed, up) if stands and "tilt" in margins else ([], np.nan)
    failure = min(pulls, key=lambda pull: np.nan_to_num(pull.held, nan=CAP), default=stand)
    known = failure.value < CAP if pulls else verdict is Verdict.FALLS
    motion = failure.answer.motion if known else np.zeros((len(assembly.centroid), 6))
    friction = _least_friction(prove, mortar) if "friction" in margins else np.nan
    bond = np.nan
    if "bond" in margins:
        bare = bonded(assembly, Mortar(friction=mortar.friction))
        lacking = stand if bare == growing else prove(bare)
        bond = _amount(lacking.value) * assembly.stress_scale
    grip = np.nan  # also where a grip only pushes
    if "payload" in margins and not assembly.grip_line.any():
        least = replace(fixed, sense=Sense.SMALLEST, payload=(0.0, 1.0))
        grip = _amount(prove(least).value) * assembly.scales[0] if len(assembly.payload) else 0.0
    return Stability(
        verdict=verdict,
        proof=CONES,
        bond=bond,
        friction=friction,
        pull=np.array([pull.held for pull in pulls[:DIRECTIONS]] or [np.nan] * DIRECTIONS),
        tilt=float(np.arctan(worst)),
        grip=grip,
        jammed=_is_jammed(prove, mortar, friction) if "friction" in margins and stands else None,
        claims=dict(prove.claims),
        unproven=prove.unproven,
        **_failure(assembly, motion),
    )


def verdict(assembly: Assembly, mortar: Mortar, compiled: Compile = compile_equilibrium) -> Verdict:
    """Return the verdict of `assess` alone: one case, where margins need about twenty."""
    return _verdict_of(Prover(assembly, compiled)(bonded(assembly, mortar)))


def bonded(assembly: Assembly, mortar: Mortar) -> Case:
    """Return the case of the least bond that a mortar lacks.

    A bond of strength s carries a tension s and, at the same time, a shear stress s; in the terms
    of Mohr and Coulomb its cohesion is s (1 + friction).
    """
    stress = assembly.stress_scale
    return Case(
        sense=Sense.SMALLEST,
        friction=mortar.friction,
        tension=(mortar.tensile_strength / stress, 1.0),
        cohesion=(mortar.cohesion / stress, 1.0 + mortar.friction),
    )


def _verdict_of(stand: Proven) -> Verdict:
    """Return the verdict of a number that must be zero: it falls if its motion says so."""
    if np.isnan(stand.value):
        return Verdict.UNDECIDED
    if stand.bound > EXACT:
        return Verdict.FALLS
    return Verdict.STANDS if stand.value <= EXACT else Verdict.UNDECIDED


def _failure(assembly: Assembly, motion: Floats) -> dict[str, Any]:
    """Return `Stability.motion` of a motion (B, 6), and what is fastest in it; empty if none is."""
    motion = motion / (np.abs(motion).max(initial=0.0) or 1.0)
    speed, block, contact = np.linalg.norm(motion, axis=1), "", ""
    if speed.max(initial=0.0) > 0:
        block = str(assembly.block_name[int(speed.argmax())])
        parting = (assembly.contact_map.T @ motion.ravel()).reshape(-1, 3)
        apart = np.linalg.norm(parting, axis=1)
        if apart.max(initial=0.0) > _STILL:
            contact = assembly.contact_name[int(assembly.contact[int(apart.argmax())])]
    motion = motion / np.repeat([1.0, assembly.scales[1]], 3)
    return {"motion": motion, "first_block": block, "first_contact": contact}


def _least_friction(prove: Prover, mortar: Mortar) -> float:
    """Return the least coefficient of friction with which no bond is lacking, to `_FRICTION_STEP`.

    The lacking bond falls with the friction: a line through two points aims at where none is; else
    the middle is tried. Infinite if `ROUGHEST` is not enough, NaN if nothing is proven.
    """

    def lacking(friction: float) -> float:
        proven = prove(bonded(prove.assembly, replace(mortar, friction=friction)))
        return np.nan if _verdict_of(proven) is Verdict.UNDECIDED else proven.value

    low = (0.0, lacking(0.0))
    if not low[1] > EXACT:
        return max(low[1], 0.0) * 0.0
    tried = {f: lacking(f) for f in (mortar.friction, ROUGHEST)}
    enough = [f for f, lack in tried.items() if lack <= EXACT]
    if not enough:
        return np.nan if np.isnan(list(tried.values())).any() else np.inf
    high, before = enough[0], (0.0, -np.inf)
    while high - low[0] > _FRICTION_STEP:
        middle = 0.5 * (low[0] + high)
        if before[1] > low[1] < np.inf:
            slope = (before[1] - low[1]) / (low[0] - before[0])
            middle = min(middle, low[0] + low[1] / slope + 0.4 * _FRICTION_STEP)
        value = lacking(middle)
        if np.isnan(value):
            return np.nan
        if value <= EXACT:
            high = middle
        else:
            before, low = low, (middle, value)
    return high


def _is_jammed(prove: Prover, mortar: Mortar, least: float) -> bool:
    """Return whether forces prove hardly any friction enough, but far above all loads."""
    if least > _LITTLE or least == 0:
        return False
    assembly, case = prove.assembly, bonded(prove.assembly, mortar)
    proven = prove(replace(case, friction=min(_LITTLE, mortar.friction)))
    total = case.amounts(assembly)[0] + assembly.payload.sum()
    most = proven.answer.contact_force[:, 0].max(initial=0.0) * assembly.scales[0]
    return bool(proven.held <= EXACT and most > LARGEST_FORCE * total)


def _amount(value: float) -> float:
    """Return a proven z, zero where it is no more than what proofs leave open."""
    return 0.0 if value <= EXACT else value


@dataclass(frozen=True, eq=False, repr=False)
class LoadFactor(FrozenValue):
    """The largest multiple of its loads with which a partial structure stands, weights as they are.

    Attributes
    ----------
    factor : float
        Proven on both sides; inf if no multiple makes it fall, 0 if it falls before any load acts
        and no multiple holds it, NaN if nothing is proven, or it stands and no load acts yet.
    bound : float
        What the motion alone proves: no larger multiple is borne.
    unloaded : Verdict
        Whether it stands without its loads.
    load : float
        Sum of the sizes of the forces that act, N; zero if none does yet.
    motion : (B, 6) float
        The mechanism at the factor, as of `seqopt.stability.assessment.Stability`.
    first_block, first_contact : str
        The fastest block and the contact that parts fastest in that motion; empty if unknown.

    Examples
    --------
    >>> import seqopt
    >>> from seqopt.stability import load_factors
    >>> scene = seqopt.load_scene("arch25")
    >>> network = seqopt.build_network(replace(scene, wind=(0.1, 0.0, 0.0)))
    >>> load_factors(network, seqopt.sequential(network)[-1:], seqopt.EPOXY)[0].unloaded.value
    'stands'
    """

    factor: float
    bound: float
    unloaded: Verdict
    load: float
    motion: Floats
    first_block: str
    first_contact: str

    def __repr__(self) -> str:
        first = f", block {self.first_block} fails first" if self.first_block else ""
        return f"<LoadFactor: {self.factor:.6g} times {self.load:.6g} N{first}>"


def load_factor(assembly: Assembly, mortar: Mortar) -> LoadFactor:
    """Return the largest multiple of its applied loads with which an assembly stands."""
    size = float(np.abs(assembly.applied_load).max())  # over the force scale
    force = float(np.linalg.norm(assembly.applied[:, :3], axis=1).sum())
    scaled = replace(assembly, applied=assembly.applied / (size or 1.0))  # so that z is no share
    prove, lacking = Prover(scaled, compile_equilibrium), bonded(assembly, mortar)
    bare = prove(replace(lacking, applied=(0.0, 0.0)))
    unloaded, values = _verdict_of(bare), (np.nan, np.nan)
    motion = np.zeros_like(bare.answer.motion)
    if size:
        found = prove(replace(lacking.fixed(), sense=Sense.LARGEST, applied=(0.0, 1.0)))
        values = found.value, found.bound
        if found.value < _ENDLESS:
            motion = found.answer.motion
    if unloaded is Verdict.FALLS and np.isnan(values[0]):
        helps = bool(size) and float(scaled.applied_load @ bare.answer.motion.ravel()) < 0
        if not helps or found.answer.claim is Claim.INFEASIBLE:
            values, motion = (0.0, np.nan if helps else 0.0), bare.answer.motion
    factor, most = (np.inf if z >= _ENDLESS else z / (size or 1.0) for z in values)
    return LoadFactor(factor, most, unloaded, force, **_failure(assembly, motion))


def load_factors(
    network: Network | Scene,
    steps: Sequence[Step],
    mortar: Mortar | str,
    progress: Tell | None = None,
) -> tuple[LoadFactor, ...]:
    """Return how much load every step bears.

    Parameters
    ----------
    network : Network or Scene
    steps : sequence of Step
    mortar : Mortar or str
        The mortar of all joints, or its name.
    progress : callable, optional
        Called with a `seqopt.work.Stage`, step by step.

    Returns
    -------
    tuple of LoadFactor

    Raises
    ------
    SceneError
        If the scene has neither loads nor wind, or bricks that share a joint do not touch.
    """
    network, mortar = network_of(network), find_mortar(mortar)
    if not network.applied(len(network.inner)).any():
        raise SceneError(
            f"scene {network.scene.name}: no load acts on it; give it loads or wind to learn how "
            "much of them it bears"
        )
    if any(prop.direction for prop in network.scene.props):
        raise SceneError(
            f"scene {network.scene.name}: load factors know no props that only push; leave out "
            "their directions"
        )
    return tuple(
        load_factor(step_assembly(network, step.bricks, step.grips), mortar)
        for step in with_progress("finding load factors", require_steps(steps), progress)
    )
