"""What is said of a structure's stability: verdicts, and which margins an assessment finds."""

from enum import Enum

STANDS, FALLS, OPEN = 1, -1, 0  # verdicts in arrays
ASSESSED = ("bond", "friction", "tilt", "payload")  # beside a verdict; the first three as goals


class Verdict(Enum):
    """What is proven about an assembly: it stands, it does not, or neither is proven."""

    STANDS = "stands"
    FALLS = "does not stand"
    UNDECIDED = "undecided"
