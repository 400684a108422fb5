"""Objects that were read, kept on this machine within a bound, for all processes."""

from __future__ import annotations

import os
import secrets
import shutil
import time
from contextlib import suppress
from pathlib import Path

from blake3 import blake3

from carstage.cache import cache_folder
from carstage.storage.remote_files import RemoteFiles
from carstage.storage.remote_path import RemotePath

CACHE_BYTES_VARIABLE = "CARSTAGE_OBJECT_CACHE_MB"
"""Environment variable that bounds the cache, in megabytes."""
_DEFAULT_BYTES = 4 << 30
_UNCHANGING = ("episodes/", "maps/")
_LOOK_EVERY = 64 << 20
"""Bytes that are fetched between two looks at the size of the whole cache."""
_LEFT_S = 3600.0
"""A copy that is not whole after that time was left by a process that died."""
_KEEP = 0.8
"""Of the bound, what is left after clearing up."""

_fetched_bytes = 0


def open_copy(path: RemotePath, files: RemoteFiles, most_bytes: int) -> int:
    """A descriptor of the local copy of an object; see ``RemotePath.opened``.

    It is open before others may push the copy out of the cache.
    """
    version = ""
    if not path.key.startswith(_UNCHANGING):
        found = files.stat(path.key)
        version = f"{found.st_size} {found.st_mtime}"
    name = blake3(f"{path.root}\n{path.key}\n{version}".encode()).hexdigest()
    copy = _folder_of(path.root) / name
    with suppress(FileNotFoundError):
        os.utime(copy)  # what was used longest ago goes first
        return os.open(copy, os.O_RDONLY | os.O_CLOEXEC)
    copy.parent.mkdir(parents=True, exist_ok=True)
    temporary = copy.with_name(f".{name}.{secrets.token_hex(4)}")
    try:
        files.read_into(path.key, temporary, most_bytes)
        descriptor = os.open(temporary, os.O_RDONLY | os.O_CLOEXEC)
        temporary.replace(copy)
    finally:
        temporary.unlink(missing_ok=True)
    _bound(cache_folder() / "objects", os.fstat(descriptor).st_size)
    return descriptor


def forget_copies(root: str) -> None:
    """Remove the copies of a dataset that was removed: its names may come again with other data.

    Those of others stay: somebody may be writing one.

    Args:
        root: address of the dataset.
    """
    shutil.rmtree(_folder_of(root), ignore_errors=True)


def _folder_of(root: str) -> Path:
    return cache_folder() / "objects" / blake3(root.encode()).hexdigest(8)


def cache_bytes() -> int:
    """The bound of the cache."""
    return int(float(os.environ.get(CACHE_BYTES_VARIABLE) or 0) * 1e6) or _DEFAULT_BYTES


def _bound(folder: Path, new_bytes: int) -> None:
    """Remove what was used longest ago, now and then, where the cache is larger than it may be."""
    global _fetched_bytes
    most_bytes = cache_bytes()
    _fetched_bytes += new_bytes
    if _fetched_bytes < min(_LOOK_EVERY, most_bytes):
        return
    _fetched_bytes = 0
    kept = []
    for entry in folder.glob("*/*"):
        with suppress(FileNotFoundError):
            found = entry.stat()
            if entry.name.startswith(".") and time.time() - found.st_mtime < _LEFT_S:
                continue  # somebody is writing it
            kept.append((found.st_mtime, found.st_size, entry))
    size = sum(one[1] for one in kept)
    if size <= most_bytes:
        return
    for _, entry_bytes, entry in sorted(kept):
        if size <= _KEEP * most_bytes:
            break
        entry.unlink(missing_ok=True)
        size -= entry_bytes
