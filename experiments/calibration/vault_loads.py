"""Claim: dry and without fill seven of the eight tested vaults stand, and one load breaks each.

The vaults are those whose load tests calibrate the springs of Bruun et al. These print stiffnesses
and no load at which a vault fell, so nothing measured is beside these loads. The line load at its
printed place grows until the bricks, rigid and dry, give way. Forces and a motion prove the largest
load from both sides, and a linear program in the line of thrust, which shares nothing with the
proofs, finds the same within 1e-6. The first vault is thinner than a semicircle can be
(Milankovitch 1907: 0.1075 of its radius) and falls by itself. Fill that is counted as weight alone
makes the others bear two to six times as much, and does not hold the first: for that it would have
to press sideways. The claim fails if any of this does not come out.

What one joint transmits and the weights before another say what that transmits. Rigid bricks
without bond bear a load if thrust at every joint presses within its depth and slides within the
cone of friction: a linear program in the thrust at the first joint and the load (Heyman 1966,
Livesley 1978).

Inputs: ``arch_tests.csv`` in ``seqopt/data/paper``.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.optimize import linprog

from experiments.calibration.parts.barrel_vaults import Vault, vaults
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.scenes import barrel_vault
from seqopt import DRY, Scene
from seqopt.arrays import Floats
from seqopt.contact.assembly import step_assembly
from seqopt.network.network import build_network
from seqopt.scene import Load
from seqopt.stability.assessment import load_factor
from seqopt.study import printed

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


NAMES = {False: "bare", True: "filled"}
NEAR = 1e-6


def loads_of(vault: Vault) -> dict[str, float]:
    """Return what a vault weighs and bears, bare and filled, kN; NaN where it falls by itself."""
    row: dict[str, float] = {"test": vault.test, "bricks": vault.bricks}
    for filled, name in NAMES.items():
        scene = loaded_vault(vault, filled=filled)
        network = build_network(scene)
        found = load_factor(step_assembly(network, vault.bricks, (None,) * 3), DRY)
        row[f"{name}_weight"] = -float(network.weight[:, 2].sum()) / UNIT
        row |= {name: found.factor, f"{name}_bound": found.bound}
        row[f"{name}_thrust"] = borne(scene, DRY.friction)
    return row


def experiment(options: Options) -> Finding:
    tests = vaults()[1:3] if options.quick else vaults()
    table = pd.DataFrame([loads_of(vault) for vault in tests])
    print(table.to_string(index=False, float_format="%.4g"))
    return Finding(holds(table), tables={"vault_loads": table})


def holds(table: pd.DataFrame) -> dict[str, bool]:
    """Return whether each part of the claim holds."""
    other = table[table["test"] != 1]
    first = table.loc[table["test"] == 1, ["bare", "bare_thrust", "filled", "filled_thrust"]]
    apart = [
        (table[f"{name}{by}"] / table[name] - 1).abs().max()
        for name in NAMES.values()
        for by in ("_bound", "_thrust")
    ]
    return {
        "all but the first stand without fill": bool((other["bare"] > 0).all()),
        "the first does not, nor with fill": bool(first.isna().all(axis=None)),
        "motions and lines of thrust say the same": max(apart) < NEAR,
        "fill helps them": bool((other["filled"] / other["bare"]).between(2, 6).all()),
    }


CLAIM = Claim(experiment, quick="two vaults", digits=8)
