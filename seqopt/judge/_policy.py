"""The check of a policy: every move that the rules allow, with responses computed anew.

What a table says of the first goal is the least if no move leads from a state to the rest of the
build by less, and the best move by just as much: both are inequalities of single moves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.states.states import States
from seqopt.judge._proof import Proof, Rebuilt, as_rows
from seqopt.judge._states import Filter
from seqopt.judge.certificate import TOLERANCE

WRONG = "the policy is not what it says: {}"


def check_policy(
    problem: States, levels: Ints, states: Ints, values: Floats, following: Ints
) -> int:
    """Return how many moves prove what a table says of the first goal.

    None do where states must stand: which ones do is known of those that were asked.

    ``levels`` (n,): of states (n, c), as of the search; ``values`` (n,): of the first goal;
    ``following`` (n,): rows of states, or -1. Raises `SolverError` where a move leads to less, or
    the best one does not lead to the value in the table.
    """
    if problem.demands:  # which states stand is known of those that were asked alone
        return 0
    proof = Proof(replace(problem))
    rebuilt = proof.rebuilt(Filter(exact=True))
    graph, row = rebuilt.graph(), _table_rows(proof, rebuilt, levels, states)
    amounts, ended = graph.amounts[:, 0], -np.inf if graph.peaks[0] else 0.0
    left, source, target = np.where(graph.ends, ended, values[row]), graph.source, graph.target
    there = np.maximum(amounts, left[target]) if graph.peaks[0] else amounts + left[target]
    slack = TOLERANCE * np.abs(np.where(np.isfinite(there), there, 0.0))
    if not (left[source] <= there + slack).all():
        raise SolverError(WRONG.format("a move leads to less than it says"))
    chosen = following[row[source]] == row[target]
    best = np.full(graph.states, np.inf)
    np.minimum.at(best, source[chosen], there[chosen])
    inner = ~graph.ends & np.isfinite(left)
    slack = TOLERANCE * np.abs(left[inner])
    if not (best[inner] <= left[inner] + slack).all():
        raise SolverError(WRONG.format("its moves do not lead to an end so"))
    return len(source)


def _table_rows(proof: Proof, rebuilt: Rebuilt, levels: Ints, states: Ints) -> Ints:
    """Return the rows of a table that rebuilt states have; all must have one."""
    evaluator, out = proof.evaluator, []
    for level, own in zip(rebuilt.parts, rebuilt.states, strict=True):
        rows = np.flatnonzero(levels == level)
        given = as_rows(evaluator.problem, evaluator, {level: states[rows]})[level]
        codes, wanted = evaluator.tables.codes(given), evaluator.tables.codes(own)
        order = np.argsort(codes, kind="stable")
        at = np.searchsorted(codes, wanted, sorter=order).clip(max=max(0, len(order) - 1))
        if not (len(order) and (codes[order[at]] == wanted).all()):
            raise SolverError(WRONG.format(f"states of level {level} are left out"))
        out.append(rows[order[at]])
    return np.concatenate(out)
