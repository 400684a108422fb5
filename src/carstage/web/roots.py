"""The places that the server may touch, and the datasets in them.

A dataset is found by looking: only what a scan of the roots has listed has an id, so no request can
name a path outside. Places in object stores are looked at in the background (``remote_roots``).
"""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from carstage.errors import BadInputError
from carstage.files.home import without_tilde
from carstage.storage.address import dataset_root
from carstage.storage.remote_path import DatasetPath, RemotePath
from carstage.web.errors import not_found
from carstage.web.found_dataset import EXPORTS, INSIDE, FoundDataset, dataset_id
from carstage.web.remote_roots import RemoteRoot

_DEPTH = 3
_MOST_FOLDERS = 5000
_FRESH_S = 1.0
_SAFE = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-")


class Roots:
    """The roots; safe to use from several threads.

    Args:
        roots: existing folders, and places in object stores; new datasets are made in the first.
        clock_s: what time it is.
        home: what relative paths are relative to; default: the first folder.
        writable: further folders that runs may work in.
    """

    def __init__(
        self,
        roots: Sequence[DatasetPath],
        clock_s: Callable[[], float] = time.monotonic,
        *,
        home: Path | None = None,
        writable: Sequence[Path] = (),
    ) -> None:
        self.roots = tuple(root.resolve() for root in roots)
        self._local = tuple(root for root in self.roots if isinstance(root, Path))
        self.home = (home or self._local[0]).resolve()
        self._writable = (*self._local, *(folder.resolve() for folder in writable))
        self._clock_s = clock_s
        self._lock = threading.Lock()
        self._found: dict[str, FoundDataset] = {}
        self._looked_s = -_FRESH_S
        self._remote = [
            RemoteRoot(root, number, clock_s)
            for number, root in enumerate(self.roots)
            if isinstance(root, RemotePath)
        ]

    def datasets(self) -> dict[str, FoundDataset]:
        """All datasets by id; looked for anew when the last look is a second old."""
        with self._lock:
            now_s = self._clock_s()
            if now_s - self._looked_s >= _FRESH_S:
                self._found = {found.dataset: found for found in self._look()}
                self._looked_s = now_s
            found = dict(self._found)
            remote = list(self._remote)
        for root in remote:
            found.update((one.dataset, one) for one in root.datasets())
        return found

    def forget(self) -> None:
        """Look anew at the next question: something was made or removed."""
        with self._lock:
            self._looked_s = -_FRESH_S
            remote = list(self._remote)
        for root in remote:
            root.forget()

    def problems(self) -> list[str]:
        """What is wrong with places in object stores, a sentence each."""
        with self._lock:
            remote = list(self._remote)
        return [root.problem for root in remote if root.problem]

    def add(self, address: RemotePath) -> None:
        """Show one more dataset, which lies outside of the roots: a run records into it."""
        with self._lock:
            inside = any(_inside(address, root) for root in self.roots)
            if not inside and all(root.place != address for root in self._remote):
                self._remote.append(RemoteRoot(address, None, self._clock_s))

    def id_of(self, out: DatasetPath) -> str:
        """The id of a dataset that is, or will be, at a place."""
        for number, root in enumerate(self.roots):
            if _inside(out, root):
                return dataset_id(out, root, number)
        return dataset_id(out, out, None)

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

    def new(self, name: str) -> DatasetPath:
        """The place of a dataset to be made in, or continued in, the first root.

        Raises:
            BadInputError: the name is none of a folder here.
        """
        if not name or name[0] in ".-" or not set(name) <= _SAFE:
            raise BadInputError(
                f"{name!r} cannot be the name of a dataset's folder.",
                "Use letters, digits, '_', '.' and '-'.",
            )
        first = self.roots[0]
        if isinstance(first, RemotePath):
            return RemotePath(f"{first}/{name}")
        return self.confine(name)

    def destination(self, text: str) -> DatasetPath:
        """Where a run may record: a name in the first root, or an address of an object store.

        Raises:
            BadInputError: it is neither.
        """
        if ":" not in text:
            return self.new(text)
        place = dataset_root(text)
        if isinstance(place, RemotePath):
            return place
        raise BadInputError(
            "A folder is named by its name alone; it is made in the first folder of datasets.",
            "Name it so, or give s3://, gs:// or az:// and a bucket.",
        )

    def exports(self, name: str) -> DatasetPath:
        """The place of an export of a name.

        Raises:
            BadInputError: the name is none of a folder.
        """
        self.new(name)  # its name is none of a path
        first = self.roots[0]
        if isinstance(first, RemotePath):
            return RemotePath(f"{first}/{EXPORTS}/{name}")
        return self.confine(f"{EXPORTS}/{name}")

    def work(self, text: str) -> Path:
        """A folder of this machine that a run may work in.

        Raises:
            BadInputError: it lies outside of those that this server may write to.
        """
        try:
            resolved = (self.home / without_tilde(text)).resolve()
        except (OSError, ValueError, RuntimeError) as error:
            raise BadInputError("This is no path.", "Give one below the datasets.") from error
        if not any(resolved.is_relative_to(folder) for folder in self._writable):
            raise BadInputError(
                "This work folder lies outside the folders of this server.",
                "Choose one inside them, or leave it empty.",
            )
        return resolved

    def confine(self, path: str) -> Path:
        """A path, relative to the first folder or absolute, that lies in one, links resolved.

        Raises:
            BadInputError: it lies outside, or is no path.
        """
        try:
            resolved = (self.home / path).resolve()
        except (OSError, ValueError, RuntimeError) as error:  # NUL, links in a circle
            raise BadInputError("This is no path.", "Give one below the datasets.") from error
        if not any(resolved.is_relative_to(root) for root in self._local):
            raise BadInputError(
                "This path lies outside the folders of this server.",
                "Choose one inside them.",
            )
        return resolved

    def free_bytes(self) -> int:
        """Free space where datasets are made; of an object store, where runs work for it."""
        return shutil.disk_usage(self.home).free

    def _look(self) -> Iterator[FoundDataset]:
        for number, root in enumerate(self.roots):
            if isinstance(root, Path):
                for folder in _datasets_below(root):
                    yield FoundDataset(
                        dataset_id(folder, root, number), folder, _shown(folder, root)
                    )


def _datasets_below(root: Path) -> Iterator[Path]:
    """Folders of datasets, as far as a look goes through the folders of a root."""
    seen = 0
    level = [root]
    for _ in range(_DEPTH):
        below: list[Path] = []
        for folder in level:
            seen += 1
            if seen > _MOST_FOLDERS:
                return
            if _is_dataset(folder):
                yield folder
                if folder == root:  # others may lie in it: those that are recorded here do
                    below += [one for one in _folders(folder) if one.name not in INSIDE]
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


def _shown(folder: Path, root: Path) -> str:
    shown = folder.relative_to(root).as_posix()
    return root.name if shown == "." else shown


def _inside(place: DatasetPath, root: DatasetPath) -> bool:
    if isinstance(place, RemotePath) or isinstance(root, RemotePath):
        return type(place) is type(root) and f"{place}/".startswith(f"{root}/")
    return place.is_relative_to(root)
