"""Another kernel is named, and runs where it is asked for."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.builders import ROOT
from tests.quality.kernels import other, running

CODE = "from tests.quality.kernels import running; print(*running().values())"


@pytest.mark.skipif(not other(), reason="no OpenBLAS, or no other kernel by name")
def test_the_other_kernel_runs_where_it_is_asked_for():
    asked = os.environ | {"OPENBLAS_CORETYPE": other()}
    command = [sys.executable, "-c", CODE]
    ran = subprocess.run(command, env=asked, cwd=ROOT, capture_output=True, text=True, check=True)
    assert {*ran.stdout.split()} == {other()}
    assert other() not in running().values()  # the control


def test_every_run_says_which_kernels_it_has(pytestconfig):
    (line,) = (
        line
        for line in pytestconfig.hook.pytest_report_header(config=pytestconfig, start_path=ROOT)
        if "kernels" in line
    )
    for package, kernel in running().items():
        assert f"{package} {kernel}" in line
