"""A dataset that a look at the roots has found, its id, and the markers of its episodes."""

from __future__ import annotations

import os
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from carstage.storage.remote_path import DatasetPath, RemotePath

EXPORTS = "exports"
"""Folder below the first root that exports are made in; it is not looked through for datasets."""
INSIDE = frozenset({"commits", "episodes", "leases", "maps", "runs", EXPORTS})
"""Folders of datasets, and of exports: no datasets are looked for in them."""
_SAFE = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-")
_SUFFIX = ".json"


@dataclass(frozen=True, slots=True)
class FoundDataset:
    """A place with ``dataset.json``, or one in which a run has begun to make one.

    Attributes:
        dataset: its id.
        path: its folder, resolved, or its place in an object store.
        shown: its path below the root, for people.
        listed: of a place in an object store: its commit markers, as the last look has found them.
    """

    dataset: str
    path: DatasetPath
    shown: str
    listed: tuple[tuple[str, float], ...] = ()

    @property
    def is_remote(self) -> bool:
        """Whether it lies in an object store."""
        return isinstance(self.path, RemotePath)

    def markers(self) -> dict[str, float]:
        """When each committed episode was committed, Unix time, by its id, sorted by id."""
        if not isinstance(self.path, Path):
            return dict(self.listed)
        found = []
        with suppress(OSError), os.scandir(self.path / "commits") as entries:
            for entry in entries:
                if is_marker(entry.name):
                    with suppress(FileNotFoundError):  # it has just been removed
                        changed_s = entry.stat().st_mtime_ns / 1e9
                        found.append((entry.name.removesuffix(_SUFFIX), changed_s))
        return dict(sorted(found))

    def changed(self) -> float | None:
        """When an episode came or went last, as far as is known; None: there are none."""
        if isinstance(self.path, Path):
            with suppress(OSError):
                return (self.path / "commits").stat().st_mtime
        return max(self.markers().values(), default=None)

    def fingerprint(self) -> str:
        """Changes when an episode is committed or removed."""
        return "|".join(f"{name}:{changed_s}" for name, changed_s in self.markers().items())


def is_marker(name: str) -> bool:
    """Whether a file in ``commits`` is a commit marker."""
    return name.endswith(_SUFFIX) and not name.startswith(".")


def dataset_id(place: DatasetPath, root: DatasetPath, number: int | None) -> str:
    """The id of a dataset: its path below its root, and which root that is.

    Args:
        place: where it is.
        root: the root that it lies in, or itself.
        number: of the root; None: it lies in none.
    """
    parts = _below(place, root).replace("/", "~")
    plain = "".join(c if c in _SAFE or c == "~" else "_" for c in parts).lstrip("._-~") or "dataset"
    if plain != parts:  # two names may look alike without their odd letters
        plain = f"{plain}~{zlib.crc32(os.fsencode(str(place))):x}"
    if number is None:
        return f"{plain}~u{zlib.crc32(str(place).encode()):x}"
    return plain if number == 0 else f"{plain}~r{number}"


def shown_path(place: RemotePath, root: RemotePath) -> str:
    """The path of a dataset in an object store below its root, for people."""
    return _below(place, root)


def _below(place: DatasetPath, root: DatasetPath) -> str:
    if place == root:
        return root.name
    return str(place)[len(str(root)) :].strip("/")
