"""Where a dataset keeps the OpenDRIVE texts of its towns: one file per text, named by its hash."""

from __future__ import annotations

import re
from pathlib import Path

_HASH = re.compile(r"blake3:([0-9a-f]{64})")


def map_path(root: Path, named_hash: str) -> Path:
    """The file of an OpenDRIVE text, ``maps/<digest>.xodr``.

    Args:
        root: folder of the dataset.
        named_hash: ``blake3:<hex>``, as ``episode.json`` has it.

    Raises:
        ValueError: that is no such hash.
    """
    found = _HASH.fullmatch(named_hash)
    if found is None:
        raise ValueError(f"{named_hash!r} is no BLAKE3 hash of a map")
    return root / "maps" / f"{found[1]}.xodr"
