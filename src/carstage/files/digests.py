"""SHA-256 of several contents at once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cache
from typing import Final

_LANES: Final = 16
_LANES_FROM: Final = 4
"""So many contents take as long one after the other as sixteen side by side."""
_SMALL_BYTES: Final = 1 << 16
"""Of contents this small, too little time is gained to load the kernel."""


def sha256_of_each(contents: Sequence[bytes | memoryview]) -> list[str]:
    """SHA-256 of each content in hexadecimal digits, as ``hashlib`` has it, but sooner.

    Each step of SHA-256 needs the one before, so one file leaves most of a core idle. Contents are
    hashed side by side, in the lanes of the vector registers; that gains most where sixteen or more
    are of about one size. Processors with instructions for SHA hash one after the other.
    """
    by_size = sorted(range(len(contents)), key=lambda index: len(contents[index]), reverse=True)
    found = [""] * len(contents)
    for first in range(0, len(by_size), _LANES):
        group = by_size[first : first + _LANES]
        many = len(group) >= _LANES_FROM and len(contents[group[-1]]) >= _SMALL_BYTES
        if many and _lanes_pay():
            # Numba takes half a second to import: only processes that hash much shall pay for it.
            from carstage.files.sha256_lanes import digests

            for index, digest in zip(group, digests([contents[i] for i in group]), strict=True):
                found[index] = digest.hex()
        else:
            for index in group:
                found[index] = hashlib.sha256(contents[index]).hexdigest()
    return found


def load_lanes() -> None:
    """Load what hashing side by side needs, on processors where that is done."""
    if _lanes_pay():
        import carstage.files.sha256_lanes  # noqa: F401


@cache
def _lanes_pay() -> bool:
    """Whether the processor has wide registers, and no instructions for SHA."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    return bool(features.get("avx2")) and not features.get("sha")
