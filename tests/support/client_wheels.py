"""Interpreters with the client wheels of CARLA's versions, as ``.ci/wheels.py`` installs them."""

from __future__ import annotations

from pathlib import Path

import pytest

from carstage_sim.cache import cache_folder


def wheel_python(version: str) -> Path:
    """The interpreter that has the wheel of a CARLA version; the test skips where there is none."""
    python = cache_folder() / "wheels" / version / "bin" / "python"
    if not python.exists():
        pytest.skip(f"no carla {version} wheel in {python.parents[1]}: run python .ci/wheels.py")
    return python
