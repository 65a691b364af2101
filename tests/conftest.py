from __future__ import annotations

import pytest
from hypothesis import settings

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.scene.scene_file import load_scene

settings.register_profile("seqopt", derandomize=True, deadline=None, max_examples=40)
settings.load_profile("seqopt")


@pytest.fixture(scope="session")
def arch25():
    return load_scene("arch25")


@pytest.fixture(scope="session")
def engine25(arch25):
    return ComplianceEngine(build_network(arch25))
