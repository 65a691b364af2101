import gc
import os
import re
import signal

# several threads per process fight over the cores; set before numpy is imported, for subprocesses
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background of a shell; programs that
    signal.signal(signal.SIGINT, signal.default_int_handler)  # tests start would not end by it

import pytest
from hypothesis import HealthCheck, settings

from seqopt._registry import ADDED
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.network import build_network
from seqopt.plan.solve import pose
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import three_robot_loop
from seqopt.study import EQUATIONS
from tests.quality.kernels import running

# modules and tests stay until the end: the collector need not look at them again and again
gc.disable()


def pytest_collection_finish():
    gc.freeze()
    gc.enable()
    gc.set_threshold(20_000, 20, 50)  # what tests leave is small beside what they load


settings.register_profile(
    "seqopt",
    derandomize=True,
    deadline=None,
    max_examples=int(os.environ.get("EXAMPLES", "5")),  # more for a release
    suppress_health_check=[HealthCheck.too_slow],  # on a busy machine everything is
)
settings.load_profile("seqopt")


def pytest_report_header():
    """Which kernels do linear algebra: what last digits decide differs between them."""
    kernels = ", ".join(f"{package} {kernel}" for package, kernel in sorted(running().items()))
    return f"kernels of OpenBLAS: {kernels or 'none'}"


LONGEST = "test_the_site_builds_strictly"
SLOW_ALONE = re.compile(r"^pytestmark = (\[\s*)?pytest\.mark\.slow", re.M)  # all tests of a file
LARGE = ("docs", "experiments", "times", "validation")  # folders with others that take long


def pytest_ignore_collect(collection_path, config):
    """Leave out files without a test that is asked for; loading takes long."""
    asked = config.option.markexpr
    if not collection_path.name.startswith("test_") or not asked.startswith(("slow", "not slow")):
        return None
    text = collection_path.read_text(encoding="utf-8")
    wanted = "slow" in text if asked.startswith("slow") else not SLOW_ALONE.search(text)
    return None if wanted else True


@pytest.hookimpl(tryfirst=True)  # before workers read the groups
def pytest_collection_modifyitems(config, items):
    """Start with the tests that take longest, so that no worker waits for them at the end.

    The quick tests of a file stay with one worker, which makes what they share once.
    """
    for item in items:
        if config.option.markexpr == "not slow" and not item.get_closest_marker("xdist_group"):
            item.add_marker(pytest.mark.xdist_group(item.path.as_posix()))
    items.sort(key=lambda item: (item.name != LONGEST, item.path.parent.name not in LARGE))


@pytest.fixture(scope="session")
def arch25():
    return load_scene("arch25")


@pytest.fixture(scope="session")
def engine25(arch25):
    return ComplianceEngine(build_network(arch25))


@pytest.fixture(scope="session")
def loop25(engine25):
    return three_robot_loop(engine25.network)


@pytest.fixture(scope="session")
def problem25(engine25, loop25):
    return pose(engine25, loop25, EQUATIONS)


@pytest.fixture
def alone():
    """Forget what a test registers."""
    before = {**ADDED}
    yield
    ADDED.clear()
    ADDED.update(before)
