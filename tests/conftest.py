"""What tests of both packages need: a running simulator, a town."""

from __future__ import annotations

import os
from collections.abc import Iterator

import hypothesis
import pytest

from carstage_sim.cache import CACHE_VARIABLE, cache_folder
from carstage_sim.maps import Town, load_town
from running_simulator import RunningSimulator, start_simulator, stop_simulator

# How long an example takes says nothing on a busy machine; CI tries the same examples each time.
hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True)
hypothesis.settings.load_profile("repeatable")

# Many tests move HOME; compiled kernels and baked towns are shared all the same.
os.environ.setdefault(CACHE_VARIABLE, str(cache_folder()))


@pytest.fixture(scope="session")
def simulator(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningSimulator]:
    """One server per test process; every test begins with a new episode of its own."""
    running = start_simulator(
        tmp_path_factory.mktemp("simulator") / "stderr.log", "--exit-with-parent"
    )
    yield running
    stop_simulator(running)


@pytest.fixture(scope="session")
def stage01() -> Town:
    """The built-in town, baked once per machine."""
    return load_town("Stage01")
