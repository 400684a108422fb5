"""Track ids of what is no actor: in ranges that actor ids, which have 32 bits, never reach.

All are below 2^53, so that JSON and JavaScript keep them exactly.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

FIRST_RIDER: Final = 2**32
FIRST_LEVEL_OBJECT: Final = 2**52
_IDS: Final = 2**52


def rider_track(actor_id: int) -> int:
    """The track of whoever rides a two-wheeler."""
    return FIRST_RIDER + actor_id


def level_tracks(ids: Iterable[int]) -> list[int]:
    """Tracks of level objects: the server's ids, of which CARLA's are 64-bit hashes of names.

    The same objects get the same tracks in every episode. Two of which the low 52 bits are equal
    (among 10,000 hashes once in 10^8 maps) get the next free number, in the order given.
    """
    taken: set[int] = set()
    tracks = []
    for number in ids:
        low = number % _IDS
        while low in taken:
            low = (low + 1) % _IDS
        taken.add(low)
        tracks.append(FIRST_LEVEL_OBJECT + low)
    return tracks
