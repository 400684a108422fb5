"""Where the files of one attempt go while it is converted."""

from __future__ import annotations

import shutil
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from carstage.files.hashing import hash_of, hash_of_file
from carstage.files.whole import whole_file
from carstage.storage.marker import FileEntry

if TYPE_CHECKING:
    from carstage.files.streaming import FileStream


class FileWriter(Protocol):
    """Takes whole files, one after the other."""

    def write(self, name: str, content: bytes | memoryview) -> FileEntry:
        """Write a file; it is there at the end of the block at the latest.

        Args:
            name: POSIX path relative to the attempt.
            content: all of it; it must not change before the end of the block.

        Returns:
            Its entry, hashed from memory while it is being written.

        Raises:
            OSError, StorageError: a file before it could not be written.
        """


class AttemptFiles(ABC):
    """The files of one attempt, which a store gives out (``Store.attempt_files``).

    It can be pickled: the processes that convert write by it, each on its own. A file is never seen
    half written under its name.
    """

    @abstractmethod
    def stream(self) -> AbstractContextManager[FileWriter]:
        """A block in which many files are written; they are there when it has ended well."""

    @abstractmethod
    def whole(self, name: str) -> AbstractContextManager[Path]:
        """A path of this machine to write one file at, of any size.

        It becomes the attempt's file when the block ends well.
        """

    @abstractmethod
    def names(self) -> list[str]:
        """Paths of the files that are there, sorted."""

    @abstractmethod
    def holds(self, entry: FileEntry) -> bool:
        """Whether a file is there with the bytes that its entry names; it is read for that.

        Raises:
            OSError, StorageError: it cannot be read.
        """

    @abstractmethod
    def remove(self, names: Iterable[str]) -> None:
        """Remove files; those that are not there are none too many."""

    @abstractmethod
    def discard(self) -> None:
        """Remove all files."""


class FolderFiles(AttemptFiles):
    """An attempt in a folder of this machine.

    Args:
        folder: of the attempt; made when it is missing.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @contextmanager
    def stream(self) -> Iterator[FileWriter]:
        """See ``AttemptFiles.stream``; large files go past the page cache."""
        from carstage.files.streaming import FileStream  # loads numpy

        with FileStream() as files:
            yield _FolderWriter(self.folder, files)

    @contextmanager
    def whole(self, name: str) -> Iterator[Path]:
        """A hidden file beside it, which takes its name; see ``AttemptFiles.whole``."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            yield temporary

    def names(self) -> list[str]:
        """See ``AttemptFiles.names``."""
        found = (path for path in self.folder.rglob("*") if not path.is_dir())
        return sorted(path.relative_to(self.folder).as_posix() for path in found)

    def holds(self, entry: FileEntry) -> bool:
        """See ``AttemptFiles.holds``; a link out of the folder is no file of it."""
        path = self.folder / entry.path
        if not path.resolve().is_relative_to(self.folder.resolve()):
            return False
        with path.open("rb") as file:
            return hash_of_file(file, entry.hash) == (entry.hash, entry.bytes)

    def remove(self, names: Iterable[str]) -> None:
        """See ``AttemptFiles.remove``."""
        for name in names:
            (self.folder / name).unlink(missing_ok=True)

    def discard(self) -> None:
        """See ``AttemptFiles.discard``."""
        with suppress(FileNotFoundError):
            shutil.rmtree(self.folder)


class FilesBelow(AttemptFiles):
    """The files of an attempt below one of its folders; names are relative to that.

    Entries name files of the attempt, as its marker lists them.

    Args:
        files: the whole attempt's.
        folder: POSIX path relative to the attempt.
    """

    def __init__(self, files: AttemptFiles, folder: str) -> None:
        self._files = files
        self._prefix = f"{folder}/"

    @contextmanager
    def stream(self) -> Iterator[FileWriter]:
        """See ``AttemptFiles.stream``."""
        with self._files.stream() as files:
            yield _WriterBelow(files, self._prefix)

    def whole(self, name: str) -> AbstractContextManager[Path]:
        """See ``AttemptFiles.whole``."""
        return self._files.whole(self._prefix + name)

    def names(self) -> list[str]:
        """See ``AttemptFiles.names``."""
        prefix = self._prefix
        return [n.removeprefix(prefix) for n in self._files.names() if n.startswith(prefix)]

    def holds(self, entry: FileEntry) -> bool:
        """See ``AttemptFiles.holds``."""
        return entry.path.startswith(self._prefix) and self._files.holds(entry)

    def remove(self, names: Iterable[str]) -> None:
        """See ``AttemptFiles.remove``."""
        self._files.remove(self._prefix + name for name in names)

    def discard(self) -> None:
        """Remove all files below the folder."""
        self.remove(self.names())


class _WriterBelow:
    def __init__(self, files: FileWriter, prefix: str) -> None:
        self._files = files
        self._prefix = prefix

    def write(self, name: str, content: bytes | memoryview) -> FileEntry:
        return self._files.write(self._prefix + name, content)


class _FolderWriter:
    def __init__(self, folder: Path, files: FileStream) -> None:
        self._folder = folder
        self._files = files
        self._made = set[Path]()

    def write(self, name: str, content: bytes | memoryview) -> FileEntry:
        path = self._folder / name
        if path.parent not in self._made:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._made.add(path.parent)
        self._files.write(path, content)
        # From memory, while the file is being written.
        return FileEntry(name, len(content), hash_of(content))


def write_document(files: AttemptFiles, name: str, content: bytes) -> None:
    """Write one small file."""
    with files.whole(name) as path:
        path.write_bytes(content)
