"""Datasets below a place in an object store: looked for in the background, the last look is shown.

To list a store takes from milliseconds to minutes, where it is away. So requests never wait for it
but for the first look, and for one after something was made or removed here.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

from carstage.errors import CarStageError
from carstage.storage.remote_files import RemoteFiles, remote_files
from carstage.storage.remote_path import RemotePath
from carstage.web.found_dataset import (
    INSIDE,
    FoundDataset,
    dataset_id,
    is_marker,
    shown_path,
)

_DEPTH = 3
_MOST_FOLDERS = 1000
_FRESH_S = 10.0
_FIRST_WAIT_S = 5.0
_AT_ONCE = 16


class RemoteRoot:
    """One place in an object store; safe to use from several threads.

    Args:
        place: where it is.
        number: which root it is; None: it is a dataset itself that lies in no root.
        clock_s: what time it is.
    """

    def __init__(
        self, place: RemotePath, number: int | None, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self.place = place
        self.problem = ""
        self._number = number
        self._clock_s = clock_s
        self._lock = threading.Lock()
        self._found: tuple[FoundDataset, ...] = ()
        self._looked_s: float | None = None
        self._look: threading.Thread | None = None
        self._outdated = False
        self._wait = True

    def datasets(self) -> tuple[FoundDataset, ...]:
        """What the last look has found; a new one begins when that is some seconds old."""
        with self._lock:
            stale = self._looked_s is None or self._clock_s() - self._looked_s >= _FRESH_S
            if stale and self._look is None:
                name = f"look at {self.place}"
                self._look = threading.Thread(target=self._look_anew, name=name, daemon=True)
                self._look.start()
            look, wait = self._look, self._wait
            self._wait = False  # of a store that is away, only the first waits
        if wait and look is not None:
            look.join(_FIRST_WAIT_S)
        with self._lock:
            return self._found

    def forget(self) -> None:
        """Wait for a new look at the next question: something was made or removed."""
        with self._lock:
            self._looked_s, self._wait = None, True
            self._outdated = self._look is not None

    def _look_anew(self) -> None:
        try:
            found, problem = tuple(self._looked()), ""
        except CarStageError as error:
            found, problem = self._found, f"{error.message} {error.hint}".strip()
        with self._lock:
            self._found, self.problem = found, problem
            # A look that had begun before something was removed may still have seen it.
            self._looked_s = None if self._outdated else self._clock_s()
            self._outdated, self._look = False, None

    def _looked(self) -> Iterator[FoundDataset]:
        """The datasets, nearest first.

        Raises:
            StorageError: the store cannot be reached, or lets nobody look.
        """
        files = remote_files(self.place.root)
        level, seen = [""], 0
        with ThreadPoolExecutor(_AT_ONCE) as threads:
            for _ in range(1 if self._number is None else _DEPTH):
                below: list[str] = []
                seen += len(level)
                for key, (folders, names) in zip(
                    level, threads.map(files.listing, level), strict=True
                ):
                    if "dataset.json" in names or "commits" in folders:
                        yield self._dataset(files, key)
                        if key:
                            continue  # below a root that is one itself there may be others
                    inside = [name for name in folders if name not in INSIDE and name[0] != "."]
                    below += [f"{key}/{name}" if key else name for name in inside]
                level = below[: _MOST_FOLDERS - seen]

    def _dataset(self, files: RemoteFiles, key: str) -> FoundDataset:
        place = RemotePath(f"{self.place.root}/{key}" if key else self.place.root)
        markers = [
            (one.key.rpartition("/")[2].removesuffix(".json"), one.modified_s)
            for one in files.below(f"{key}/commits" if key else "commits")
            if is_marker(one.key.rpartition("/")[2])
        ]
        return FoundDataset(
            dataset_id(place, self.place, self._number),
            place,
            shown_path(place, self.place),
            tuple(sorted(markers)),
        )
