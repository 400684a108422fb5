"""Paths in an object store that read like those of a folder."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from carstage.storage.remote_files import RemoteFiles


@dataclass(frozen=True, slots=True)
class RemoteStat:
    """What is known of an object without reading it.

    Attributes:
        st_size: its size in bytes.
        st_mtime: when it was written, Unix time.
    """

    st_size: int
    st_mtime: float


@dataclass(frozen=True, slots=True, order=True)
class RemotePath:
    """A place below the root of a dataset in an object store.

    It has those methods of ``pathlib.Path`` that readers of datasets use. Every method that asks
    the store raises ``RemoteStoreError`` where it cannot be reached. It can be pickled: each
    process has connections of its own.

    Args:
        root: address of the dataset, such as ``s3://bucket/prefix``.
        key: path below it; empty for the root itself.
    """

    root: str
    key: str = ""

    def __truediv__(self, other: str) -> RemotePath:
        return RemotePath(self.root, f"{self.key}/{other}" if self.key else str(other))

    def __str__(self) -> str:
        return f"{self.root}/{self.key}" if self.key else self.root

    @property
    def _pure(self) -> PurePosixPath:
        return PurePosixPath(self.key)

    @property
    def name(self) -> str:
        """Its last part."""
        return self._pure.name or self.root.rpartition("/")[2]

    @property
    def suffix(self) -> str:
        """The ending of its name, with the dot."""
        return self._pure.suffix

    @property
    def stem(self) -> str:
        """Its name without the ending."""
        return self._pure.stem

    @property
    def parent(self) -> RemotePath:
        """What it lies in; of the root, the root."""
        return RemotePath(self.root, "" if "/" not in self.key else self.key.rpartition("/")[0])

    @property
    def parents(self) -> tuple[RemotePath, ...]:
        """All that it lies in, the nearest first, the root last."""
        above = [self.parent]
        while above[-1].key:
            above.append(above[-1].parent)
        return tuple(above)

    def relative_to(self, other: RemotePath | Path) -> PurePosixPath:
        """Its path below another one of the same dataset.

        Raises:
            ValueError: it is not below that one.
        """
        if not isinstance(other, RemotePath) or other.root != self.root:
            raise ValueError(f"{self} is not below {other}")
        return self._pure.relative_to(other.key)

    def as_posix(self) -> str:
        """Its address."""
        return str(self)

    def resolve(self) -> RemotePath:
        """Itself: object stores have no links."""
        return self

    def absolute(self) -> RemotePath:
        """Itself."""
        return self

    def is_file(self) -> bool:
        """Whether there is an object of this name."""
        return self._files.size(self.key) is not None

    def is_dir(self) -> bool:
        """Whether an object lies below it."""
        return self._files.has_any(self.key)

    def exists(self) -> bool:
        """Whether there is an object of this name or below it."""
        return self.is_file() or self.is_dir()

    def stat(self) -> RemoteStat:
        """Size and time of the object.

        Raises:
            FileNotFoundError: there is none.
        """
        return self._files.stat(self.key)

    def rglob(self, pattern: str) -> Iterator[RemotePath]:
        """The objects below it whose name fits a pattern; there are no folders among them."""
        for found in self._files.below(self.key):
            if fnmatch.fnmatchcase(found.key.rpartition("/")[2], pattern):
                yield RemotePath(self.root, found.key)

    def read_bytes(self) -> bytes:
        """The whole object, as it is now.

        Raises:
            FileNotFoundError: there is none.
        """
        return self._files.read(self.key)

    def write_bytes(self, content: bytes) -> None:
        """Make the object, or replace it; nobody sees half of it."""
        self._files.write(self.key, content)

    def opened(self, most_bytes: int) -> int:
        """A descriptor to read the object's content by, from the cache where it is there.

        Files of episodes and maps never change under their names, so they are asked for once.

        Args:
            most_bytes: the largest size that is fetched.

        Raises:
            OSError: there is no such object, it is larger, or the disk is full.
        """
        from carstage.storage.object_cache import open_copy

        return open_copy(self, self._files, most_bytes)

    @property
    def _files(self) -> RemoteFiles:
        from carstage.storage.remote_files import remote_files

        return remote_files(self.root)


DatasetPath: TypeAlias = Path | RemotePath
"""A place in a dataset, on a disk or in an object store."""
