"""How much a chain of bricks bears, by its line of thrust: four unknowns and no solver of seqopt.

What one joint transmits and the weights before another say what that transmits. Rigid bricks
without bond bear a load if thrust at every joint presses within its depth and slides within the
cone of friction: a linear program in the thrust at the first joint and the load (Heyman 1966,
Livesley 1978).
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import linprog

from experiments.calibration.parts.barrel_vaults import Vault
from seqopt import Scene
from seqopt.arrays import Floats
from seqopt.network.build import build_network
from seqopt.scene import Load
from seqopt.scene.library import barrel_vault
from seqopt.study.published import printed

UNIT = 1000.0  # N; the load of which multiples are sought


def loaded_vault(vault: Vault, *, filled: bool) -> Scene:
    """Return a vault with a line load where it was tested, bare or under the weight of its fill.

    Fill up to its height over the crown weighs on the brick below it, as if that were heavier.
    """
    scene = barrel_vault(vault.test)
    springs = build_network(scene).springs
    x = np.sort(springs.position[:, 0])
    at = 0.5 * (x[0] + x[-1] - vault.span) + vault.load_at
    brick = scene.bricks[int(np.searchsorted(x, at)) - 1]
    place = (at, brick.position[1], brick.position[2])
    load = Load(brick=brick.name, force=(0.0, 0.0, -UNIT), position=place)
    scene = replace(scene, loads=(load,))
    if not filled:
        return scene
    density = printed("arch_tests").set_index("test").loc[vault.test, "gamma_f_kg_m3"]
    tops = np.array([b.position[2] + 0.5 * vault.thickness * b.frame[2, 2] for b in scene.bricks])
    over = vault.width * np.diff(x) * (tops.max() + vault.fill - tops) * density
    heavy = [
        replace(b, density=b.density + fill / b.volume)
        for b, fill in zip(scene.bricks, over.tolist(), strict=True)
    ]
    return replace(scene, bricks=tuple(heavy))


def borne(scene: Scene, friction: float) -> float:
    """Return the largest multiple of a vault's load; NaN if it does not stand with any."""
    springs = build_network(scene).springs
    order = np.argsort(springs.position[:, 0])
    joint, axis = springs.position[order][:, [0, 2]], springs.axes[order][:, 0][:, [0, 2]]
    axis = axis * np.sign(axis @ (joint[-1] - joint[0]))[:, None]
    thrust = np.zeros((len(joint), 3, 5))  # fx, fz and moment about the origin, of all unknowns
    thrust[0, :, :3] = np.eye(3)
    for i, brick in enumerate(scene.bricks):
        x, weight = brick.position[0], -9.81 * brick.mass
        thrust[i + 1] = thrust[i]
        thrust[i + 1, :, 4] += [0.0, weight, x * weight]
        for load in scene.loads:
            if load.brick == brick.name and load.position is not None:
                force = load.force[2]
                thrust[i + 1, :, 3] += [0.0, force, load.position[0] * force]
    side = np.stack([-axis[:, 1], axis[:, 0]], axis=1)
    low, high = _depth(scene, joint, side)
    force = thrust[:, :2]
    turn = joint[:, 0, None] * force[:, 1] - joint[:, 1, None] * force[:, 0]
    moment = thrust[:, 2] - turn
    press = np.einsum("ji,jik->jk", axis, force)
    slide = np.einsum("ji,jik->jk", side, force)
    parts = [-moment - high * press, moment + low * press]  # by how much it leaves the joint
    parts += [sign * slide - friction * press for sign in (1, -1)]
    rows = np.concatenate(parts)
    bounds = [(None, None)] * 3 + [(0.0, None)]
    found = linprog([0, 0, 0, -1], rows[:, :4], -rows[:, 4], bounds=bounds)
    return float(-found.fun) if found.status == 0 else float("nan")


def _depth(scene: Scene, joint: Floats, side: Floats) -> tuple[Floats, Floats]:
    """Return from where to where (J, 1) bricks touch at joints (J, 2), along their sides (J, 2)."""
    low, high = np.full(len(joint), -np.inf), np.full(len(joint), np.inf)
    for i, brick in enumerate(scene.bricks):
        out, up = (0.5 * brick.dimensions[k] * brick.frame[k, [0, 2]] for k in (0, 2))
        for j, sign in ((i, -1.0), (i + 1, 1.0)):
            face = np.array(brick.position)[[0, 2]] + sign * out - joint[j]
            ends = sorted(((face - up) @ side[j], (face + up) @ side[j]))
            low[j], high[j] = max(low[j], ends[0]), min(high[j], ends[1])
    return low[:, None], high[:, None]
