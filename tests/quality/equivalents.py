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
OPERATOR = "seqopt.engines.rigid._operator"
GROWTH = "seqopt.engines.rigid._growth"
GRIPS = "seqopt.engines.rigid._grip_equations"
COSTS = "seqopt.graph.decision_costs"
CERTIFICATE = "seqopt.judge.certificate"
RANKS = "seqopt.problem.criteria"
EITHER = "which way of two that agree is taken"
LENGTHS = "both have a length: costs that have not are refused when they are made"
LAST_BIT = "no doubt is it to the last bit"
MEMORY = "a bound on memory alone"
UNSCALED = "without loose motions nothing is scaled"
CHANGES = (
    ("formulations.*", "zip(", "strict=True", ("strict=False",), LENGTHS),
    (COSTS, "enumerate(zip(", "strict=True", ("strict=False",), LENGTHS),
    ("formulations.beam", "", "np.zeros(1)", ("np.zeros(2)",), "two equal ways are one"),
    ("formulations.rank_search", "MOST", "20_000_000", ("20000001", "19999999"), MEMORY),
    ("formulations.cascade", "charge", "==", (">=",), "it is later or earlier"),
    (COSTS, "== np.inf", "==", (">=",), "nothing is larger than infinity"),
    (COSTS, "== -np.inf", "==", ("<=",), "nothing is smaller than minus infinity"),
    (COSTS, "out, before", "0", ("-1",), "of one row the first is the last"),
    (COSTS, "initial", "0.0", ("1.0", "-1.0"), "whether sums overflow is not a matter of 1"),
    (COMPLIANCE, "CHUNK", "4096", ("4095", "4097"), "the size of a pass changes no answer"),
    (COMPLIANCE, "CANCEL", "10.0", ("9.0", "11.0"), "where one way of two that agree ends"),
    (RANKS, "if values.ndim", "==", ("<=",), "a step has one open move or two"),
    (RANKS, "ordered", "!=", (">",), "in order, what is another is larger"),
    (
        "formulations.contact.limit_analysis",
        "SECONDS",
        "300.0",
        ("299.0", "301.0"),
        "when a solver has stalled",
    ),
    (GRIPS, "softness", "else 1.0", ("else 0.0", "else 2.0"), UNSCALED),
    ("seqopt.engines.rigid.*", "reshape(", ",-1", (",-2",), "a negative length is what is left"),
    (CERTIFICATE, "@dataclass", "repr=False", ("repr=True",), "without arrays both look alike"),
    (GRIPS, "lowest > 0", ">", (">=",), "what is over a pivot of zero is infinite"),
    (COMPLIANCE, "UNSEEN", "100", ("99", "101"), "a margin that was met, to two digits"),
    (
        COMPLIANCE,
        "len(held) >= bricks",
        "2 *",
        ("2 +", "3 *"),
        "loads beyond those asked for are spare",
    ),
    (COMPLIANCE, "sets <= _CHUNK", "<=", ("<", "=="), "those within all sets are all"),
    (COMPLIANCE, "CANCEL * left", ">", (">=",), "no sum is it to the last bit"),
    (COMPLIANCE, "KEPT", "32e6", ("31999999.0", "32000001.0"), MEMORY),
    (OPERATOR, "2 * unknowns", "2 *", ("1 *", "3 *", "2 +", "2 -", "2 /"), EITHER),
    (OPERATOR, "unknowns <= max", "<=", ("<", "!=", ">", ">=", "=="), EITHER),
    (GRIPS, "doubts(", "<=", ("<",), LAST_BIT),
    (COMPLIANCE, "force[~good]", "0.0", ("1.0", "-1.0"), "these sets are answered anew"),
    (COMPLIANCE, "len(held) >= bricks", ">=", (">",), EITHER),
    (OPERATOR, "AT_ONCE // states", "//", ("%", "**"), "how many are answered at a time"),
    (OPERATOR, "AT_ONCE // states", "max", ("min",), "how many are answered at a time"),
    (OPERATOR, "AT_ONCE // states", "[1]", ("[0]",), "how many are answered at a time"),
    (OPERATOR, "support", "or", ("and",), EITHER),
    (OPERATOR, "if few", "if few", ("if not few",), EITHER),
    (OPERATOR, "loss.max", "initial=1.0", ("initial=0.0",), "every loss is one at least"),
    (OPERATOR, "slice(bricks)", "==", (">", ">="), "a slice of all bricks is all of them"),
    (GRIPS, "most * lowest >= least", ">=", (">",), LAST_BIT),
    (GRIPS, "@cache", "@cache", ("",), "what is kept is made anew, and the same"),
    (GROWTH, "AT_ONCE = 2**17", "2", ("1",), "how many are changed at a time"),
    (COSTS, "given.flat[0]", "0", ("-1",), "all of these entries are one"),
    ("formulations.beam", "len(met)", "<", ("!=",), "no more are met than were found"),
)  # module, line, what becomes which of several, reason
EQUIVALENT = tuple(
    Equivalent(module, line, old, new, why)
    for module, line, old, several, why in CHANGES
    for new in several
)


def reason(mutant: Mutant) -> str:
    """Return why a mutant is equivalent, empty where it is not said to be."""
    return next((known.reason for known in EQUIVALENT if known.covers(mutant)), "")
