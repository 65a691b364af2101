"""Plans as sequencer_benchmark writes them: parts that a step installs, and parts that it holds.

Format: `assembly_sequence` of https://github.com/KIKI007/sequencer_benchmark, read there by
``AssemblySequence::loadFromJson``. A part is the name of a brick.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

from seqopt.scene.scene import Scene
from seqopt.sequence.exports.states import step_states
from seqopt.sequence.steps import Step


def sequencer_json(scene: Scene, steps: Sequence[Step]) -> str:
    """Return a plan as an ``assembly_sequence``.

    Returns
    -------
    str
        JSON; which robot holds, and where, it does not say.
    """
    rows = [
        {
            "installPartIDs": list(row.new),
            "holdPartIDs": sorted({brick for _, brick in row.holds.values()}),
        }
        for row in step_states(scene, steps)
    ]
    return json.dumps({"assembly_sequence": rows}) + "\n"
