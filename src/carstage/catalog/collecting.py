"""Attempts that are no episode: which are left over, and removing them."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from carstage.errors import StorageError
from carstage.storage import CommitMarker, Store

Reason = Literal["overtaken", "open"]


@dataclass(frozen=True, slots=True)
class Leftover:
    """An attempt that may be removed.

    Attributes:
        reason: ``overtaken``: a marker makes another attempt the episode, so this one never can be.
            ``open``: there is no marker; whoever writes it may be alive somewhere.
        files, bytes: what it holds.
        age_s: seconds since its newest file was written.
    """

    episode_id: str
    attempt: str
    reason: Reason
    files: int
    bytes: int
    age_s: float

    def to_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return {
            "episode_id": self.episode_id,
            "attempt": self.attempt,
            "reason": self.reason,
            "files": self.files,
            "bytes": self.bytes,
            "age_s": round(self.age_s, 1),
        }


def leftovers(
    store: Store,
    *,
    older_than_s: float | None = None,
    held: Collection[tuple[str, str]] = (),
    now_s: float | None = None,
) -> Iterator[Leftover]:
    """The attempts that :func:`collect` may remove; a committed one is never among them.

    Args:
        store: the dataset's.
        older_than_s: also attempts without a marker whose newest file is older; None: none of them.
        held: episode id and name of attempts that somebody is known to need.
        now_s: Unix time; default: this machine's.

    Raises:
        DatasetError: a marker is damaged: nobody knows what it protects.
        StorageError: the attempts cannot be listed.
    """
    markers = store.committed()
    now_s = time.time() if now_s is None else now_s
    for episode_id, attempt in store.attempts():
        marker = markers.get(episode_id)
        if (episode_id, attempt) in held or _is_of(marker, attempt):
            continue
        if marker is None and older_than_s is None:
            continue
        try:
            found = store.attempt_size(episode_id, attempt)
        except StorageError:
            continue  # its holder has just removed it
        age_s = now_s - found.modified_s
        if marker is None and age_s < (older_than_s or 0.0):
            continue
        reason: Reason = "open" if marker is None else "overtaken"
        yield Leftover(episode_id, attempt, reason, found.files, found.bytes, age_s)


def collect(store: Store, found: Iterable[Leftover]) -> Mapping[Leftover, str]:
    """Remove attempts; one that was committed meanwhile stays. Leases of episodes go, too.

    Args:
        store: the dataset's.
        found: as :func:`leftovers` gives them.

    Returns:
        Those that could not be removed, with the reason.
    """
    kept = {}
    for leftover in found:
        try:
            store.discard_attempt(leftover.episode_id, leftover.attempt)
        except (StorageError, OSError) as error:
            kept[leftover] = str(error)
    store.forget_leases(store.committed().keys())
    return kept


def _is_of(marker: CommitMarker | None, attempt: str) -> bool:
    return marker is not None and marker.attempt == attempt
