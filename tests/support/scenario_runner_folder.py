"""CARLA's scenario_runner, where the user of the tests has it: nothing is fetched."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import pytest

FOLDER = "CARSTAGE_SCENARIO_RUNNER"
PYTHON = "CARSTAGE_SCENARIO_RUNNER_PYTHON"
"""Environment variables; CARLA's ``agents`` have to be on that Python's path."""


class ScenarioRunner(NamedTuple):
    """Where it is, and the Python that has its packages."""

    folder: Path
    python: Path


def scenario_runner() -> ScenarioRunner:
    """The folder and the interpreter; the test skips where there are none."""
    folder, python = os.environ.get(FOLDER), os.environ.get(PYTHON)
    if not folder or not python:
        pytest.skip(f"set {FOLDER} and {PYTHON} to try scenario_runner")
    return ScenarioRunner(Path(folder), Path(python))
