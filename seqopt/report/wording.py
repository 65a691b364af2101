"""Names of methods, formulations and criteria in the words of the field, for tables and charts."""

from __future__ import annotations

WORDS = {
    "sequential": "sequential",
    "cantilever": "cantilever",
    "published": "published plan",
    "modified-sequential": "modified sequential",
    "free": "free schedule",
    "overlap_dp": "dynamic programming",
    "overlap_lp": "linear program",
    "overlap_mip": "integer program",
    "minimax": "least worst step",
    "lagrangian": "Lagrangian bound",
    "labels": "label setting",
    "cascade": "cascade",
    "beam": "beam search",
    "rank_search": "rank search",
    "equations-2-3": "equations 2 and 3",
    "closest-to-plan": "rule closest to the published plan",
    "weighted-published": "weighted sum of ratios",
    "worst-ratio-published": "worst ratio",
    "assignment_tight": "assignment, tight links",
    "assignment_loose": "assignment, loose links",
    "minimax_layer": "epigraph per step",
    "minimax_arc": "epigraph per pair",
    "minimax_big_m": "large constant (big-M)",
}


def in_words(name: str) -> str:
    """Return what a method or formulation is called, or its name where nobody gave it words.

    Examples
    --------
    >>> in_words("overlap_dp"), in_words("my_own")
    ('dynamic programming', 'my_own')
    """
    return WORDS.get(name, name)


def typed(name: str) -> str:
    """Return words for a method or formulation, with what is typed behind where it differs.

    Examples
    --------
    >>> typed("overlap_dp"), typed("cantilever")
    ('dynamic programming (overlap_dp)', 'cantilever')
    """
    words = in_words(name)
    same = words == name or name.replace("_", " ").replace("-", " ") in words
    return words if same else f"{words} ({name})"
