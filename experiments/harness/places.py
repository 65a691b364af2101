"""Where experiments put tables and figures; of seqopt nothing is imported here."""

from __future__ import annotations

from pathlib import Path

HOME = Path(__file__).resolve().parent.parent
RESULTS = HOME / "results"
FIGURES = HOME.parent / "docs" / "figures"
