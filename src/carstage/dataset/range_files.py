"""Files elsewhere as DuckDB reads them: through fsspec, in ranges, with the bytes counted.

DuckDB's own extensions for remote files would be downloaded when they are first used; this needs
none.
"""

from __future__ import annotations

import io
import threading
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Any

from fsspec import AbstractFileSystem

if TYPE_CHECKING:
    from carstage.dataset.querying import RangeFiles

_PROTOCOL = "carstage"
_LONG_AGO = datetime(2000, 1, 1, tzinfo=timezone.utc)


class CountedFiles(AbstractFileSystem):  # type: ignore[misc]
    """Read-only files by an address such as ``carstage://episodes/…``.

    Args:
        files: reads them.
    """

    protocol = _PROTOCOL
    prefix = f"{_PROTOCOL}://"
    cachable = False

    def __init__(self, files: RangeFiles) -> None:
        super().__init__()
        self._files = files
        self._lock = threading.Lock()
        self._bytes = 0
        self._sizes: dict[str, int] = {}

    def bytes_read(self) -> int:
        """Bytes that were read so far."""
        return self._bytes

    def read_range(self, path: str, start: int, end: int) -> bytes:
        """Bytes of a file, which are counted."""
        content = self._files.read(path, start, end)
        with self._lock:
            self._bytes += len(content)
        return content

    def size(self, path: str) -> int:
        """Size of a file (bytes), asked for once."""
        path = self._strip_protocol(path)
        if path not in self._sizes:
            self._sizes[path] = self._files.size(path)
        return self._sizes[path]

    def info(self, path: str, **options: Any) -> dict[str, Any]:
        """Name, size and type, as fsspec wants them."""
        del options
        path = self._strip_protocol(path)
        return {"name": path, "size": self.size(path), "type": "file"}

    def glob(self, path: str, **options: Any) -> list[str]:
        """The name itself: none has a wildcard. One that is missing is told when it is opened."""
        del options
        return [self._strip_protocol(path)]

    def modified(self, path: str) -> datetime:
        """Always the same time: committed files never change."""
        del path
        return _LONG_AGO

    def _open(self, path: str, mode: str = "rb", **options: Any) -> _RangeFile:
        del mode, options
        path = self._strip_protocol(path)
        return _RangeFile(self, path, self.size(path))


class _RangeFile(io.RawIOBase):
    """One open file; each read is one request."""

    def __init__(self, files: CountedFiles, path: str, size: int) -> None:
        self._files = files
        self._path = path
        self._size = size
        self._at = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        begin = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at = max(0, begin + offset)
        return self._at

    def read(self, size: int = -1) -> bytes:
        end = self._size if size < 0 else min(self._at + size, self._size)
        if end <= self._at:
            return b""
        content = self._files.read_range(self._path, self._at, end)
        self._at = end
        return content


def open_range_files(files: RangeFiles) -> CountedFiles:
    """A file system for ``connection.register_filesystem``."""
    return CountedFiles(files)
