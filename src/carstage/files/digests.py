"""SHA-256 of several contents at once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import Final, Literal

_LANES: Final = 16
_LANES_FROM: Final = 4
"""So many contents take as long one after the other as sixteen side by side."""
_SMALL_BYTES: Final = 1 << 16
"""Of contents this small, too little time is gained to load anything for it."""

_Content = bytes | memoryview


def sha256_of_each(contents: Sequence[_Content]) -> list[str]:
    """SHA-256 of each content in hexadecimal digits, as ``hashlib`` has it, but sooner.

    Each step of SHA-256 needs the one before, so one file leaves most of a core idle. Contents are
    hashed side by side: two by the processor's instructions for it, or else sixteen in the lanes
    of wide vector registers. That gains most where contents are of about one size.
    """
    by_size = sorted(range(len(contents)), key=lambda index: len(contents[index]), reverse=True)
    large = [index for index in by_size if len(contents[index]) >= _SMALL_BYTES]
    way = _way()
    found: dict[int, bytes] = {}
    if way == "pairs":
        found = _in_pairs(contents, large)
    elif way == "lanes":
        found = _in_lanes(contents, large)
    return [
        (found[index] if index in found else hashlib.sha256(content).digest()).hex()
        for index, content in enumerate(contents)
    ]


def hashed_at_once() -> int:
    """How many contents should be at hand for ``sha256_of_each`` on this processor."""
    return {"pairs": 2, "lanes": 2 * _LANES, "plain": 1}[_way()]


def load_digests() -> None:
    """Load what hashing side by side needs on this processor; a tenth of a second or more."""
    way = _way()
    if way == "pairs":
        from carstage.files.sha256.pairs import load

        load()
    elif way == "lanes":
        import carstage.files.sha256.lanes  # noqa: F401


def _in_pairs(contents: Sequence[_Content], large: list[int]) -> dict[int, bytes]:
    """Digests by index; one that is left over has none."""
    from carstage.files.sha256.pairs import pair_digests

    found = {}
    for first, second in list(pairwise(large))[::2]:
        found[first], found[second] = pair_digests(contents[first], contents[second])
    return found


def _in_lanes(contents: Sequence[_Content], large: list[int]) -> dict[int, bytes]:
    """Digests by index; a few that are left over have none."""
    # Numba takes half a second to import: only processes that hash much shall pay for it.
    from carstage.files.sha256.lanes import lane_digests

    found: dict[int, bytes] = {}
    for start in range(0, len(large), _LANES):
        group = large[start : start + _LANES]
        if len(group) >= _LANES_FROM:
            digests = lane_digests([contents[index] for index in group])
            found.update(zip(group, digests, strict=True))
    return found


@cache
def _way() -> Literal["pairs", "lanes", "plain"]:
    """How contents are hashed side by side on this processor."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    if features.get("sha"):
        return "pairs"
    return "lanes" if features.get("avx2") else "plain"
