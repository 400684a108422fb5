"""A dataset in an object store: S3 and compatible, Google Cloud Storage, Azure Blob."""

from __future__ import annotations

import json
import secrets
import tempfile
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from carstage import __version__
from carstage.errors import (
    DatasetError,
    EpisodeExistsError,
    StorageError,
    UnsafeStoreError,
)
from carstage.files.hashing import hash_of
from carstage.storage.attempt_files import AttemptFiles, FileWriter
from carstage.storage.description import describe_dataset, parse_description
from carstage.storage.maps import MapKind, map_name
from carstage.storage.marker import CommitMarker, FileEntry
from carstage.storage.names import ATTEMPT, check_attempt
from carstage.storage.remote_files import RemoteFiles, remote_files
from carstage.storage.remote_path import RemotePath
from carstage.storage.store import AttemptSize, Lease, Store

_READERS = 32
_UPLOADS = 8
"""Files of one converting process that are on their way at a time."""
_WINDOW_BYTES = 64 << 20
"""What one converting process keeps in memory of files on their way."""


class ObjectStore(Store):
    """The folder layout of ``docs/formats/dataset.md`` as objects below a prefix.

    Create-if-absent is the provider's conditional write (``If-None-Match: *`` and its like), by one
    plain request. Whether the store heeds it is tried before anything else is written. Files go
    straight from the processes that convert to the store; no copy of them is kept here.

    Args:
        root: place of the dataset.

    Raises:
        BadInputError: the extra ``cloud`` is not installed.
        StoreAccessError: the environment's settings for the store cannot be used.
    """

    def __init__(self, root: RemotePath) -> None:
        self._root = root

    @property
    def root(self) -> RemotePath:
        """The place."""
        return self._root

    @property
    def _files(self) -> RemoteFiles:
        return remote_files(self.root.root)

    def check(self) -> None:
        """Create a name twice, list, read and remove it; see ``Store.check``."""
        name = f"commits/.probe-{secrets.token_hex(8)}"
        try:
            created = [self._files.create(name, content) for content in (b"first", b"second")]
            self._files.has_any("commits")  # whether it may be listed
            kept = self._files.read(name)
        except FileNotFoundError:
            created, kept = [True, True], b""
        except BaseException:
            with suppress(StorageError):
                self._files.delete([name])
            raise
        self._files.delete([name])
        if created != [True, False] or kept != b"first":
            raise UnsafeStoreError(
                f"{self.root}: the store silently replaces objects that exist.",
                "Use a store that knows conditional writes (If-None-Match: *), such as S3: an "
                "episode could overwrite another one here.",
            )

    def within(self, left_s: Callable[[], float]) -> AbstractContextManager[None]:
        """For all of this process that ask the same store; see ``Store.within``."""
        return self._files.requests.within(left_s)

    def exists(self) -> bool:
        """Whether there is a ``dataset.json``; see ``Store.exists``."""
        return self._files.size("dataset.json") is not None

    def initialise(self, name: str) -> None:
        """Create ``dataset.json``; :meth:`check` comes before. See ``Store.initialise``."""
        self._files.create("dataset.json", describe_dataset(name))
        try:
            parse_description(self._files.read("dataset.json"), str(self.root / "dataset.json"))
        except FileNotFoundError as error:
            raise StorageError(
                f"{self.root}: dataset.json was written and is not there.",
                "See what removes it; the store has to show what was written at once.",
            ) from error

    def committed(self) -> dict[str, CommitMarker]:
        """Read all markers, many at a time; see ``Store.committed``."""
        names = [found.key for found in self._files.below("commits")]
        names = [name for name in names if name.endswith(".json") and name.count("/") == 1]
        markers = {}
        with ThreadPoolExecutor(_READERS) as threads:
            for name, content in zip(names, threads.map(self._marker_of, names), strict=True):
                if content is None:
                    continue  # retired meanwhile
                marker = CommitMarker.from_bytes(content, name)
                if f"commits/{marker.episode_id}.json" != name:
                    raise DatasetError(
                        f"The commit marker {name} speaks of episode {marker.episode_id!r}.",
                        "Give the object its own name back.",
                    )
                markers[marker.episode_id] = marker
        return markers

    def has(self, episode_id: str) -> bool:
        """Whether ``commits/<episode_id>.json`` exists."""
        return self._files.size(_marker_name(episode_id)) is not None

    def reserve_attempt(self, episode_id: str, holder: Mapping[str, Any], first: int = 1) -> str:
        """Create the lease; see ``Store.reserve_attempt``."""
        check_attempt(episode_id, "a1")
        # So that nobody else's lease has the same content, which would count as ours.
        document = {**holder, "token": secrets.token_hex(16)}
        content = json.dumps(document, indent=1).encode() + b"\n"
        number = max(first, 1 + self._last_attempt(episode_id))
        while not self._files.create(f"leases/{episode_id}.{number}", content):
            number += 1
        return f"a{number}"

    def unfinished(self, markers: Mapping[str, CommitMarker]) -> list[Lease]:
        """By the leases alone; see ``Store.unfinished``."""
        found = []
        for lease in self._files.below("leases"):
            episode_id, _, number = lease.key.partition("/")[2].rpartition(".")
            marker = markers.get(episode_id)
            if marker is not None and marker.attempt == f"a{number}":
                continue
            with suppress(FileNotFoundError, ValueError):  # gone meanwhile, or not ours
                holder = json.loads(self._files.read(lease.key))
                found.append(Lease(episode_id, f"a{number}", holder))
        return found

    def has_attempt(self, episode_id: str, attempt: str) -> bool:
        """Whether one of its objects is there; see ``Store.has_attempt``."""
        return self._files.has_any(_prefix(episode_id, attempt))

    def lost(self, markers: Iterable[CommitMarker]) -> list[CommitMarker]:
        """Those of whose episode nothing is there, by one listing; see ``Store.lost``."""
        wanted = list(markers)
        present = set(self._files.folders("episodes")) if wanted else set()
        return [marker for marker in wanted if marker.episode_id not in present]

    def retire(self, marker: CommitMarker) -> None:
        """Copy the marker to ``lost/``, then remove it; see ``Store.retire``.

        No store removes an object on condition. So two that retire one marker, of which one sleeps
        between its look and its removal until another run has recorded the episode again, take the
        new marker with the old one. Its files stay: the next run records the episode once more.
        """
        name = _marker_name(marker.episode_id)
        content = self._marker_of(name)
        if content is None or CommitMarker.from_bytes(content, name).attempt != marker.attempt:
            return  # another run has just retired it
        self._files.create(f"lost/{marker.episode_id}.{marker.attempt}.json", content)
        self._files.delete([name])

    def attempt_files(self, episode_id: str, attempt: str) -> RemoteAttemptFiles:
        """Straight into the store; see ``Store.attempt_files``."""
        return RemoteAttemptFiles(self.root, _prefix(episode_id, attempt))

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
        """Compare what was sent with what is there, then create the marker; see ``Store.commit``.

        All objects are listed, and their sizes compared. Those that are not in ``hashed`` are read.
        """
        name = _marker_name(episode_id)
        prefix = _prefix(episode_id, attempt)
        if self.has(episode_id):
            self._yield_to_winner(episode_id, attempt)
        known = {entry.path: entry for entry in hashed}
        found = {one.key[len(prefix) + 1 :]: one.bytes for one in self._files.below(prefix)}
        self._refuse_unfinished(f"Attempt {attempt} of episode {episode_id}", known, found)
        with ThreadPoolExecutor(_READERS) as threads:
            unknown = sorted(found.keys() - known.keys())
            read = threads.map(lambda path: _entry(self._files, prefix, path), unknown)
            files = sorted([*known.values(), *read], key=lambda entry: entry.path)
        made_with = {"carstage": __version__, **versions}
        marker = CommitMarker(episode_id, attempt, frames, tuple(files), made_with, self_test)
        if not self._files.create(name, marker.to_bytes()):
            self._yield_to_winner(episode_id, attempt)
        self._remove_leases(episode_id)
        return marker

    def keep_map(self, content: bytes, kind: MapKind = "xodr") -> str:
        """``maps/<digest>.<kind>``, where it is not there; see ``Store.keep_map``."""
        named = hash_of(content)
        name = map_name(named, kind)
        if self._files.size(name) != len(content):
            self._files.write(name, content)
        return named

    def discard_attempt(self, episode_id: str, attempt: str) -> None:
        """Delete the attempt's objects; see ``Store.discard_attempt``."""
        prefix = _prefix(episode_id, attempt)
        content = self._marker_of(_marker_name(episode_id))
        if content is not None:
            marker = CommitMarker.from_bytes(content, _marker_name(episode_id))
            if marker.attempt == attempt:
                raise StorageError(
                    f"Attempt {attempt} of episode {episode_id} is committed and stays.",
                    "Remove its marker first if the episode shall go.",
                )
        self._files.delete(found.key for found in self._files.below(prefix))

    def forget_leases(self, episode_ids: Collection[str]) -> None:
        """By one listing; see ``Store.forget_leases``."""
        leases = [one.key for one in self._files.below("leases")]
        names = {key: key.partition("/")[2].rpartition(".")[0] for key in leases}
        with suppress(StorageError):
            self._files.delete(key for key in leases if names[key] in episode_ids)

    def attempts(self) -> Iterator[tuple[str, str]]:
        """One listing for each episode, many at a time; see ``Store.attempts``."""
        with ThreadPoolExecutor(_READERS) as threads:
            episodes = self._files.folders("episodes")
            inside = threads.map(lambda name: self._files.folders(f"episodes/{name}"), episodes)
            for episode_id, attempts in zip(episodes, inside, strict=True):
                for attempt in attempts:
                    yield episode_id, attempt

    def attempt_size(self, episode_id: str, attempt: str) -> AttemptSize:
        """By one listing; see ``Store.attempt_size``."""
        found = self._files.below(_prefix(episode_id, attempt))
        if not found:
            raise StorageError(
                f"Attempt {attempt} of episode {episode_id} has no files.",
                "Another process may have just removed it: try again.",
            )
        newest_s = max(one.modified_s for one in found)
        return AttemptSize(len(found), sum(one.bytes for one in found), newest_s)

    def _marker_of(self, name: str) -> bytes | None:
        try:
            return self._files.read(name)
        except FileNotFoundError:
            return None

    def _last_attempt(self, episode_id: str) -> int:
        """The highest number that an attempt of an episode has, or had before it was removed."""
        names = [f"a{key.rpartition('.')[2]}" for key in self._leases_of(episode_id)]
        names += self._files.folders(f"episodes/{episode_id}")
        for key in self._files.beginning(f"lost/{episode_id}."):
            names.append(key.removesuffix(".json").rpartition(".")[2])
        return max((int(found[1]) for found in map(ATTEMPT.fullmatch, names) if found), default=0)

    def _leases_of(self, episode_id: str) -> list[str]:
        return self._files.beginning(f"leases/{episode_id}.")

    def _remove_leases(self, episode_id: str) -> None:
        """They are of no use any more; what cannot be removed does no harm."""
        with suppress(StorageError):
            self._files.delete(self._leases_of(episode_id))

    def _yield_to_winner(self, episode_id: str, attempt: str) -> NoReturn:
        """Give way to the attempt that was committed first."""
        name = _marker_name(episode_id)
        winner = CommitMarker.from_bytes(self._files.read(name), name)
        if winner.attempt != attempt:
            self._files.delete(one.key for one in self._files.below(_prefix(episode_id, attempt)))
        self._remove_leases(episode_id)
        raise EpisodeExistsError(
            f"Episode {episode_id} is already in the dataset (attempt {winner.attempt}); "
            f"attempt {attempt} was dropped.",
            "Nothing is to be done: the episode is complete.",
        )

    def _refuse_unfinished(
        self, what: str, known: Mapping[str, FileEntry], found: Mapping[str, int]
    ) -> None:
        """Refuse to commit what is not all there, or not as it was sent.

        Raises:
            StorageError: says what is wrong.
        """
        problem = "" if found else f"{what} has no files to commit."
        for path in sorted(found):
            if path.rpartition("/")[2].startswith("."):
                problem = problem or f"{what} is unfinished: {path} is a temporary file."
        for path, entry in sorted(known.items()):
            if path not in found:
                problem = problem or f"{what} has lost its file {path}."
            elif found[path] != entry.bytes:
                sizes = f"{found[path]} bytes, and {entry.bytes} were sent"
                problem = problem or f"{what}: {path} has {sizes}."
        if problem:
            raise StorageError(problem, "Convert the episode again.")


class RemoteAttemptFiles(AttemptFiles):
    """An attempt as objects below a prefix.

    Args:
        root: place of the dataset.
        prefix: of the attempt, below it.
    """

    def __init__(self, root: RemotePath, prefix: str) -> None:
        self._root = root
        self._prefix = prefix

    @property
    def _files(self) -> RemoteFiles:
        return remote_files(self._root.root)

    @contextmanager
    def stream(self) -> Iterator[FileWriter]:
        """Several files at a time, within a bound of memory; see ``AttemptFiles.stream``."""
        with ThreadPoolExecutor(_UPLOADS, thread_name_prefix="upload") as threads:
            writer = _Uploads(self._files, self._prefix, threads)
            try:
                yield writer
                writer.wait()
            finally:
                writer.drop()

    @contextmanager
    def whole(self, name: str) -> Iterator[Path]:
        """A temporary file, which is sent; see ``AttemptFiles.whole``."""
        with tempfile.TemporaryDirectory(prefix="carstage-upload-") as folder:
            path = Path(folder) / name.rpartition("/")[2]
            yield path
            self._files.write(f"{self._prefix}/{name}", path)

    def names(self) -> list[str]:
        """See ``AttemptFiles.names``."""
        return [one.key[len(self._prefix) + 1 :] for one in self._files.below(self._prefix)]

    def holds(self, entry: FileEntry) -> bool:
        """See ``AttemptFiles.holds``."""
        content = self._files.read(f"{self._prefix}/{entry.path}")
        return len(content) == entry.bytes and hash_of(content, entry.hash) == entry.hash

    def remove(self, names: Iterable[str]) -> None:
        """See ``AttemptFiles.remove``."""
        self._files.delete(f"{self._prefix}/{name}" for name in names)

    def discard(self) -> None:
        """See ``AttemptFiles.discard``."""
        self._files.delete(one.key for one in self._files.below(self._prefix))


class _Uploads:
    """Sends files while the caller makes the next ones; waits where too much is on its way."""

    def __init__(self, files: RemoteFiles, prefix: str, threads: ThreadPoolExecutor) -> None:
        self._files = files
        self._prefix = prefix
        self._threads = threads
        self._under_way: deque[tuple[int, Future[None]]] = deque()
        self._bytes = 0

    def write(self, name: str, content: bytes | memoryview) -> FileEntry:
        while self._under_way and self._bytes + len(content) > _WINDOW_BYTES:
            self._wait_for_one()
        self._bytes += len(content)
        sent = self._threads.submit(self._files.write, f"{self._prefix}/{name}", content)
        self._under_way.append((len(content), sent))
        return FileEntry(name, len(content), hash_of(content))

    def wait(self) -> None:
        while self._under_way:
            self._wait_for_one()

    def drop(self) -> None:
        for _, sent in self._under_way:
            sent.cancel()

    def _wait_for_one(self) -> None:
        size, sent = self._under_way.popleft()
        sent.result()
        self._bytes -= size


def _marker_name(episode_id: str) -> str:
    return f"commits/{episode_id}.json"


def _prefix(episode_id: str, attempt: str) -> str:
    check_attempt(episode_id, attempt)
    return f"episodes/{episode_id}/{attempt}"


def _entry(files: RemoteFiles, prefix: str, path: str) -> FileEntry:
    content = files.read(f"{prefix}/{path}")
    return FileEntry(path, len(content), hash_of(content))
