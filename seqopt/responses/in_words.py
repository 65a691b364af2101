"""Numbers, lengths and lists of steps as people read them."""

from __future__ import annotations

from collections.abc import Sequence

LISTED = 12  # steps that are named one by one


def number_text(value: float) -> str:
    """Return a number with at least four digits, and no power of ten where it can be read.

    Examples
    --------
    >>> number_text(27.88), number_text(116312.4)
    ('27.88', '116,312')
    """
    return f"{value:,.0f}" if 1e4 <= abs(value) < 1e12 else f"{value:.4g}"


def length_text(length: float) -> str:
    """Return a length in words, in the unit that suits it.

    Parameters
    ----------
    length : float
        m.

    Examples
    --------
    >>> length_text(2.79e-5), length_text(0.1163), length_text(0.0)
    ('27.9 µm', '116.3 mm', '0 mm')
    """
    for unit, size in (("m", 1.0), ("mm", 1e-3), ("µm", 1e-6)):
        if abs(length) >= 0.9999 * size:
            return f"{length / size:.4g} {unit}"
    return f"{length * 1e3:.4g} mm"


def steps_in_words(steps: Sequence[int]) -> str:
    """Return which steps these are; of many the first.

    Parameters
    ----------
    steps : sequence of int
        Their numbers.

    Examples
    --------
    >>> steps_in_words([3]), steps_in_words(range(1, 20))
    ('step 3', 'steps 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12 and 7 more')
    """
    more = f" and {len(steps) - LISTED} more" if len(steps) > LISTED else ""
    return f"step{'s' * (len(steps) > 1)} {', '.join(map(str, steps[:LISTED]))}{more}"
