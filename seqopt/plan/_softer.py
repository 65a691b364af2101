"""Remedies of exceeded payloads: a larger payload, or more compliant grips.

Rigid grips keep nodes in place against every movement of the structure, with forces that may be
many times its weight. Then softer grips, if any suffice, are the remedy, and not a larger payload.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from seqopt.engines.interface import Engine
from seqopt.engines.registry import engine_for, recipe_of
from seqopt.network.network import Network
from seqopt.problem.requirements import Excess, overloads
from seqopt.responses.quantities import _payload_text, _plain
from seqopt.responses.table import analyze
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

STIFFNESSES = (1e8, 1e7, 1e6, 1e5, 1e4, 1e3)  # of grips, N/m, the stiffest that helps first


def whole_load(network: Network) -> float:
    """Return the sum of the sizes of all weights, loads and wind, N: the most any robot carries."""
    applied = network.applied(len(network.inner))[:, :3]
    return float(np.linalg.norm(np.concatenate([network.weight, applied]), axis=1).sum())


def _payload_advice(engine: Engine, steps: Sequence[Step], over: Sequence[Excess]) -> str:
    """Describe remedies of the exceeded payloads of a plan, as of `overloads`."""
    network = engine.network
    held = max((each.largest for each in over if each.brick is None), default=0.0)
    if held <= whole_load(network):
        least = _payload_text(max(each.largest for each in over))
        how = f"--payload {least}, or payload of its robots in the scene file"
        return f"payload of {least} N is enough for this plan: {how}"

    def kept(scene: Scene) -> bool:
        found = overloads(scene, analyze(engine_for(engine, scene), steps))
        return all(each.brick is not None for each in found)  # what is carried stays as heavy

    still = " that hold nodes in place while the ground moves" * ground_moves(network.scene)
    why = f"stiff grips{still}"
    what = f"{held:,.0f} N, {_plain(held / whole_load(network), 3)} times all weights and loads,"
    helps = softer_grips(engine, kept)
    return f"no payload helps: {what} come of {why}; {f'{helps} are enough' if helps else HARD}"


HARD = "softer grips were not found to help; ground that moves less, or softer supports, may"


def ground_moves(scene: Scene) -> bool:
    """Return whether any ground end has a movement."""
    return any(any(ground.movement or ()) for ground in scene.grounds)


def softer_grips(engine: Engine, exists: Callable[[Scene], bool]) -> str:
    """Describe the stiffest sufficient grips below those of the scene; empty if there are none."""
    scene = engine.network.scene
    own = [float(np.min(robot.stiffness)) for robot in scene.robots if robot.stiffness]
    if recipe_of(engine) is None or scene.has_arms:
        return ""
    for stiffness in (each for each in STIFFNESSES if each < min(own, default=np.inf)):
        if exists(scene.with_grips(stiffness)):
            said = f"{stiffness:.0e}".replace("e+0", "e")
            return f"grips of {said} N/m (--grips {said})"
    return ""
