"""Files as one ZIP archive, sent while it is made: nothing of it is kept here."""

from __future__ import annotations

import io
import os
import stat
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from carstage.files.bounded import open_regular
from carstage.storage.remote_path import DatasetPath

_PIECE_BYTES = 1 << 20


class _Pipe(io.RawIOBase):
    """Holds what was written until it is taken."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, data: bytes) -> int:  # type: ignore[override]
        self._pieces.append(bytes(data))
        return len(data)

    def take(self) -> bytes:
        taken, self._pieces = b"".join(self._pieces), []
        return taken


def zipped(entries: Iterable[tuple[str, DatasetPath]]) -> Iterator[bytes]:
    """The pieces of an archive; files are stored as they are, as most are compressed already.

    Args:
        entries: names in the archive, and what they hold.

    Raises:
        OSError: a file cannot be read; what was sent so far is no whole archive.
    """
    pipe = _Pipe()
    with zipfile.ZipFile(pipe, "w", zipfile.ZIP_STORED) as archive:
        for name, path in entries:
            with os.fdopen(open_regular(path), "rb") as source:
                entry = zipfile.ZipInfo(name)
                entry.external_attr = (stat.S_IFREG | 0o644) << 16
                with archive.open(entry, "w", force_zip64=True) as target:
                    while piece := source.read(_PIECE_BYTES):
                        target.write(piece)
                        yield pipe.take()
            yield pipe.take()
    yield pipe.take()


def files_below(folder: Path) -> Iterator[tuple[str, Path]]:
    """The regular files below a folder, sorted by name; links are left out."""
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            yield path.relative_to(folder).as_posix(), path
