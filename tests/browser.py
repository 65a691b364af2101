"""A headless browser, where there is one."""

import os
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

BROWSER = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
PLAIN = (
    "--headless --no-sandbox --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --disable-quic --disable-dev-shm-usage "
    "--enable-logging=stderr --virtual-time-budget=20000 --dump-dom"
)
WORDS = f"{PLAIN} --disable-gpu-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader"
PLAIN += " --disable-gpu"  # nothing is drawn in three dimensions: a third of the time


def browsed(folder: Path, address: str, words: str = WORDS) -> tuple[str, str]:
    """Return what a browser made of an address, and what it said; both empty if there is none."""
    if BROWSER is None:
        return "", ""
    done = subprocess.run(
        [BROWSER, *words.split(), f"--user-data-dir={folder / 'profile'}", address],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=os.environ | {"HOME": str(folder)},
    )
    return done.stdout, done.stderr


@cache
def browses() -> bool:
    """Return whether a browser runs here, asked once."""
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        return "<p>here</p>" in browsed(Path(folder), "data:text/html,<p>here</p>", PLAIN)[0]
