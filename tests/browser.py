"""A headless browser, where there is one."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

BROWSER = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
WORDS = (
    "--headless --no-sandbox --disable-gpu-sandbox --use-angle=swiftshader "
    "--enable-unsafe-swiftshader --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --disable-quic --disable-dev-shm-usage "
    "--enable-logging=stderr --virtual-time-budget=20000 --dump-dom"
)


def browsed(folder: Path, address: str) -> tuple[str, str]:
    """Return what a browser made of an address, and what it said; both empty if there is none."""
    if BROWSER is None:
        return "", ""
    done = subprocess.run(
        [BROWSER, *WORDS.split(), f"--user-data-dir={folder / 'profile'}", address],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=os.environ | {"HOME": str(folder)},
    )
    return done.stdout, done.stderr
