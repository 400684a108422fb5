"""Size of the built page."""

from __future__ import annotations

import gzip
from importlib.resources import files
from pathlib import Path

BUNDLE_BYTES = 400_000
"""All that it may have."""


def compressed_bytes() -> dict[str, int]:
    """Bytes of each script and style of the page, gzip'd as it is sent."""
    static = Path(str(files("carstage"))) / "web" / "static"
    parts = [path for path in static.rglob("*") if path.suffix in (".js", ".css")]
    return {path.name: len(gzip.compress(path.read_bytes())) for path in parts}
