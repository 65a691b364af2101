"""Mutants that no test can kill, since nothing changes that is promised, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatch

from tests.quality.mutants import Mutant


@dataclass(frozen=True)
class Equivalent:
    """A change that changes nothing.

    Attributes
    ----------
    module : str
        Dotted; may have a ``*``.
    line : str
        What the line holds, beside what is changed.
    old, new : str
        What becomes what.
    reason : str
        Why nothing changes.
    """

    module: str
    line: str
    old: str
    new: str
    reason: str

    def covers(self, mutant: Mutant) -> bool:
        """Return whether a mutant is this change at one place, whatever the spaces."""
        if not (fnmatch(mutant.module, self.module) and self.line in mutant.before):
            return False
        before, after, old, new = (
            text.replace(" ", "") for text in (mutant.before, mutant.after, self.old, self.new)
        )
        places = (i for i in range(len(before)) if before.startswith(old, i))
        return any(before[:i] + new + before[i + len(old) :] == after for i in places)


COMPLIANCE = "seqopt.engines.rigid.compliance"
TRIAL = "seqopt.engines.rigid.compliance"
OPERATOR = "seqopt.engines.rigid._operator"
GROWTH = "seqopt.engines.rigid._growth"
GRIPS = "seqopt.engines.rigid._grip_equations"
COSTS, CERTIFICATE = "seqopt.graph.decision_costs", "seqopt.judge.certificate"
RANKS = "seqopt.problem.criteria"
LENGTHS = "both have a length: costs that have not are refused when they are made"
EQUIVALENT = (
    *(
        Equivalent(module, line, "strict=True", "strict=False", why)
        for module, line, why in (
            ("formulations.*", "zip(", LENGTHS),
            (COSTS, "enumerate(zip(", LENGTHS),
        )
    ),
    Equivalent("formulations.beam", "", "np.zeros(1)", "np.zeros(2)", "two equal ways are one"),
    *(
        Equivalent(
            "formulations.rank_search", "MOST", "20_000_000", size, "a bound on memory alone"
        )
        for size in ("20000001", "19999999")
    ),
    Equivalent("formulations.cascade", "charge", "==", ">=", "it is later or earlier"),
    Equivalent(COSTS, "== np.inf", "==", ">=", "nothing is larger than infinity"),
    Equivalent(COSTS, "== -np.inf", "==", "<=", "nothing is smaller than minus infinity"),
    Equivalent(COSTS, "out, before", "0", "-1", "of one row the first is the last"),
    *(
        Equivalent(COSTS, "initial", "0.0", size, "whether sums overflow is not a matter of 1")
        for size in ("1.0", "-1.0")
    ),
    *(
        Equivalent(TRIAL, "CHUNK", "4096", size, "the size of a pass changes no answer")
        for size in ("4095", "4097")
    ),
    *(
        Equivalent(TRIAL, "CANCEL", "10.0", size, "where one way of two that agree ends")
        for size in ("9.0", "11.0")
    ),
    Equivalent(RANKS, "if values.ndim", "==", "<=", "a step has one open move or two"),
    Equivalent(RANKS, "ordered", "!=", ">", "in order, what is another is larger"),
    *(
        Equivalent(
            "formulations.contact.limit_analysis",
            "SECONDS",
            "300.0",
            size,
            "when a solver has stalled",
        )
        for size in ("299.0", "301.0")
    ),
    Equivalent(
        GRIPS, "softness", "else 1.0", "else 0.0", "without loose motions nothing is scaled"
    ),
    Equivalent(
        GRIPS, "softness", "else 1.0", "else 2.0", "without loose motions nothing is scaled"
    ),
    Equivalent(
        "seqopt.engines.rigid.*", "reshape(", ",-1", ",-2", "a negative length is what is left"
    ),
    Equivalent(
        CERTIFICATE, "@dataclass", "repr=False", "repr=True", "without arrays both look alike"
    ),
    Equivalent(GRIPS, "lowest > 0", ">", ">=", "what is over a pivot of zero is infinite"),
    *(
        Equivalent(TRIAL, "UNSEEN", "100", size, "a margin that was met, to two digits")
        for size in ("99", "101")
    ),
    *(
        Equivalent(
            COMPLIANCE, "len(held) >= bricks", old, new, "loads beyond those asked for are spare"
        )
        for old, new in (("2 *", "2 +"), ("2 *", "3 *"))
    ),
    *(
        Equivalent(TRIAL, "sets <= _CHUNK", "<=", new, "those within all sets are all")
        for new in ("<", "==")
    ),
    Equivalent(TRIAL, "CANCEL * left", ">", ">=", "no sum is it to the last bit"),
    *(
        Equivalent(COMPLIANCE, "KEPT", "32e6", size, "a bound on memory alone")
        for size in ("31999999.0", "32000001.0")
    ),
    *(
        Equivalent(OPERATOR, "2 * unknowns", "2 *", new, "which way of two that agree is taken")
        for new in ("1 *", "3 *", "2 +", "2 -", "2 /")
    ),
    *(
        Equivalent(OPERATOR, "unknowns <= max", "<=", new, "which way of two that agree is taken")
        for new in ("<", "!=", ">", ">=", "==")
    ),
    Equivalent(GRIPS, "doubts(", "<=", "<", "no doubt is it to the last bit"),
    *(
        Equivalent(TRIAL, "force[~good]", "0.0", size, "these sets are answered anew")
        for size in ("1.0", "-1.0")
    ),
    Equivalent(
        COMPLIANCE, "len(held) >= bricks", ">=", ">", "which way of two that agree is taken"
    ),
    *(
        Equivalent(OPERATOR, "AT_ONCE // states", old, new, "how many are answered at a time")
        for old, new in (("//", "%"), ("//", "**"), ("max", "min"), ("[1]", "[0]"))
    ),
    *(
        Equivalent(OPERATOR, line, old, new, "which way of two that agree is taken")
        for line, old, new in (("support", "or", "and"), ("if few", "if few", "if not few"))
    ),
    Equivalent(OPERATOR, "loss.max", "initial=1.0", "initial=0.0", "every loss is one at least"),
    *(
        Equivalent(OPERATOR, "slice(bricks)", "==", new, "a slice of all bricks is all of them")
        for new in (">", ">=")
    ),
    Equivalent(GRIPS, "most * lowest >= least", ">=", ">", "no doubt is it to the last bit"),
    Equivalent(GRIPS, "@cache", "@cache", "", "what is kept is made anew, and the same"),
    Equivalent(GROWTH, "AT_ONCE = 2**17", "2", "1", "how many are changed at a time"),
    Equivalent(COSTS, "given.flat[0]", "0", "-1", "all of these entries are one"),
    Equivalent("formulations.beam", "len(met)", "<", "!=", "no more are met than were found"),
)


def reason(mutant: Mutant) -> str:
    """Return why a mutant is equivalent, empty where it is not said to be."""
    return next((known.reason for known in EQUIVALENT if known.covers(mutant)), "")
