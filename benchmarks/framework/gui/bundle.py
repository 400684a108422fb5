"""Size of the built page."""

from __future__ import annotations

import gzip
import re
from importlib.resources import files
from pathlib import Path

BUNDLE_BYTES = 400_000
"""All that it may have."""

FIRST_PAGE_BYTES = 300_000
"""Of these, what the first page loads."""


def first_page_bytes() -> int:
    """Bytes of the scripts and styles that the first page loads, gzip'd.

    These are those that its document names, what they import, and the 3D view of the rig.
    """
    static = Path(str(files("carstage"))) / "web" / "static"
    named = re.compile(r"""["'](?:\./)?(?:assets/)?([\w-]+\.(?:js|css))["']""")
    waiting = named.findall((static / "index.html").read_text("utf-8"))
    waiting += [path.name for path in (static / "assets").glob("View3D-*.js")]
    sizes, found = compressed_bytes(), set[str]()
    while waiting:
        name = waiting.pop()
        if name in found or name not in sizes:
            continue
        found.add(name)
        text = (static / "assets" / name).read_text("utf-8")
        waiting += re.findall(r"""(?:from|import)\s*["']\./([\w-]+\.js)["']""", text)
    return sum(sizes[name] for name in found)


def compressed_bytes() -> dict[str, int]:
    """Bytes of each script and style of the page, gzip'd as it is sent."""
    static = Path(str(files("carstage"))) / "web" / "static"
    parts = [path for path in static.rglob("*") if path.suffix in (".js", ".css")]
    return {path.name: len(gzip.compress(path.read_bytes())) for path in parts}
