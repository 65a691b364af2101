"""Claim: dry and without fill seven of the eight tested vaults stand, and one load breaks each.

The vaults are those whose load tests calibrate the springs of Bruun et al. These print stiffnesses
and no load at which a vault fell, so nothing measured is beside these loads. The line load at its
printed place grows until the bricks, rigid and dry, give way. Forces and a motion prove the largest
load from both sides, and a linear program in the line of thrust, which shares nothing with the
proofs, finds the same within 1e-6. The first vault is thinner than a semicircle can be
(Milankovitch 1907: 0.1075 of its radius) and falls by itself. Fill that is counted as weight alone
makes the others bear two to six times as much, and does not hold the first: for that it would have
to press sideways. The stiffness under the load is that of the calibration within 1e-9, by a load of
the scene instead of the compliance operator. The claim fails if any of this does not come out.

Inputs: ``arch_tests.csv`` in ``seqopt/data/paper``. Command: ``python -m
experiments vault_loads [--quick]``.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from experiments.calibration.parts import barrel_vaults as barrel
from experiments.calibration.parts.barrel_vaults import BED, LAWS, Vault, vaults
from experiments.calibration.parts.vault_thrust import UNIT, borne, loaded_vault
from experiments.harness.claim import Claim, Finding, Options
from seqopt import DRY
from seqopt.contact.faces import step_assembly
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.scene import Load
from seqopt.stability._load_factor import load_factor

NAMES = {False: "bare", True: "filled"}
PAIR = (67e9, 81e9)  # N/m³; translational and rotational, about those of the calibration
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


def stiffness_gap(vault: Vault) -> float:
    """Return by how much two routes to a stiffness differ, over it."""
    made = barrel.scene(vault, PAIR[0] * vault.area, PAIR[1] * LAWS[BED](vault))
    at = float(barrel.chain(vault).loads[0])
    x = made.grounds[0].position[0] + at
    i = sum(joint.position[0] <= x for joint in made.joints)
    brick = made.bricks[i]
    place = (x, brick.position[1], brick.position[2])
    load = Load(brick=brick.name, force=(0.0, 0.0, -UNIT), position=place)
    engine = ComplianceEngine(replace(made, loads=(load,), weight_factor=0.0))
    twist = engine.solve(vault.bricks, np.zeros((1, 0), dtype=int), Want.BRICKS).brick_twist[0]
    shift, turn = twist[i].reshape(2, 3)
    drop = -(shift + np.cross(turn, np.subtract(place, brick.position)))[2]
    return abs(UNIT / drop / barrel.load_stiffness(made, at) - 1)


def experiment(options: Options) -> Finding:
    tests = vaults()[1:3] if options.quick else vaults()
    table = pd.DataFrame([loads_of(vault) for vault in tests])
    print(table.to_string(index=False, float_format="%.4g"))
    gap = max(map(stiffness_gap, tests))
    print(f"stiffness by a load of the scene and by the operator: {gap:.1e} apart")
    parts = holds(table) | {"loads of the scene and the operator agree": gap < 1e-9}
    return Finding(parts, tables={"vault_loads": table})


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
