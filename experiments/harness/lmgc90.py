"""LMGC90, which needs a Python of its own where it is not installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path


def python_with_lmgc90(python: str) -> str | None:
    """Return the full path of a Python if it has LMGC90."""
    found = shutil.which(python)
    look = "import sys, importlib.util as u; sys.exit(u.find_spec('compas_lmgc90') is None)"
    if found is None or subprocess.run([found, "-c", look], check=False).returncode:
        return None
    return str(Path(found).absolute())
