"""What several tests of the framework need."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import aerial_dataset
import fleet_dataset
import recorded_dataset
import variants_dataset


@pytest.fixture(scope="session")
def python38() -> str:
    """An interpreter of Python 3.8 for the ring that must run there, from PATH or pyenv."""
    versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    candidates = [shutil.which("python3.8"), *sorted(versions.glob("3.8.*/bin/python3.8"))]
    for candidate in filter(None, candidates):
        # A pyenv shim is on PATH even where its version is not selected: only running it tells.
        probe = subprocess.run([candidate, "-V"], capture_output=True, text=True, check=False)
        if probe.returncode == 0 and probe.stdout.startswith("Python 3.8."):
            return str(candidate)
    pytest.skip("no Python 3.8 on PATH or under pyenv")


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two short drives, recorded from the embedded simulator. Do not change them.

    Tests that use it belong to the xdist group ``recorded``, so that it is recorded once.
    """
    return recorded_dataset.record(tmp_path_factory.mktemp("recorded"))


@pytest.fixture(scope="session")
def variants(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive in four variants, from the embedded simulator. Do not change it.

    Tests that use it belong to the xdist group ``variants``, so that it is recorded once.
    """
    return recorded_dataset.record(tmp_path_factory.mktemp("variants"), variants_dataset.CONFIG)


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of two cars past a roadside unit, from the embedded simulator. Do not change it.

    Tests that use it belong to the xdist group ``fleet``, so that it is recorded once.
    """
    return recorded_dataset.record(tmp_path_factory.mktemp("fleet"), fleet_dataset.CONFIG)


@pytest.fixture(scope="session")
def aerial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive under two drones and a camera at a junction. Do not change it.

    Tests that use it belong to the xdist group ``aerial``, so that it is recorded once.
    """
    return recorded_dataset.record(tmp_path_factory.mktemp("aerial"), aerial_dataset.CONFIG)
