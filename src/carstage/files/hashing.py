"""Hashes of whole files, with the name of their algorithm: ``blake3:<hex>``.

New hashes are BLAKE3. SHA-256 is read as well: datasets of format version 1 have it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any, BinaryIO, Final

from blake3 import blake3

_NEW: Final = "blake3"
_ALGORITHMS: Final[dict[str, Callable[..., Any]]] = {_NEW: blake3, "sha256": hashlib.sha256}
_CHUNK_BYTES: Final = 1 << 20


class UnknownAlgorithmError(ValueError):
    """A hash whose algorithm this version does not know."""


def hash_of(content: bytes | memoryview, like: str = _NEW) -> str:
    """The named hash of a content.

    Args:
        content: all bytes of the file.
        like: an algorithm, or a hash whose algorithm is used.

    Returns:
        ``<algorithm>:<lower-case hex digest>``.

    Raises:
        UnknownAlgorithmError: of that name.
    """
    name, new = _algorithm(like)
    return f"{name}:{new(content).hexdigest()}"


def hash_of_file(file: BinaryIO, like: str = _NEW) -> tuple[str, int]:
    """The named hash of what is left to read of an open file, and its size in bytes.

    Args:
        file: open for reading.
        like: an algorithm, or a hash whose algorithm is used.

    Raises:
        OSError: the file cannot be read.
        UnknownAlgorithmError: of that name.
    """
    name, new = _algorithm(like)
    digest, size = new(), 0
    while chunk := file.read(_CHUNK_BYTES):
        digest.update(chunk)
        size += len(chunk)
    return f"{name}:{digest.hexdigest()}", size


def check_hash(named: str) -> str:
    """Return a named hash whose algorithm is known.

    Raises:
        UnknownAlgorithmError: of its name.
        ValueError: there is no digest.
    """
    _algorithm(named)
    if not named.partition(":")[2]:
        raise ValueError(f"{named!r} has no digest")
    return named


def _algorithm(like: str) -> tuple[str, Callable[..., Any]]:
    name = like.partition(":")[0]
    if name not in _ALGORITHMS:
        known = " and ".join(_ALGORITHMS)
        raise UnknownAlgorithmError(
            f"hash algorithm {name!r} is unknown; this version knows {known}"
        )
    return name, _ALGORITHMS[name]
