"""Many whole files of some size, written beside the work that makes them."""

from __future__ import annotations

import errno
import fcntl
import os
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Final

import numpy as np

from carstage.files.whole import whole_file, write_whole

_DIRECT_FROM_BYTES: Final = 1 << 19
"""Smaller files gain nothing."""
_BLOCK_BYTES: Final = 4096
"""Disks take whole blocks of memory and file; none has larger ones."""
_IN_FLIGHT: Final = 2
_NOT_POSSIBLE: Final = (errno.EINVAL, errno.EOPNOTSUPP)


class FileStream:
    """Writes whole files past the page cache, while the caller makes the next one.

    A file that is written once and read much later gains nothing there: it costs a copy into pages
    that the host of a virtual machine may have to find first, and waits for the disk all the same
    before it counts. Small files go through the page cache, and so does what a file system does
    not take past it.

    A context manager; when its block ends well, all files have their names. Not for use by several
    threads at once.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="file-stream")
        self._under_way: deque[Future[None]] = deque()

    def __enter__(self) -> FileStream:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._thread.shutdown()
        while kind is None and self._under_way:
            self._under_way.popleft().result()

    def write(self, path: Path, content: bytes | memoryview) -> None:
        """Write a file that is never seen half written under its own name.

        Waits while two others are under way.

        Args:
            path: its name.
            content: all of it; it must not change before the end of the block.

        Raises:
            OSError: a file before it could not be written; what is still under way then, the end
                of the block raises.
        """
        if len(content) < _DIRECT_FROM_BYTES:
            write_whole(path, content, on_its_way=True)
            return
        if len(self._under_way) == _IN_FLIGHT:
            self._under_way.popleft().result()
        self._under_way.append(self._thread.submit(_write, path, _at_a_block(content)))


def _at_a_block(content: bytes | memoryview) -> memoryview:
    """The content, copied if need be to begin where a block of memory does."""
    if not np.frombuffer(content, np.uint8).ctypes.data % _BLOCK_BYTES:
        return memoryview(content)
    room = np.empty(len(content) + _BLOCK_BYTES, np.uint8)
    begin = -room.ctypes.data % _BLOCK_BYTES
    copy = room[begin : begin + len(content)]
    copy[:] = np.frombuffer(content, np.uint8)
    return copy.data


def _write(path: Path, content: memoryview) -> None:
    with whole_file(path) as temporary, temporary.open("wb", buffering=0) as file:
        written = _write_blocks(file.fileno(), content)
        while written < len(content):
            written += os.pwrite(file.fileno(), content[written:], written)


def _write_blocks(descriptor: int, content: memoryview) -> int:
    """Write whole blocks past the page cache, as far as that can be done; how many bytes."""
    blocks = content[: len(content) // _BLOCK_BYTES * _BLOCK_BYTES]
    flags = fcntl.fcntl(descriptor, fcntl.F_GETFL)
    written = 0
    try:
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags | os.O_DIRECT)
        while written < len(blocks) and not written % _BLOCK_BYTES:
            written += os.pwrite(descriptor, blocks[written:], written)
    except OSError as error:
        if error.errno not in _NOT_POSSIBLE:
            raise
    fcntl.fcntl(descriptor, fcntl.F_SETFL, flags)
    return written
