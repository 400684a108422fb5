"""A software GPU: Mesa's Vulkan driver that computes on the CPU. Slow, but it computes the same."""

from __future__ import annotations

import os

import pytest

# Read by the driver when it is loaded: what is compiled once and run on small pictures is not worth
# the compiler's optimisations.
os.environ.setdefault("GALLIVM_PERF", "nopt")
os.environ.setdefault("LP_NUM_THREADS", "2")
# The driver may be restored from a folder that another run wrote.
os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "1")


@pytest.fixture(scope="session")
def software_gpu():
    """The driver, or a skipped test where it is not installed (``.ci/run`` installs it)."""
    from carstage_sim.render.gpu.device import NoGpuError, open_gpu

    try:
        return open_gpu(software=True)
    except NoGpuError as error:
        if os.environ.get("CARSTAGE_REQUIRE_SOFTWARE_GPU"):
            raise
        pytest.skip(str(error))
