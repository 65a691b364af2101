"""Operators that were made already, as long as they take little memory."""

from __future__ import annotations

from seqopt.engines.rigid.operator import ComplianceOperator


class Kept:
    """The operators that were asked for last, by brick count.

    Parameters
    ----------
    most : float
        Bytes that they may take when a further one is to be made.
    """

    def __init__(self, most: float) -> None:
        self._most = most
        self._operators: dict[int, ComplianceOperator] = {}  # the one asked last comes last
        self._bytes: dict[int, int] = {}

    def take(self, bricks: int) -> ComplianceOperator | None:
        """Return the operator of a brick count, if it is here, and give it away."""
        return self._operators.pop(bricks, None)

    def put(self, bricks: int, operator: ComplianceOperator) -> None:
        """Keep an operator as the one that was asked last."""
        self._operators[bricks] = operator

    def make_room(self) -> None:
        """Drop those that were not asked for longest, until the rest takes little memory."""
        if self._operators:
            last = next(reversed(self._operators))
            self._bytes[last] = self._operators[last].nbytes  # it grows while it is asked
        total = sum(self._bytes.get(bricks, 0) for bricks in self._operators)
        while total > self._most:
            first = next(iter(self._operators))
            del self._operators[first]
            total -= self._bytes.get(first, 0)
