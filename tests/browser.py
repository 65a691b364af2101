"""A headless browser, where there is one."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

BROWSER = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
WORDS = "--headless --no-sandbox --disable-gpu --virtual-time-budget=20000 --dump-dom"


def browsed(folder: Path, address: str) -> str:
    """Return what a browser made of an address once its scripts have run; empty if none runs."""
    if BROWSER is None:
        return ""
    done = subprocess.run(
        [BROWSER, *WORDS.split(), f"--user-data-dir={folder / 'profile'}", address],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=os.environ | {"HOME": str(folder)},
    )
    return done.stdout
