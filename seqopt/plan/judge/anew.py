"""The responses of a chosen plan, computed anew where those that it was chosen by may be stored.

Files of a cache can be written by whoever may write into its folder. A plan is judged by responses,
so those of its own steps are computed again, by a new engine that reads no file, and compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from seqopt.errors import FileError
from seqopt.graph.layers.layers import Layers
from seqopt.network.network import Network
from seqopt.responses.blocks import pack
from seqopt.responses.choices import Evaluation
from seqopt.responses.quantities import CHOSEN_BY

SAME = 1e-5  # over its largest, that a response may differ: ten times what a screen may err


def require_anew(
    problem: Layers, choice: Sequence[int], met: Sequence[tuple[Layers, Sequence[int]]] = ()
) -> None:
    """Raise an error if a choice leads to other responses than its problem has from a cache.

    ``choice``: a candidate for every move; ``met`` (sequence of (Layers, sequence of int)): where
    its own responses are not computed: problems with all of its steps, and the choices in these.
    Raises `FileError` if a response of a step is another one when it is computed anew.
    """
    evaluation, cache = problem.evaluation, problem.evaluation.resources.cache
    if cache is None:
        return
    schedule = problem.schedule
    chosen = tuple(
        replace(move, candidates=(move.candidates[i],))
        for move, i in zip(schedule.moves, choice, strict=True)
    )
    engine = pack(problem.engine).unpack()
    anew = Evaluation(engine, replace(schedule, moves=chosen), evaluation.wanted)
    found = dict(_met(anew, [0] * len(chosen)))
    kept: dict[int, Mapping[str, float]] = {}
    for part, mine in met or [(problem, choice)]:
        kept |= _met(part.evaluation, mine)
    sizes = _sizes(engine.network, [*kept.values(), *found.values()])
    for step, responses in found.items():
        for name, value in responses.items():
            there = kept[step][name]
            if not np.isclose(there, value, rtol=0.0, atol=SAME * sizes[name], equal_nan=True):
                raise FileError(
                    f"cache {cache}: {name} of step {step} is {there:.6g} in a file, and "
                    f"{value:.6g} when it is computed; delete the folder"
                )


def _met(
    evaluation: Evaluation, choice: Sequence[int]
) -> Iterator[tuple[int, Mapping[str, float]]]:
    """Yield the responses that a choice meets, by step."""
    for choices in chain.from_iterable(evaluation.levels()):
        at = tuple(choice[move] for move in choices.moves)
        yield choices.step.number, {n: float(v[at]) for n, v in choices.responses.items()}


def _sizes(network: Network, steps: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return what each response is compared with: rounding of forces is no response of its own."""
    force = float(np.linalg.norm(network.weight, axis=1).sum())
    floors = {"N": force, "Nm": force * float(np.ptp(network.node_position, axis=0).max())}
    sizes: dict[str, float] = {}
    for name, value in chain.from_iterable(step.items() for step in steps):
        unit = CHOSEN_BY[name].column.split("_")[-1] if name in CHOSEN_BY else "N"
        sizes[name] = float(np.fmax(sizes.get(name, floors.get(unit, 0.0)), abs(value)))
    return sizes
