"""What has been exported: listed, renamed, removed, sent as one file."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from carstage.storage.remote_files import remote_files
from carstage.storage.remote_path import DatasetPath, RemotePath
from carstage.web.archive import files_below, zipped
from carstage.web.datasets.jobs import JobService
from carstage.web.errors import WebError, not_found
from carstage.web.found_dataset import EXPORTS
from carstage.web.messages import ExportEntry, ExportList
from carstage.web.roots import Roots


class Exports:
    """The exports beside the datasets of the first root.

    Args:
        roots: where they are.
        jobs: knows which are being written.
    """

    def __init__(self, roots: Roots, jobs: JobService) -> None:
        self._roots = roots
        self._jobs = jobs
        self._lock = threading.Lock()
        self._kept: dict[tuple[str, float], ExportEntry] = {}

    def all(self) -> ExportList:
        """All whole exports, newest first."""
        found = [entry for place in self._places() if (entry := self._entry(place)) is not None]
        return ExportList(exports=sorted(found, key=lambda entry: -entry.changed))

    def place(self, name: str) -> DatasetPath:
        """Where an export is.

        Raises:
            WebError: there is none of that name.
        """
        from carstage.exporters.keeping import is_export

        place = self._roots.exports(name)
        if (isinstance(place, Path) and place.is_symlink()) or not is_export(place):
            raise not_found(f"export {name}")
        return place

    def rename(self, name: str, new: str) -> ExportEntry:
        """Give an export's folder another name.

        Raises:
            WebError: there is none, it is being written, or a store would have to copy it.
            BadInputError: something has that name.
        """
        from carstage.exporters.keeping import move_export

        place, target = self._unused(name), self._roots.exports(new)
        if not isinstance(place, Path) or not isinstance(target, Path):
            raise WebError(
                409, "An object store cannot rename what it holds.", "Export it under another name."
            )
        move_export(place, target)
        entry = self._entry(target)
        if entry is None:
            raise not_found(f"export {new}")
        return entry

    def remove(self, name: str) -> None:
        """Remove an export.

        Raises:
            WebError: there is none, or it is being written.
            StorageError: something cannot be removed.
        """
        from carstage.exporters.keeping import remove_export

        remove_export(self._unused(name))

    def archive(self, name: str) -> Iterator[bytes]:
        """An export as a ZIP archive.

        Raises:
            WebError: there is none.
        """
        place = self.place(name)
        if isinstance(place, RemotePath):
            below = ((str(path.relative_to(place)), path) for path in place.rglob("*"))
            return zipped((f"{name}/{path}", file) for path, file in below)
        return zipped((f"{name}/{path}", file) for path, file in files_below(place))

    def _unused(self, name: str) -> DatasetPath:
        place = self.place(name)
        if self._jobs.writes(name):
            raise WebError(409, "This export is being written.", "Wait, or cancel it.")
        return place

    def _places(self) -> Iterator[DatasetPath]:
        first = self._roots.roots[0]
        if isinstance(first, RemotePath):
            for name in remote_files(f"{first}/{EXPORTS}").folders(""):
                yield first / EXPORTS / name
        elif (first / EXPORTS).is_dir():
            for path in (first / EXPORTS).iterdir():
                if path.is_dir() and not path.is_symlink() and not path.name.startswith("."):
                    yield path

    def _entry(self, place: DatasetPath) -> ExportEntry | None:
        from carstage.exporters.keeping import read_export, size_of_export
        from carstage.exporters.target import DOCUMENT

        try:
            changed = (place / DOCUMENT).stat().st_mtime
        except OSError:
            return None
        key = str(place), changed
        with self._lock:
            if key in self._kept:
                return self._kept[key]
        document = read_export(place)
        if document is None:
            return None
        entry = ExportEntry(
            name=place.name,
            format=_text(document, "format"),
            dataset=_text(document, "dataset"),
            frames=_number(document, "frames"),
            bytes=size_of_export(place),
            changed=changed,
            location=str(place),
        )
        with self._lock:
            self._kept = {k: v for k, v in self._kept.items() if k[0] != key[0]} | {key: entry}
        return entry


def _text(document: Any, key: str) -> str:
    return str(document.get(key) or "")[:200]


def _number(document: Any, key: str) -> int:
    value = document.get(key)
    return value if isinstance(value, int) else 0
