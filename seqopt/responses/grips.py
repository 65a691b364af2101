"""The grips of a build as a table: who holds what, from when to when, and with which force."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from seqopt.responses.table import force_column
from seqopt.scene.scene import Scene
from seqopt.sequence.holds import Hold, holds
from seqopt.sequence.steps import Step


def grips_table(scene: Scene, steps: Sequence[Step], responses: pd.DataFrame) -> pd.DataFrame:
    """Return every grip of a build, for as long as it lasts.

    Parameters
    ----------
    scene : Scene
    steps : sequence of Step
    responses : pandas.DataFrame
        Of these steps, as `seqopt.analyze` makes them.

    Returns
    -------
    pandas.DataFrame
        A row per grip, by first step. Columns: ``robot``, ``from_step``, ``to_step``, ``brick``,
        ``node``, ``places`` (whether the robot places the brick with it), ``largest_force_N`` and
        ``at_step``, the step of that force.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> engine = seqopt.make_engine("compliance", seqopt.build_network(scene))
    >>> steps = seqopt.sequential(engine.network)
    >>> table = grips_table(scene, steps, seqopt.analyze(engine, steps))
    >>> print(table.loc[:1, ["robot", "from_step", "to_step", "brick", "node", "places"]])
      robot  from_step  to_step  brick  node  places
    0  rob1          1        2      1     1    True
    1  rob2          2        4      2     2    True
    """
    rows = [
        _row(scene, hold, responses[force_column(scene.robots[hold.robot])].to_numpy(float))
        for hold in sorted(holds(scene, steps), key=lambda hold: (hold.first, hold.robot))
    ]
    return pd.DataFrame(rows)


def _row(scene: Scene, hold: Hold, forces: np.ndarray) -> dict[str, object]:
    """Return the row of a hold, from the forces of its robot's grips in all steps, N."""
    assert hold.node is not None  # steps have no open grips
    own = forces[hold.first - 1 : hold.last]
    return {
        "robot": scene.robots[hold.robot].name,
        "from_step": hold.first,
        "to_step": hold.last,
        "brick": scene.brick_of_node[hold.node].name,
        "node": hold.node,
        "places": hold.places is not None,
        "largest_force_N": float(own.max()),
        "at_step": hold.first + int(own.argmax()),
    }
