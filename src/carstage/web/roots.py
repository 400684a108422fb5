"""The folders that the server may touch, and the datasets in them.

A dataset is found by looking: only what a scan of the roots has listed has an id, so no request can
name a path outside.
"""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from carstage.errors import BadInputError
from carstage.web.errors import not_found

EXPORTS = "exports"
"""Folder below the first root that exports are made in; it is not looked through for datasets."""

_DEPTH = 3
_MOST_FOLDERS = 5000
_FRESH_S = 1.0
_SAFE = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-")


@dataclass(frozen=True, slots=True)
class FoundDataset:
    """A folder with ``dataset.json``, or one in which a run has begun to make one.

    Attributes:
        dataset: its id.
        path: its folder, resolved.
        shown: its path below the root, for people.
    """

    dataset: str
    path: Path
    shown: str


class Roots:
    """The roots; safe to use from several threads.

    Args:
        roots: existing folders.
    """

    def __init__(
        self, roots: tuple[Path, ...], clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self.roots = tuple(root.resolve() for root in roots)
        self._clock_s = clock_s
        self._lock = threading.Lock()
        self._found: dict[str, FoundDataset] = {}
        self._looked_s = -_FRESH_S

    def datasets(self) -> dict[str, FoundDataset]:
        """All datasets by id; looked for anew when the last look is a second old."""
        with self._lock:
            now_s = self._clock_s()
            if now_s - self._looked_s >= _FRESH_S:
                self._found = {found.dataset: found for found in self._look()}
                self._looked_s = now_s
            return dict(self._found)

    def forget(self) -> None:
        """Look anew at the next question: something was made or removed."""
        with self._lock:
            self._looked_s = -_FRESH_S

    def dataset(self, dataset: str) -> FoundDataset:
        """One dataset.

        Raises:
            WebError: there is none of that id.
        """
        found = self.datasets().get(dataset)
        if found is None:
            self.forget()  # it may have been made within the second
            found = self.datasets().get(dataset)
        if found is None:
            raise not_found(f"dataset {dataset}")
        return found

    def new(self, name: str) -> Path:
        """The folder of a dataset to be made in, or continued in, the first root.

        Raises:
            BadInputError: the name is none of a folder here.
        """
        if not name or name[0] in ".-" or not set(name) <= _SAFE:
            raise BadInputError(
                f"{name!r} cannot be the name of a dataset's folder.",
                "Use letters, digits, '_', '.' and '-'.",
            )
        return self.confine(name)

    def confine(self, path: str) -> Path:
        """A path, relative to the first root or absolute, that lies in a root, links resolved.

        Raises:
            BadInputError: it lies outside, or is no path.
        """
        try:
            resolved = (self.roots[0] / path).resolve()
        except (OSError, ValueError, RuntimeError) as error:  # NUL, links in a circle
            raise BadInputError("This is no path.", "Give one below the datasets.") from error
        if not any(resolved.is_relative_to(root) for root in self.roots):
            raise BadInputError(
                "This path lies outside the folders of this server.",
                "Start `carstage gui --datasets DIR` with its folder.",
            )
        return resolved

    def free_bytes(self) -> int:
        """Free space where datasets are made."""
        return shutil.disk_usage(self.roots[0]).free

    def _look(self) -> Iterator[FoundDataset]:
        for number, root in enumerate(self.roots):
            seen = 0
            level = [root]
            for _ in range(_DEPTH):
                below: list[Path] = []
                for folder in level:
                    seen += 1
                    if seen > _MOST_FOLDERS:
                        return
                    if _is_dataset(folder):
                        yield _found(folder, root, number)
                    elif folder != root / EXPORTS:
                        below += _folders(folder)
                level = below


def _folders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = [
                entry.name
                for entry in entries
                if entry.is_dir(follow_symlinks=False) and not entry.name.startswith(".")
            ]
    except OSError:
        return []  # not ours to read: nothing to show
    return [folder / name for name in sorted(names)]


def _is_dataset(folder: Path) -> bool:
    return (folder / "dataset.json").is_file() or (folder / "commits").is_dir()


def _found(folder: Path, root: Path, number: int) -> FoundDataset:
    shown = folder.relative_to(root).as_posix()
    parts = root.name if shown == "." else shown.replace("/", "~")
    plain = "".join(c if c in _SAFE or c == "~" else "_" for c in parts).lstrip("._-~") or "dataset"
    if plain != parts:  # two names may look alike without their odd letters
        plain = f"{plain}~{folder.stat().st_ino:x}"
    dataset = plain if number == 0 else f"{plain}~r{number}"
    return FoundDataset(dataset, folder, root.name if shown == "." else shown)
