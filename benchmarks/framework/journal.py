"""What the stream recorder writes: one entry per message of a sensor."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

DIGEST_BYTES = 16
ENTRY = struct.Struct(f"<QQd{DIGEST_BYTES}s")
"""Actor id, frame, timestamp (s), BLAKE2b digest of the data as the collector packs them."""


class Sent(NamedTuple):
    """What the server sent for one sensor in one frame."""

    timestamp_s: float
    digest: bytes


def read_journal(path: Path) -> Mapping[tuple[int, int], Sent]:
    """What was sent, by actor id and frame; a torn last entry is left out."""
    content = path.read_bytes()
    whole = len(content) - len(content) % ENTRY.size
    return {
        (actor, frame): Sent(timestamp_s, digest)
        for actor, frame, timestamp_s, digest in ENTRY.iter_unpack(content[:whole])
    }


def digest_of(payload: memoryview) -> bytes:
    """The digest of recorded data."""
    return hashlib.blake2b(payload, digest_size=DIGEST_BYTES).digest()
