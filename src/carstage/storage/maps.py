"""Where a dataset keeps the OpenDRIVE texts of its towns: one file per text, named by its hash."""

from __future__ import annotations

import re

_HASH = re.compile(r"blake3:([0-9a-f]{64})")


def map_name(named_hash: str) -> str:
    """The path of an OpenDRIVE text below the dataset's root, ``maps/<digest>.xodr``.

    Args:
        named_hash: ``blake3:<hex>``, as ``episode.json`` has it.

    Raises:
        ValueError: that is no such hash.
    """
    found = _HASH.fullmatch(named_hash)
    if found is None:
        raise ValueError(f"{named_hash!r} is no BLAKE3 hash of a map")
    return f"maps/{found[1]}.xodr"
