"""The interpreter that has Scenic, as ``.ci/scenic.py`` makes it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from carstage_sim.cache import cache_folder

VARIABLE = "CARSTAGE_SCENIC_PYTHON"
"""Environment variable that names another one."""


def scenic_python() -> Path:
    """The interpreter; the test skips where there is none."""
    python = Path(os.environ.get(VARIABLE, cache_folder() / "scenic-env" / "bin" / "python"))
    if not python.exists():
        pytest.skip(f"no Scenic in {python.parents[1]}: run python .ci/scenic.py")
    return python
