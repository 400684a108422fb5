"""When a campaign has enough: its quotas, counted from committed episodes while it runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from carstage.config import Config
from carstage.runs.events import EpisodeCommitted, OnEvent, RunEvent
from carstage.storage import CommitMarker, Store

if TYPE_CHECKING:
    from carstage.dataset import Episode
    from carstage.dataset.quotas import QuotaCounts

LOOK_S = 60.0
"""So often it is looked what other runs on the dataset have committed."""


class QuotaWatch:
    """Counts frames of committed episodes of a plan.

    Args:
        config: with the quotas; without any, there is never enough.
        store: the dataset's.
        planned: ids of all episodes of the configuration, those of other shares, too.
        clock_s: seconds that only go forward.
    """

    def __init__(
        self,
        config: Config,
        store: Store,
        planned: Iterable[str],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        quotas = () if config.campaign is None else config.campaign.quotas
        self._counts: QuotaCounts | None = None
        if quotas:
            from carstage.dataset.quotas import QuotaCounts  # few runs read tables

            self._counts = QuotaCounts(quotas)
        self._store = store
        self._planned = frozenset(planned if quotas else ())
        self._clock_s = clock_s
        self._looked_s = -LOOK_S
        self._new: list[str] = []

    def met(self) -> bool:
        """Whether all quotas are met by what is committed.

        Raises:
            DatasetError: a marker or a label table is damaged.
        """
        counts = self._counts
        if counts is None:
            return False
        now_s = self._clock_s()
        if self._new or now_s - self._looked_s >= LOOK_S:
            self._looked_s, self._new = now_s, []
            for marker in self._store.committed().values():
                if marker.episode_id in self._planned and marker.episode_id not in counts:
                    counts.add(self._episode(marker))
        return counts.met

    def listening(self, on_event: OnEvent | None) -> OnEvent | None:
        """What hears of a run's events in place of ``on_event``, so that commits are noticed.

        Args:
            on_event: hears of them, too.
        """
        if self._counts is None:
            return on_event

        def hear(event: RunEvent) -> None:
            if isinstance(event, EpisodeCommitted):
                self._new.append(event.episode_id)
            if on_event is not None:
                on_event(event)

        return hear

    def _episode(self, marker: CommitMarker) -> Episode:
        from carstage.dataset import Episode

        folder = self._store.root / "episodes" / marker.episode_id / marker.attempt
        return Episode(folder, marker)
