"""Keeps a catalog up to date while a run commits; the run neither waits for it nor fails by it."""

from __future__ import annotations

import logging
import queue
import random
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Final

from carstage.catalog.address import CatalogAddress
from carstage.catalog.database import Catalog
from carstage.catalog.indexing import record_episode, record_run
from carstage.dataset import Dataset, Episode
from carstage.errors import CarStageError, CatalogLostError
from carstage.storage import DatasetPath
from carstage.storage.marker import read_marker

logger = logging.getLogger(__name__)

_MOST_WAITING: Final = 10_000
_FIRST_WAIT_S: Final = 0.25
_LONGEST_WAIT_S: Final = 10.0
_PATIENCE_S: Final = 120.0
"""How long one episode is tried, as a database is started again."""
_END_S: Final = 3.0
"""How long the end of a run waits for the catalog."""
_STOP_S: Final = 0.5


class CatalogFollower:
    """Writes episodes into a catalog from a thread of its own; a context manager.

    Entering opens the catalog, so that a wrong address ends the run before it starts anything.
    From then on nothing is raised: what cannot be written is told by one notice at the end.

    Args:
        address: of the catalog.
        place: of the dataset, as ``Dataset`` takes it; it exists when the first episode comes.
        notice: called with a sentence for the user, from the thread that leaves the context.
        patience_s: how long one episode is tried while the database is away.
    """

    def __init__(
        self,
        address: CatalogAddress,
        place: DatasetPath,
        notice: Callable[[str], None],
        *,
        patience_s: float = _PATIENCE_S,
    ) -> None:
        self._address = address
        self._place = place
        self._notice = notice
        self._patience_s = patience_s
        self._waiting: queue.Queue[tuple[str, str] | None] = queue.Queue(_MOST_WAITING)
        self._over = threading.Event()
        self._missed = 0
        self._reason = ""
        self._run: dict[str, Any] | None = None
        self._thread = threading.Thread(target=self._work, name="catalog", daemon=True)

    def __enter__(self) -> CatalogFollower:
        self._catalog = Catalog(self._address)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._waiting.put_nowait(None)
        except queue.Full:
            self._over.set()
        self._thread.join(_END_S)
        self._over.set()  # what still waits is left to `rebuild`
        self._thread.join(_STOP_S)
        left = self._missed + sum(one is not None for one in list(self._waiting.queue))
        if self._thread.is_alive():
            left += 1
        else:
            self._catalog.close()
        if left or self._reason:
            why = f": {self._reason}" if self._reason else "."
            self._notice(
                f"{left} committed episode{'s are' if left != 1 else ' is'} not in the catalog "
                f"{self._address.shown}{why} The dataset is whole. Later: "
                "carstage catalog rebuild DATASET --update."
            )

    def committed(self, episode_id: str, run_id: str) -> None:
        """An episode is in the dataset; returns at once."""
        try:
            self._waiting.put_nowait((episode_id, run_id))
        except queue.Full:
            self._missed += 1

    def ended(self, run: dict[str, Any]) -> None:
        """A run is over.

        Args:
            run: a row of ``runs`` without ``dataset``.
        """
        self._run = run

    def _work(self) -> None:
        dataset = None
        while not self._over.is_set():
            item = self._waiting.get()
            if item is None:
                break
            try:
                if dataset is None:
                    dataset = Dataset(self._place)
                self._tried(record_episode, dataset, _episode(dataset, item[0]), item[1])
            except (CarStageError, OSError) as error:
                self._missed += 1
                self._reason = str(error)
            except Exception as error:  # a bug here must not end a run
                logger.exception("episode %s is not in the catalog", item[0])
                self._missed += 1
                self._reason = f"{type(error).__name__}: {error}"
        if self._run is not None and not self._over.is_set():
            try:
                self._tried(record_run, Dataset(self._place), self._run)
            except (CarStageError, OSError) as error:
                self._reason = str(error)

    def _tried(self, write: Callable[..., None], *what: Any) -> None:
        """Write, again and again while the connection breaks.

        Raises:
            CarStageError: it cannot be written, or not in time.
        """
        until_s = time.monotonic() + self._patience_s
        wait_s = _FIRST_WAIT_S
        while True:
            try:
                write(self._catalog, *what)
            except CatalogLostError:
                # Several runs that lost the same database do not come back all at once.
                pause_s = wait_s * random.uniform(0.5, 1.0)
                late = time.monotonic() + pause_s > until_s
                if late or self._over.wait(pause_s):
                    raise
                wait_s = min(2 * wait_s, _LONGEST_WAIT_S)
            else:
                return


def _episode(dataset: Dataset, episode_id: str) -> Episode:
    """One episode by its marker alone: a dataset may have a million others."""
    marker = read_marker(dataset.path / "commits" / f"{episode_id}.json")
    return Episode(dataset.path / "episodes" / episode_id / marker.attempt, marker)
