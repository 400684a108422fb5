"""Where everything is kept that can be computed again: machine code, trees, baked towns."""

from __future__ import annotations

import os
from pathlib import Path

from platformdirs import user_cache_path

CACHE_VARIABLE = "CARSTAGE_CACHE_DIR"
"""Environment variable that moves every cache of Car-STAGE to another folder."""


def cache_folder() -> Path:
    """The user's cache folder, or the one that ``CARSTAGE_CACHE_DIR`` names."""
    override = os.environ.get(CACHE_VARIABLE)
    return Path(override) if override else user_cache_path("carstage", appauthor=False)
