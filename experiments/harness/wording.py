"""Numbers and tables as a page shows them."""

from __future__ import annotations

import math
from collections.abc import Sequence


def two(value: float) -> str:
    """Return a number with two digits that count: 0.0034, 12, 1,300; a dash for none."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    places = 1 - math.floor(math.log10(abs(value)))
    rounded = round(value, places)
    return f"{rounded:,.{max(0, places)}f}"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
