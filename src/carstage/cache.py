"""Where everything is kept that can be computed again."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

CACHE_VARIABLE = "CARSTAGE_CACHE_DIR"
"""Environment variable that moves every cache of Car-STAGE to another folder."""


def cache_folder() -> Path:
    """The folder of all caches: the user's, or the one that ``CARSTAGE_CACHE_DIR`` names."""
    override = os.environ.get(CACHE_VARIABLE)
    return Path(override) if override else platformdirs.user_cache_path("carstage", appauthor=False)
