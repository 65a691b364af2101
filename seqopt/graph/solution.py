"""What formulations return: a path of states, and what they claim of it; nothing is proven yet."""

from __future__ import annotations

from dataclasses import dataclass, field

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.graph.formulation import Finding
from seqopt.graph.graph import LabelProof
from seqopt.scene.scene import Order


@dataclass(frozen=True, eq=False, repr=False)
class Solution(FrozenValue):
    """A free schedule, and what its formulation claims of it.

    ``states``: after every step: how many bricks stand, then the node that each robot holds, as a
    place in build order from 1; robots of one kind stand together, 0 for one that is free;
    ``objective``: claimed value of every goal; ``bound``: claimed lower bound of every goal, those
    before it being at their values; ``visited`` (tuple of (n, c) int): states that a better plan
    could pass, by brick count, if the formulation knows them: the proof looks at these together,
    and depends on them in nothing but its time; ``prices``: by goal, what a unit of every budget
    and of every sum before it is worth: they prove the bounds where there are budgets; ``stopped``:
    why the search ended before all was proven: ``time``, ``memory`` or ``interrupt``; empty if it
    did not; ``grips``: where it counts who of a kind acts, after every step the place that each
    robot of the scene holds, 0 for none; ``proofs``: of the makespan and the goals after it, of all
    goals where there are budgets; ``starts``, ``ends``: where mortar cures, when steps start, s,
    and the last one ends; ``motions``: by which labels there are a proof: states fall in them, (b,
    6) in m and rad; ``trace``: what the first goal was known to be at which time;
    ``compile_seconds``: part of the time that went into writing a program down for a solver, s;
    ``order``: names of all bricks, where their order was sought, empty where it is given;
    ``effort``: how many sets of bricks with a newest one, or orders, were looked at for it, and how
    many grip sets were solved in these.
    """

    states: tuple[tuple[int, ...], ...]
    objective: tuple[float, ...]
    bound: tuple[float, ...]
    visited: tuple[Ints, ...] = field(default=(), repr=False)
    prices: tuple[tuple[float, ...], ...] = ()
    stopped: str = ""
    grips: tuple[tuple[int, ...], ...] = ()
    proofs: tuple[LabelProof, ...] = field(default=(), repr=False)
    starts: tuple[float, ...] = ()
    ends: float = 0.0
    motions: tuple[Floats, ...] = field(default=(), repr=False)
    trace: tuple[Finding, ...] = field(default=(), compare=False, repr=False)
    compile_seconds: float = field(default=0.0, compare=False)
    order: Order = ()
    effort: tuple[int, int] = field(default=(0, 0), compare=False)
