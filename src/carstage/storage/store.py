"""The contract of a store, and the choice of one from what the user wrote after ``--out``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

from carstage.storage.attempt_files import AttemptFiles
from carstage.storage.maps import MapKind
from carstage.storage.marker import CommitMarker, FileEntry
from carstage.storage.remote_path import DatasetPath


@dataclass(frozen=True, slots=True)
class Lease:
    """An attempt that somebody holds or held.

    Attributes:
        episode_id: id of the episode.
        attempt: ``a<number>``.
        holder: as ``reserve_attempt`` was given it; None where no lease is there.
    """

    episode_id: str
    attempt: str
    holder: Mapping[str, Any] | None = field(default=None)


@dataclass(frozen=True, slots=True)
class AttemptSize:
    """What an attempt has written.

    Attributes:
        files: how many there are.
        bytes: of all together.
        modified_s: Unix time at which the newest was written, by the store's clock; where there is
            none, that of the folder.
    """

    files: int
    bytes: int
    modified_s: float


class Store(ABC):
    """A place that holds one dataset.

    The contract (``carstage.testing.store.StoreTests`` checks an implementation):

    * An episode exists iff its marker does. ``commit`` is the only way to make a marker.
    * Of several concurrent ``commit`` calls for one episode, exactly one succeeds; every other
      removes its own attempt, leaves the winner's files alone and raises ``EpisodeExistsError``.
    * A reader never sees half a marker, and every file that a marker lists is durable before it.
    * Nothing that was committed is ever overwritten or removed.
    * A town's OpenDRIVE text and its vector map stand once, under their hashes, however many
      episodes are of the town.
    """

    @property
    @abstractmethod
    def root(self) -> DatasetPath:
        """Where it is: a folder, or a place in an object store."""

    def check(self) -> None:  # noqa: B027 - a folder is looked at by who writes into it
        """Refuse a place that cannot hold a dataset; leaves nothing behind.

        Raises:
            StoreAccessError: no such bucket, or the credentials do not permit what is needed.
            UnsafeStoreError: creating a name twice silently overwrites.
            StorageError: the store cannot be reached.
        """

    def within(self, left_s: Callable[[], float]) -> AbstractContextManager[None]:
        """A stretch in which nothing is waited for longer than ``left_s`` says, in any thread.

        Args:
            left_s: gives the seconds that are left; it may change its mind meanwhile. After them
                every method raises ``RequestGivenUpError`` where the store has not answered.
        """
        del left_s  # a folder answers, or its file system does not let go
        return nullcontext()

    @abstractmethod
    def exists(self) -> bool:
        """Whether there is a dataset already, by its ``dataset.json``.

        Raises:
            StoreAccessError: the store lets nobody look.
        """

    @abstractmethod
    def initialise(self, name: str) -> None:
        """Make the place ready for episodes; safe to call again and from several processes.

        Creates ``dataset.json`` unless it exists, checks its format version if it does (its name
        then stays), and probes that the place can be written to and refuses to create a name twice.

        Args:
            name: name of the dataset, for a new one.

        Raises:
            StorageError: not writable.
            UnsafeStoreError: creating a name twice silently overwrites.
            DatasetError: another format version, or the folder holds something else.
        """

    @abstractmethod
    def committed(self) -> dict[str, CommitMarker]:
        """The markers of all episodes of the dataset by episode id, sorted by id.

        Raises:
            DatasetError: a marker is damaged or of another format version.
        """

    @abstractmethod
    def has(self, episode_id: str) -> bool:
        """Whether an episode is in the dataset, by its marker alone."""

    @abstractmethod
    def reserve_attempt(self, episode_id: str, holder: Mapping[str, Any], first: int = 1) -> str:
        """Begin a new attempt; nobody else gets its name, ever, while the episode is not there.

        The lease ``leases/<episode_id>.<number>`` is created if it is absent. It stays when the
        attempt is discarded, so that one who slept never writes beside another of the same name.
        ``commit`` removes the leases of its episode.

        Args:
            episode_id: id of the episode.
            holder: who holds the attempt, as plain values.
            first: lowest number to use.

        Returns:
            ``a<number>``.

        Raises:
            StorageError: it cannot be created.
        """

    @abstractmethod
    def unfinished(self, markers: Mapping[str, CommitMarker]) -> list[Lease]:
        """Attempts that were begun and are not the episode, as far as can be seen at little cost.

        A folder on a disk tells of those without a lease, too. In an object store only leases are
        looked at: an attempt whose episode is there by another one has none any more.

        Args:
            markers: as ``committed`` gave them.
        """

    @abstractmethod
    def has_attempt(self, episode_id: str, attempt: str) -> bool:
        """Whether anything of an attempt is there."""

    @abstractmethod
    def lost(self, markers: Iterable[CommitMarker]) -> list[CommitMarker]:
        """Those of some markers none of whose files is there any more.

        Args:
            markers: as ``committed`` gave them.
        """

    @abstractmethod
    def retire(self, marker: CommitMarker) -> None:
        """Set a marker of :meth:`lost` aside, so that its episode is recorded again.

        An episode that keeps a single file keeps its marker: what became of the others is for the
        user to say.

        Raises:
            StorageError: it cannot be moved.
        """

    @abstractmethod
    def attempt_files(self, episode_id: str, attempt: str) -> AttemptFiles:
        """Where the files of an attempt go.

        Raises:
            StorageError: a name cannot be used.
        """

    @abstractmethod
    def commit(
        self,
        episode_id: str,
        attempt: str,
        *,
        frames: int,
        versions: Mapping[str, str],
        hashed: Iterable[FileEntry] = (),
        self_test: Mapping[str, Any] | None = None,
    ) -> CommitMarker:
        """Make the attempt's files, as they are now, the episode.

        Args:
            episode_id: id of the episode.
            attempt: the attempt whose folder is complete.
            frames: number of saved frames.
            versions: versions of the client and the server; ``carstage`` is added.
            hashed: files of the attempt that were hashed as they were written; the others are
                read. An entry is believed where its size is the file's.
            self_test: verdict on the server, as the marker keeps it; None: it was not tested.

        Returns:
            The marker that now exists.

        Raises:
            EpisodeExistsError: the episode exists already; the attempt was removed.
            StorageError: the attempt has no or unfinished files, one of ``hashed`` is missing or
                has another size, or writing failed.
        """

    @abstractmethod
    def keep_map(self, content: bytes, kind: MapKind = "xodr") -> str:
        """Make sure that the dataset has a town's map; it is durable on return.

        Called before the ``commit`` of an episode whose ``episode.json`` names it, also at the
        same time by several.

        Args:
            content: an OpenDRIVE text or a vector map, as it stands in the file.
            kind: which of them, by the ending of the file's name.

        Returns:
            Its named hash, ``blake3:<hex>``; see ``map_name`` for the place.

        Raises:
            StorageError: writing failed.
        """

    @abstractmethod
    def discard_attempt(self, episode_id: str, attempt: str) -> None:
        """Remove an attempt's files; no error if there are none.

        For whoever holds the attempt, or where its holder can never commit it: the holder is
        certainly gone, or another attempt is the episode.

        Raises:
            StorageError: the attempt is the committed one.
        """

    def forget_leases(self, episode_ids: Collection[str]) -> None:  # noqa: B027 - they do no harm
        """Remove the leases of episodes that are there.

        ``commit`` does so; a run that was killed right after its marker could not.
        """

    @abstractmethod
    def attempts(self) -> Iterator[tuple[str, str]]:
        """Episode id and name of every attempt of which anything is there, in any order.

        Those of committed episodes are among them.

        Raises:
            StorageError: they cannot be listed.
        """

    @abstractmethod
    def attempt_size(self, episode_id: str, attempt: str) -> AttemptSize:
        """How much an attempt has written, and when last.

        Raises:
            StorageError: it has no files, or they cannot be looked at.
        """
