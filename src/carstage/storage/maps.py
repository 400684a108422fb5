"""Where a dataset keeps its towns' OpenDRIVE texts and vector maps: files named by their hashes."""

from __future__ import annotations

import re
from typing import Literal

MapKind = Literal["xodr", "parquet"]
"""An OpenDRIVE text, or the vector map that was made of it."""
_HASH = re.compile(r"blake3:([0-9a-f]{64})")


def map_name(named_hash: str, kind: MapKind = "xodr") -> str:
    """The path of a map below the dataset's root, ``maps/<digest>.xodr`` or ``.parquet``.

    Args:
        named_hash: ``blake3:<hex>`` of the file, as ``episode.json`` has it.
        kind: what it is.

    Raises:
        ValueError: that is no such hash.
    """
    found = _HASH.fullmatch(named_hash)
    if found is None:
        raise ValueError(f"{named_hash!r} is no BLAKE3 hash of a map")
    return f"maps/{found[1]}.{kind}"
