"""How much load a step bears: the largest multiple of a scene's loads with which it stands.

Weights stay as they are; forces on bricks and wind grow together. Forces that hold prove that a
multiple is borne, a mechanism that no larger one is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from seqopt.arrays import Floats, FrozenValue
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.errors import SceneError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, require_steps
from seqopt.stability.assessment import Verdict, _first_to_fail, _verdict_of, bonded
from seqopt.stability.limit_analysis import CAP, GAP, Claim, Prover, Sense, compile_equilibrium
from seqopt.work.progress import Tell, with_progress

_ENDLESS = (1 - GAP) * CAP  # multiples from which on none is the largest


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
    motion = motion / (np.abs(motion).max() or 1.0)
    first = _first_to_fail(assembly, motion)
    motion = motion / np.repeat([1.0, assembly.scales[1]], 3)
    factor, most = (np.inf if z >= _ENDLESS else z / (size or 1.0) for z in values)
    return LoadFactor(factor, most, unloaded, force, motion, *first)


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
