"""What FIPS 180-4 fixes: constants, and how a message ends."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

BLOCK_BYTES: Final = 64
ROUNDS: Final = 64
_LENGTH_BYTES: Final = 8


def _primes(count: int) -> list[int]:
    found: list[int] = []
    candidate = 2
    while len(found) < count:
        if all(candidate % prime for prime in found):
            found.append(candidate)
        candidate += 1
    return found


def _cube_root(number: int) -> int:
    """The largest whole number whose cube is not above ``number``."""
    root = 0
    for bit in range(number.bit_length() // 3, -1, -1):
        if (root | 1 << bit) ** 3 <= number:
            root |= 1 << bit
    return root


# The first 32 bits behind the point of cube and square roots of the first primes (4.2.2, 5.3.3).
K: Final = [_cube_root(prime << 96) & 0xFFFFFFFF for prime in _primes(ROUNDS)]
H0: Final = np.array([math.isqrt(p << 64) & 0xFFFFFFFF for p in _primes(8)], np.uint32)


def last_blocks(content: bytes | memoryview) -> bytes:
    """What is left of a content behind its whole blocks, padded to one block or two (5.1.1)."""
    rest = bytes(content[len(content) - len(content) % BLOCK_BYTES :]) + b"\x80"
    zeros = -(len(rest) + _LENGTH_BYTES) % BLOCK_BYTES
    return rest + bytes(zeros) + (8 * len(content)).to_bytes(_LENGTH_BYTES, "big")


def address(content: bytes | memoryview) -> int:
    """Where a content lies; an empty one, of which nothing is read, lies nowhere."""
    return np.frombuffer(content, np.uint8).ctypes.data if content else 0
