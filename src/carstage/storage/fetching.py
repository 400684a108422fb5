"""Files of an object store that come into the cache before they are read, many at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress

from carstage.errors import StorageError
from carstage.files.bounded import LARGEST_FILE_BYTES
from carstage.storage.object_cache import cache_bytes
from carstage.storage.remote_path import DatasetPath, RemotePath

_READERS = 16
_SHARE = 0.25
"""Of the cache, what may be fetched ahead: it has to stay until it is read."""


@contextmanager
def fetched_ahead(files: Sequence[tuple[DatasetPath, int]]) -> Iterator[None]:
    """A stretch in which files are fetched in the order given; whoever reads need not wait.

    Files of this machine are left alone, as are those that are too many for the cache. What fails
    is told where the file is read.

    Args:
        files: each with its size in bytes; they never change under their names.
    """
    wanted = [path for path, _ in files if isinstance(path, RemotePath)]
    if not wanted or sum(size for _, size in files) > _SHARE * cache_bytes():
        yield
        return
    with ThreadPoolExecutor(_READERS, thread_name_prefix="fetch") as threads:
        tasks = [threads.submit(_fetch, path) for path in wanted]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()


def _fetch(path: RemotePath) -> None:
    with suppress(OSError, StorageError):
        os.close(path.opened(LARGEST_FILE_BYTES))
