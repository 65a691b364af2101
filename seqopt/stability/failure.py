"""What goes first where an assembly fails."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly

STILL = 1e-6  # motion slower than this, beside the fastest, is none


def first_to_fail(assembly: Assembly, motion: Floats) -> tuple[str, str]:
    """Return what goes first in a motion.

    Parameters
    ----------
    assembly : Assembly
    motion : (B, 6) float
        As of `seqopt.stability.limit_analysis.Answer`.

    Returns
    -------
    block, contact : str
        The fastest block and the contact that parts fastest; empty where nothing moves.
    """
    speed = np.linalg.norm(motion, axis=1)
    if not speed.max(initial=0.0) > 0:
        return "", ""
    block = str(assembly.block_name[int(speed.argmax())])
    parting = (assembly.contact_map.T @ motion.ravel()).reshape(-1, 3)
    apart = np.linalg.norm(parting, axis=1)
    if not apart.max(initial=0.0) > STILL:
        return block, ""
    return block, assembly.contact_name[int(assembly.contact[int(apart.argmax())])]
