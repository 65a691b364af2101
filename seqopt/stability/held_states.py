"""A partial structure with whatever grips: a question, solved only where nothing is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import Contacts, bare_assembly
from seqopt.network.network import Network
from seqopt.stability.held_program import CompileHeld, HeldProgram
from seqopt.stability.known import Known
from seqopt.stability.limit_analysis import Answer, Case

Settled = Callable[[Floats], Bools]
"""Says which brackets (S, 2) are narrow enough."""


def node_assembly(network: Network, bricks: int, known: Contacts | None = None) -> Assembly:
    """Return a partial structure with a grip without payload at every inner node, in build order.

    As of `seqopt.contact.faces.step_assembly`.
    """
    bare = bare_assembly(network, bricks, known)
    nodes = network.inner[:bricks].ravel()
    return replace(
        bare,
        grip_block=np.repeat(np.arange(bricks), 2),
        grip_position=network.node_position[nodes],
        payload=np.zeros(len(nodes)),
    )


class HeldStates:
    """One question about one structure, asked of any number of grip sets.

    Parameters
    ----------
    assembly : Assembly
        Its grips are all that may ever be held.
    case : Case
        What is bracketed.
    compiled : callable
        Makes the program to solve.
    easier : Case, optional
        What a program is asked before that, as forces for a z of zero.

    Attributes
    ----------
    assembly : Assembly
        Whose grips are all that may ever be held.
    solved : int
        How many times the program was called.
    """

    def __init__(
        self,
        assembly: Assembly,
        case: Case,
        compiled: CompileHeld,
        easier: Case | None = None,
    ) -> None:
        self.assembly = assembly
        self._case = case
        self._asked = [case] if easier is None else [easier, case]
        self._compile = compiled
        self._programs: list[HeldProgram] = []
        self._known = Known(assembly, case)
        self._tried: set[bytes] = set()
        self.solved = 0

    def bracket(self, places: Ints, payload: Floats, settled: Settled) -> Floats:
        """Return proven brackets of z, as narrow as needed where the solver's answers allow it.

        Parameters
        ----------
        places : (S, r) int
            Grips of the assembly that are held, from 0; as many as it has for none.
        payload : (S, r) float
            Of those that hold them, N; zero for none.
        settled : callable
            Says which brackets are narrow enough.

        Returns
        -------
        (S, 2) float
            As of `seqopt.stability.known.Known.bracket`.
        """
        out = self._known.bracket(places, payload)
        open_ = ~settled(out)
        for row in np.argsort((payload > 0).sum(axis=1), kind="stable").tolist():
            if not open_[row]:
                continue
            held = self._held(places[row], payload[row])
            open_[row] = False
            if held.tobytes() in self._tried:
                continue
            self._tried.add(held.tobytes())
            rest = np.flatnonzero(open_)
            new = self._solve(held, settled)
            out[row] = new.tightened(out[[row]], places[[row]], payload[[row]])[0]
            out[rest] = new.tightened(out[rest], places[rest], payload[rest])
            open_[rest] = ~settled(out[rest])
        return out

    def _held(self, places: Ints, payload: Floats) -> Floats:
        """Return the payload of every grip, (G,), N."""
        out = np.zeros(len(self.assembly.payload) + 1)
        np.maximum.at(out, places, payload)
        return out[:-1]

    def _solve(self, held: Floats, settled: Settled) -> Known:
        """Return what answers prove for those grips."""
        places, payload = np.flatnonzero(held)[None], held[held > 0][None]
        new = Known(self.assembly, self._case)

        def enough(answer: Answer) -> bool:
            only = Known(self.assembly, self._case).learn(answer, held)
            return bool(settled(only.bracket(places, payload))[0])

        for i in range(len(self._asked)):
            if i == len(self._programs):
                self._programs.append(self._compile(self.assembly, self._asked[i]))
            self.solved += 1
            new = new.joined(self._known.learn(self._programs[i](held, enough), held))
            if settled(new.bracket(places, payload))[0]:
                break
        return new
