"""That no step of a build comes before its mortar holds: ages, bonds and verdicts found again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.contact.assembly import Assembly
from seqopt.contact.curing import Curing
from seqopt.contact.faces import Contacts, step_assembly
from seqopt.errors import SolverError
from seqopt.judge._time_proof import step_ends
from seqopt.network.network import Network
from seqopt.problem.standing import Standing
from seqopt.sequence.site import Site
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability.assessment import Verdict, verdict

Grips = tuple[Ints, Floats]
CLOSE = 1e-9  # of a time: what rounding may take from an age


def check_cured(
    network: Network,
    steps: Sequence[Step],
    standing: Standing,
    starts: Sequence[float],
    begin: Site | None = None,
) -> None:
    """Require that the state of every step stands with what its joints have when it starts.

    ``starts``: of the steps, s; what is changed is in its place when the step ends; ``begin``:
    where the build begins; what stands there is as old as it says. Verdicts are of
    the cone program, one by one. Raises `SolverError` for a step that starts before its robot is
    ready, or is not proven to stand.
    """
    curing = standing.curing
    if len(starts) != len(steps):
        raise SolverError(f"{len(starts)} starts for {len(steps)} steps")
    ends = step_ends(network.scene, steps, starts, begin)
    if curing is None:
        return
    known, found = Contacts(network), dict[object, Verdict]()
    placed = dict.fromkeys(range(0 if begin is None else begin.bricks), 0.0)
    placed |= {k: -age for k, age in enumerate(() if begin is None else begin.ages)}
    for step, start, end in zip(steps, starts, ends, strict=True):
        whole = step_assembly(network, step.bricks, step.grips, known)
        bond = tuple(
            _share(curing, name, start, [placed.get(int(body)) for body in bodies if body >= 0])
            for name, bodies in zip(whole.contact_name, whole.bodies, strict=True)
        )
        key = step.bricks, step.grips, bond
        if key not in found:
            found[key] = _verdict(whole, bond, standing)
        if found[key] is not Verdict.STANDS:
            raise SolverError(
                f"step {step.number} is not proven to stand with the bond that its joints have at "
                f"{start:.6g} s: it {found[key].value}"
            )
        if step.kind is StepKind.PLACE:
            placed[step.bricks - 1] = end


def _verdict(whole: Assembly, bond: tuple[float, ...], standing: Standing) -> Verdict:
    return verdict(whole.with_bond(np.array(bond)), standing.mortar)


def _share(curing: Curing, joint: str, now: float, placed: Sequence[float | None]) -> float:
    """Return the share of bond of a joint, whose bricks were in their places at some times."""
    since = [now if time is None else time for time in placed]
    age = now - max(since) + CLOSE * abs(now)
    return max((share for at, share in curing.points_of(joint) if at <= age), default=0.0)
