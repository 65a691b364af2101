"""LMGC90, which needs a Python of its own where it is not installed."""

import json
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any


def python_with_lmgc90(python: str) -> str | None:
    """Return the full path of a Python if it has LMGC90."""
    found = shutil.which(python)
    look = "import sys, importlib.util as u; sys.exit(u.find_spec('compas_lmgc90') is None)"
    if found is None or subprocess.run([found, "-c", look], check=False).returncode:
        return None
    return str(Path(found).absolute())


def asked(python: str, program: str, scene: dict[str, Any], limit: float) -> dict[str, Any] | None:
    """Return what a program says of a scene, in another Python; None if it breaks off."""
    with tempfile.TemporaryDirectory() as folder:
        shown, said = Path(folder) / "scene.json", Path(folder) / "result.json"
        shown.write_text(json.dumps(scene), encoding="utf-8")
        command = [python, program, str(shown), str(said)]
        try:
            subprocess.run(command, cwd=folder, capture_output=True, check=False, timeout=limit)
        except subprocess.TimeoutExpired:
            return None
        return dict(json.loads(said.read_text("utf-8"))) if said.exists() else None
