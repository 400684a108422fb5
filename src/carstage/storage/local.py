"""A dataset in a folder of a local (or locally mounted) disk."""

from __future__ import annotations

import errno
import json
import os
import re
import secrets
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from carstage import __version__
from carstage.errors import DatasetError, EpisodeExistsError, StorageError, UnsafeStoreError
from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, read_bounded
from carstage.files.hashing import hash_of, hash_of_file
from carstage.files.whole import flush_folder, make_folders
from carstage.storage.attempt_files import FolderFiles
from carstage.storage.description import describe_dataset, read_description
from carstage.storage.disk import disk_error
from carstage.storage.maps import MapKind, map_name
from carstage.storage.marker import CommitMarker, FileEntry, read_marker
from carstage.storage.names import ATTEMPT, NAME, check_attempt
from carstage.storage.store import AttemptSize, Lease, Store

_LEASE = re.compile(r".*\.([1-9][0-9]*)")
_FLUSH_THREADS = 4
_MOST_TRIES = 100


class LocalStore(Store):
    """The folder layout of ``docs/formats/dataset.md`` on a file system.

    Create-if-absent is ``os.link`` from a complete, flushed temporary file: the marker appears
    whole or not at all, and a name that exists is never replaced.

    Args:
        root: folder of the dataset; need not exist before ``initialise``.
    """

    def __init__(self, root: Path) -> None:
        self._root = root

    @property
    def root(self) -> Path:
        """The folder."""
        return self._root

    def exists(self) -> bool:
        """Whether the folder holds ``dataset.json``; see ``Store.exists``."""
        return (self.root / "dataset.json").exists()

    def initialise(self, name: str) -> None:
        """Create the folders and ``dataset.json``; see ``Store.initialise``."""
        try:
            make_folders(self.root)
            for folder in (self._commits, self.root / "episodes"):
                folder.mkdir(exist_ok=True)
        except OSError as error:
            raise StorageError(
                f"The output folder {self.root} cannot be created: {error.strerror}.",
                "Choose another folder or change its permissions.",
            ) from error
        self._probe()
        description = self.root / "dataset.json"
        with suppress(FileExistsError):
            self._create_if_absent(description, describe_dataset(name))
        read_description(description)

    def committed(self) -> dict[str, CommitMarker]:
        """Read all files of ``commits/``; see ``Store.committed``."""
        if not self._commits.is_dir():
            return {}
        markers = {}
        for path in sorted(self._commits.glob("*.json")):
            marker = read_marker(path)
            if marker.episode_id != path.stem:
                raise DatasetError(
                    f"The commit marker {path.name} speaks of episode {marker.episode_id!r}.",
                    "Give the file its own name back.",
                )
            markers[marker.episode_id] = marker
        return markers

    def has(self, episode_id: str) -> bool:
        """Whether ``commits/<episode_id>.json`` exists."""
        return (self._commits / f"{episode_id}.json").exists()

    def reserve_attempt(self, episode_id: str, holder: Mapping[str, Any], first: int = 1) -> str:
        """Link the lease, then make the folder; see ``Store.reserve_attempt``."""
        episode = self._attempt(episode_id, "a1").parent
        content = json.dumps(dict(holder), indent=1).encode() + b"\n"
        try:
            number = max(first, 1 + self._last_attempt(episode))
            while not self._took_lease(f"{episode_id}.{number}", content):
                number += 1
            (episode / f"a{number}").mkdir(parents=True)
        except OSError as error:
            if isinstance(error, StorageError):
                raise
            raise StorageError(
                f"The attempt's folder in {episode} cannot be created: {error.strerror}.",
                "Check the free space and the permissions of the output folder.",
            ) from error
        return f"a{number}"

    def unfinished(self, markers: Mapping[str, CommitMarker]) -> list[Lease]:
        """By folders, with their leases; see ``Store.unfinished``."""
        found = []
        for folder in sorted((self.root / "episodes").glob("*/*")):
            episode_id, number = folder.parent.name, ATTEMPT.fullmatch(folder.name)
            marker = markers.get(episode_id)
            if number is None or (marker is not None and marker.attempt == folder.name):
                continue
            found.append(Lease(episode_id, folder.name, self._holder(f"{episode_id}.{number[1]}")))
        return found

    def has_attempt(self, episode_id: str, attempt: str) -> bool:
        """Whether its folder is there; see ``Store.has_attempt``."""
        return self._attempt(episode_id, attempt).is_dir()

    def _holder(self, lease: str) -> Mapping[str, Any] | None:
        try:
            found = json.loads(read_bounded(self._leases / lease, LARGEST_DOCUMENT_BYTES))
        except (OSError, ValueError):
            return None
        return found if isinstance(found, dict) else None

    def lost(self, markers: Iterable[CommitMarker]) -> list[CommitMarker]:
        """One look at a file of each episode, where it is there; see ``Store.lost``."""
        return [
            marker
            for marker in markers
            if not any(
                (self._attempt(marker.episode_id, marker.attempt) / entry.path).exists()
                for entry in marker.files
            )
        ]

    def retire(self, marker: CommitMarker) -> None:
        """Move the marker to ``lost/``; see ``Store.retire``."""
        aside = self.root / "lost" / f"{marker.episode_id}.{marker.attempt}.json"
        try:
            aside.parent.mkdir(exist_ok=True)
            (self._commits / f"{marker.episode_id}.json").rename(aside)
            # Another run may have retired it first, and committed the episode again.
            if read_marker(aside).attempt != marker.attempt:
                with suppress(FileExistsError):
                    os.link(aside, self._commits / f"{marker.episode_id}.json")
                aside.unlink()
            for folder in (aside.parent, self._commits, self.root):
                flush_folder(folder)
        except FileNotFoundError:
            return  # another run has just retired it
        except OSError as error:
            raise disk_error(error, str(aside)) from error

    def attempt_files(self, episode_id: str, attempt: str) -> FolderFiles:
        """In :meth:`attempt_folder`; see ``Store.attempt_files``."""
        return FolderFiles(self._attempt(episode_id, attempt))

    def attempt_folder(self, episode_id: str, attempt: str) -> Path:
        """``episodes/<episode_id>/<attempt>`` below the root; made if it is missing."""
        folder = self._attempt(episode_id, attempt)
        folder.mkdir(parents=True, exist_ok=True)
        return folder

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
        """Flush and hash every file, then link the marker; see ``Store.commit``."""
        folder = self._attempt(episode_id, attempt)
        marker_path = self._commits / f"{episode_id}.json"
        if marker_path.exists():
            self._yield_to_winner(episode_id, attempt, marker_path)
        names, folders = _below(folder)
        if not names:
            raise StorageError(
                f"Attempt {attempt} of episode {episode_id} has no files to commit.",
                "Convert the episode again.",
            )
        for name in names:
            if name.rpartition("/")[2].startswith("."):
                raise StorageError(
                    f"Attempt {attempt} of episode {episode_id} is unfinished: {name} "
                    "is a temporary file.",
                    "Convert the episode again.",
                )
        known = {entry.path: entry for entry in hashed}
        for lost in sorted(known.keys() - set(names)):
            raise StorageError(
                f"Attempt {attempt} of episode {episode_id} has lost its file {lost}.",
                "Convert the episode again.",
            )

        def flushed(share: list[str]) -> list[FileEntry]:
            return [_flushed(folder, name, known.get(name)) for name in share]

        with ThreadPoolExecutor(_FLUSH_THREADS) as threads:
            shares = [names[first::_FLUSH_THREADS] for first in range(_FLUSH_THREADS)]
            entries = chain.from_iterable(threads.map(flushed, shares))
            files = tuple(sorted(entries, key=lambda entry: entry.path))
        for directory in (*folders, folder.parent, self.root / "episodes"):
            flush_folder(directory)
        marker = CommitMarker(
            episode_id,
            attempt,
            frames,
            files,
            {"carstage": __version__, **versions},
            self_test,
        )
        try:
            self._create_if_absent(marker_path, marker.to_bytes())
        except FileExistsError:
            self._yield_to_winner(episode_id, attempt, marker_path)
        self._remove_leases(episode_id)
        return marker

    def keep_map(self, content: bytes, kind: MapKind = "xodr") -> str:
        """``maps/<digest>.<kind>`` by a link from a whole file; see ``Store.keep_map``."""
        named = hash_of(content)
        path = self.root / map_name(named, kind)
        if not path.exists():
            try:
                path.parent.mkdir(exist_ok=True)
            except OSError as error:
                raise disk_error(error, str(path.parent)) from error
            flush_folder(self.root)
            with suppress(FileExistsError):
                self._create_if_absent(path, content)
        return named

    def discard_attempt(self, episode_id: str, attempt: str) -> None:
        """Delete the attempt's folder; see ``Store.discard_attempt``."""
        marker_path = self._commits / f"{episode_id}.json"
        if marker_path.exists():
            marker = read_marker(marker_path)
            if marker.attempt == attempt:
                raise StorageError(
                    f"Attempt {attempt} of episode {episode_id} is committed and stays.",
                    "Remove its marker first if the episode shall go.",
                )
        self._remove_attempt(episode_id, attempt)

    def forget_leases(self, episode_ids: Collection[str]) -> None:
        """See ``Store.forget_leases``."""
        for episode_id in episode_ids:
            self._remove_leases(episode_id)

    def attempts(self) -> Iterator[tuple[str, str]]:
        """The folders below ``episodes``; see ``Store.attempts``."""
        for episode in _inside(self.root / "episodes"):
            for attempt in _inside(episode):
                if NAME.fullmatch(episode.name) and NAME.fullmatch(attempt.name):
                    yield episode.name, attempt.name

    def attempt_size(self, episode_id: str, attempt: str) -> AttemptSize:
        """One look at every file; see ``Store.attempt_size``."""
        folder = self._attempt(episode_id, attempt)
        try:
            newest_s, count, size = folder.stat().st_mtime, 0, 0
            for name in _below(folder)[0]:
                found = (folder / name).lstat()
                newest_s = max(newest_s, found.st_mtime)
                count, size = count + 1, size + found.st_size
        except OSError as error:
            raise StorageError(
                f"Attempt {attempt} of episode {episode_id} cannot be looked at: {error.strerror}.",
                "Another process may have just removed it: try again.",
            ) from error
        return AttemptSize(count, size, newest_s)

    @property
    def _commits(self) -> Path:
        return self.root / "commits"

    @property
    def _leases(self) -> Path:
        return self.root / "leases"

    def _last_attempt(self, episode: Path) -> int:
        """The highest number that an attempt of an episode has, or had before it was removed."""
        folders = (ATTEMPT.fullmatch(path.name) for path in episode.glob("a*"))
        leases = (_LEASE.fullmatch(path.name) for path in self._leases.glob(f"{episode.name}.*"))
        lost = (self.root / "lost").glob(f"{episode.name}.a*.json")
        retired = (ATTEMPT.fullmatch(path.stem.rpartition(".")[2]) for path in lost)
        return max((int(found[1]) for found in (*folders, *leases, *retired) if found), default=0)

    def _took_lease(self, name: str, content: bytes) -> bool:
        """Create a lease; False where somebody has it."""
        for _ in range(_MOST_TRIES):
            self._leases.mkdir(parents=True, exist_ok=True)
            try:
                self._create_if_absent(self._leases / name, content)
            except FileExistsError:
                return False
            except FileNotFoundError:  # a commit has just removed the empty folder
                continue
            return True
        raise StorageError(f"The folder {self._leases} vanishes.", "See what removes it.")

    def _remove_leases(self, episode_id: str) -> None:
        """They are needed no more: every other attempt's commit is refused by the marker."""
        with suppress(OSError):  # what stays does no harm
            for lease in self._leases.glob(f"{episode_id}.*"):
                lease.unlink(missing_ok=True)
            self._leases.rmdir()

    def _attempt(self, episode_id: str, attempt: str) -> Path:
        check_attempt(episode_id, attempt)
        return self.root / "episodes" / episode_id / attempt

    def _yield_to_winner(self, episode_id: str, attempt: str, marker_path: Path) -> None:
        """Give way to the attempt that was committed first."""
        winner = read_marker(marker_path)
        if winner.attempt != attempt:
            self._remove_attempt(episode_id, attempt)
        self._remove_leases(episode_id)
        raise EpisodeExistsError(
            f"Episode {episode_id} is already in the dataset (attempt {winner.attempt}); "
            f"attempt {attempt} was dropped.",
            "Nothing is to be done: the episode is complete.",
        )

    def _remove_attempt(self, episode_id: str, attempt: str) -> None:
        folder = self._attempt(episode_id, attempt)
        with suppress(FileNotFoundError):
            shutil.rmtree(folder)
        with suppress(OSError):  # other attempts may stand beside it
            folder.parent.rmdir()

    def _create_if_absent(self, path: Path, content: bytes) -> None:
        temporary = path.parent / f".{path.name}.{secrets.token_hex(8)}"
        try:
            with temporary.open("xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.link(temporary, path)
        except (FileExistsError, FileNotFoundError):
            raise
        except OSError as error:
            raise disk_error(error, f"{path.name} in {path.parent}") from error
        finally:
            temporary.unlink(missing_ok=True)
        flush_folder(path.parent)

    def _probe(self) -> None:
        """Find out whether a second create of one name is refused here, as ``commit`` needs."""
        probe = self._commits / f".probe-{secrets.token_hex(8)}"
        source = self._commits / f"{probe.name}.source"
        try:
            source.write_bytes(b"probe")
            os.link(source, probe)
            try:
                os.link(source, probe)
            except FileExistsError:
                return
            raise UnsafeStoreError(
                f"The file system of {self.root} silently replaces files that exist.",
                "Choose a folder on another disk: an episode could overwrite another one here.",
            )
        except OSError as error:
            if error.errno in (errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS):
                raise UnsafeStoreError(
                    f"The file system of {self.root} has no hard links, "
                    "by which a commit is made atomic.",
                    "Choose a folder on another disk (ext4, xfs, btrfs, NFS, …).",
                ) from error
            raise StorageError(
                f"The output folder {self.root} is not writable: {error.strerror}.",
                "Choose another folder or change its permissions.",
            ) from error
        finally:
            with suppress(OSError):
                probe.unlink(missing_ok=True)
                source.unlink(missing_ok=True)


def _inside(folder: Path) -> list[Path]:
    """What a folder holds, sorted; nothing where another process has just removed it."""
    try:
        return sorted(folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise StorageError(
            f"The folder {folder} cannot be listed: {error.strerror}.", "Check its permissions."
        ) from error


def _below(folder: Path) -> tuple[list[str], list[Path]]:
    """Names of the files below a folder, relative to it, and all folders, itself among them."""
    names: list[str] = []
    folders: list[Path] = []
    for parent, _, found in os.walk(folder):
        above = Path(parent).relative_to(folder).as_posix()
        names += found if above == "." else [f"{above}/{name}" for name in found]
        folders.append(Path(parent))
    return names, folders


def _flushed(folder: Path, name: str, known: FileEntry | None) -> FileEntry:
    """The entry of a file, which is on the disk when this returns; read where it is not known."""
    path = folder / name
    with path.open("rb", buffering=0) as file:
        os.fsync(file.fileno())
        size = os.fstat(file.fileno()).st_size
        if known is not None:
            if known.bytes != size:
                raise StorageError(
                    f"{path} has {size} bytes, and {known.bytes} were written.",
                    "Convert the episode again.",
                )
            return known
        found, size = hash_of_file(file)
    return FileEntry(name, size, found)
