"""Size of the built page."""

from __future__ import annotations

import gzip

from carstage.web.app import STATIC

BUNDLE_BYTES = 400_000
"""All that it may have."""


def compressed_bytes() -> dict[str, int]:
    """Bytes of each script and style of the page, gzip'd as it is sent."""
    files = [path for path in STATIC.rglob("*") if path.suffix in (".js", ".css")]
    return {path.name: len(gzip.compress(path.read_bytes())) for path in files}
