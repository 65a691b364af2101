"""Where a free schedule starts from: its states in a scene, if they can be numbered."""

from __future__ import annotations

from collections.abc import Mapping

from seqopt.errors import StepError
from seqopt.network.network import Network
from seqopt.sequence.free_rules import FreeRules
from seqopt.sequence.free_space import FreeSpace
from seqopt.sequence.free_team import sort_robots


def free_space(
    network: Network,
    rules: FreeRules,
    caps: Mapping[str, float] | None = None,
    *,
    parks: bool = False,
) -> FreeSpace:
    """Return the states of a free schedule in a scene.

    Parameters
    ----------
    network : Network
    rules : FreeRules
    caps : mapping of str to float, optional
        Largest force of a robot's grip beside its payload, by its name, N.
    parks : bool, optional
        Whether free robots stay where they were, for their travel.

    Raises
    ------
    StepError
        If robots do not fit the rules, or states cannot be numbered.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> space = free_space(network, FreeRules())
    >>> space.places(0, space.start()).states.tolist()  # node 0 of its first brick is blocked
    [[2, 0, 0], [0, 2, 0], [0, 0, 2]]
    """
    space = FreeSpace(network, rules, sort_robots(network, rules, caps), parks)
    base = 1 + (2 if parks else 1) * 2 * space.bricks
    if base**space.robots * (1 + (rules.regrips or 0)) >= 2**62:
        raise StepError(
            f"scene {network.scene.name}: {space.bricks} bricks and {space.robots} robots have "
            "more states than can be numbered; let fewer robots take part"
        )
    return space
