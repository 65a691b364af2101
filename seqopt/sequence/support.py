"""The parts of a partial structure that must be held because no joint ties them to the ground.

A placed brick is supported if a path of joints that act leads from it to a ground end. Bricks that
no such path reaches form islands; somebody must hold each of them at every step.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from seqopt.arrays import Ints
from seqopt.errors import StepError
from seqopt.network.network import GROUND, Network
from seqopt.sequence.schedule import Move, OpenGrip, OpenStep
from seqopt.sequence.steps import Step

_Island = frozenset[int]


def acting_bodies(network: Network, bricks: int) -> Ints:
    """Return which bricks the springs of a partial structure join.

    Result (s, 2): indices in build order; `seqopt.network.network.GROUND` first for a ground end. A
    spring without any stiffness joins nothing.
    """
    springs = network.springs
    acting = (springs.since <= bricks) & springs.stiffness.any(axis=1)
    return np.asarray(springs.bodies[acting])


def islands(network: Network, bricks: int) -> tuple[_Island, ...]:
    """Return the parts of a partial structure that no joint ties to a ground end.

    Result: names of the bricks of every island, in build order of their first bricks.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import seqopt
    >>> scene = seqopt.arch_scene(seqopt.ArchShape(pitch=(1.2, 0.4, -0.4, -1.2), pattern="V"))
    >>> middle_first = seqopt.build_network(replace(scene, build_order=(2, 3, 1, 4)))
    >>> islands(middle_first, 2), islands(middle_first, 3)
    ((frozenset({2, 3}),), ())
    """
    pairs = acting_bodies(network, bricks) + 1  # the ground is body 0
    ones = np.ones(len(pairs), dtype=bool)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(bricks + 1, bricks + 1))
    count, part = connected_components(graph, directed=False)
    if count == 1:
        return ()
    found: dict[int, set[int]] = {}
    for brick, label in zip(network.scene.placed, part[1:], strict=False):
        if label != part[0]:
            found.setdefault(int(label), set()).add(brick.name)
    return tuple(frozenset(names) for names in found.values())


def check_support(
    network: Network, steps: Sequence[Step] | Sequence[OpenStep], moves: Sequence[Move] = ()
) -> None:
    """Require that every island is held at every step, whatever is chosen for open grips.

    ``steps``: of a sequence or a schedule; ``moves``: of the schedule, with their candidates.
    """
    if _always_tied(network):
        return
    scene = network.scene
    known: dict[int, tuple[_Island, ...]] = {}
    for step in steps:
        if step.bricks not in known:
            known[step.bricks] = islands(network, step.bricks)
        holds = []
        for grip in step.grips if known[step.bricks] else ():
            nodes = moves[grip.move].candidates if isinstance(grip, OpenGrip) else (grip,)
            holds.append({scene.brick_of_node[node].name for node in nodes if node is not None})
        for island in known[step.bricks]:
            if not any(names and names <= island for names in holds):
                raise StepError(
                    f"step {step.number} ({step.kind.value}): {_hang(island)} free: no joint "
                    "connects to the ground and no robot is sure to hold on; place it later, or "
                    "write a schedule in which one more robot holds it"
                )


def _always_tied(network: Network) -> bool:
    """Return whether every brick is tied to one that is supported as soon as it is placed."""
    springs = network.springs
    acting = springs.stiffness.any(axis=1)
    supported = {GROUND}
    for (first, second), since in zip(
        springs.bodies[acting].tolist(), springs.since[acting].tolist(), strict=True
    ):
        if first in supported and since == second + 1:
            supported.add(second)
    return len(supported) == 1 + len(network.scene.placed)


def _hang(names: Iterable[int]) -> str:
    """Return the subject and the verb."""
    listed = ", ".join(map(str, sorted(names)))
    return f"bricks {listed} hang" if "," in listed else f"brick {listed} hangs"
