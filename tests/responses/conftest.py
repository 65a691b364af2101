import pytest


@pytest.fixture(autouse=True)
def sharing(monkeypatch):
    """All work is shared, however little it is."""
    monkeypatch.setattr("seqopt.responses._grip_sets.SHARED", 0)
