from __future__ import annotations

import pytest

from seqopt.report.comparison import compare
from seqopt.study import EQUATIONS


@pytest.fixture(scope="session")
def compared25(engine25):
    """All methods and formulations side by side; tests with it are of the group that finds it."""
    return compare(engine25, EQUATIONS)
