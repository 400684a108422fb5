"""What every ``Store`` must do; subclass ``StoreTests`` in a test module and give it a store."""

# ruff: noqa: D102 (the name of a test states its rule)

from __future__ import annotations

import pickle
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from carstage.errors import EpisodeExistsError, StorageError
from carstage.files.bounded import read_bounded
from carstage.files.hashing import hash_of
from carstage.storage import Store
from carstage.storage.attempt_files import write_document
from carstage.storage.maps import map_name
from carstage.storage.marker import FileEntry

_EPISODE = "0123456789abcdef"
_PICTURE = "sensors/CAM/000000.png"
_VERSIONS = {"client": "0.9.16", "server": "0.9.16"}


class StoreTests:
    """The contract of a store, as tests.

    Override ``open`` to give a new handle of one and the same, at first empty place on each call.
    """

    def open(self, place: Path) -> Store:
        """A handle of the store; ``place`` is a folder of the test's own."""
        raise NotImplementedError

    @pytest.fixture
    def place(self, tmp_path: Path) -> Path:
        """A folder of the test's own."""
        return tmp_path

    @pytest.fixture
    def store(self, place: Path) -> Store:
        """An initialised store."""
        store = self.open(place)
        store.initialise("test")
        return store

    def write(self, store: Store, attempt: str, text: str = "content") -> None:
        """Write the files of an attempt."""
        files = store.attempt_files(_EPISODE, attempt)
        write_document(files, "episode.json", b"{}")
        with files.stream() as stream:
            stream.write(_PICTURE, text.encode())

    def read(self, store: Store, attempt: str, name: str = _PICTURE) -> bytes:
        """The content of an attempt's file."""
        return read_bounded(store.root / "episodes" / _EPISODE / attempt / name)

    def names(self, store: Store, attempt: str) -> list[str]:
        """Names of the files of an attempt."""
        return store.attempt_files(_EPISODE, attempt).names()

    def test_a_map_is_kept_once_under_its_hash(self, place: Path, store: Store) -> None:
        named = store.keep_map(b"abc")
        assert named == "blake3:6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85"
        assert self.open(place).keep_map(b"abc") == named
        assert store.keep_map(b"abd") != named
        assert store.keep_map(b"abc", "parquet") == named
        for kind in ("xodr", "parquet"):
            assert read_bounded(store.root / map_name(named, kind)) == b"abc"

    def test_maps_may_be_kept_at_the_same_time(self, place: Path, store: Store) -> None:
        start, found = threading.Barrier(6), list[str]()

        def keep() -> None:
            own = self.open(place)
            start.wait()
            found.append(own.keep_map(b"abc"))

        threads = [threading.Thread(target=keep) for _ in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert found == [store.keep_map(b"abc")] * 6

    def test_initialising_twice_is_harmless(self, place: Path, store: Store) -> None:
        self.open(place).initialise("another name")
        assert store.committed() == {}

    def test_attempts_are_numbered_and_no_number_is_given_twice(self, store: Store) -> None:
        assert store.reserve_attempt(_EPISODE, {}) == "a1"
        assert store.reserve_attempt(_EPISODE, {}) == "a2"
        store.discard_attempt(_EPISODE, "a2")
        store.discard_attempt(_EPISODE, "a1")
        assert store.reserve_attempt(_EPISODE, {}) == "a3"
        assert store.reserve_attempt(_EPISODE, {}, first=7) == "a7"

    def test_attempts_that_are_reserved_at_once_differ(self, place: Path) -> None:
        with ThreadPoolExecutor(8) as threads:
            begun = [
                threads.submit(self.open(place).reserve_attempt, _EPISODE, {}) for _ in range(40)
            ]
            names = [one.result() for one in begun]
        assert len(set(names)) == 40

    def test_one_who_slept_cannot_commit_after_another(self, place: Path, store: Store) -> None:
        slow = store.reserve_attempt(_EPISODE, {"run_id": "slow"})
        self.write(store, slow)
        other = self.open(place)
        fast = other.reserve_attempt(_EPISODE, {"run_id": "fast"})
        self.write(other, fast)
        other.commit(_EPISODE, fast, frames=1, versions=_VERSIONS)
        with pytest.raises(EpisodeExistsError):
            store.commit(_EPISODE, slow, frames=1, versions=_VERSIONS)
        assert store.has(_EPISODE)
        assert store.committed()[_EPISODE].attempt == fast
        assert not store.lost(store.committed().values())

    def test_an_episode_that_is_not_there_is_not(self, store: Store) -> None:
        self.write(store, store.reserve_attempt(_EPISODE, {}))
        assert not store.has(_EPISODE)

    def test_a_marker_without_any_file_is_set_aside(self, place: Path, store: Store) -> None:
        attempt = store.reserve_attempt(_EPISODE, {})
        self.write(store, attempt)
        store.commit(_EPISODE, attempt, frames=1, versions=_VERSIONS)
        files = store.attempt_files(_EPISODE, attempt)
        files.remove(["episode.json"])
        markers = store.committed().values()
        assert store.lost(markers) == []  # one file is still there
        files.discard()
        (marker,) = store.lost(markers)
        assert marker.episode_id == _EPISODE
        self.open(place).retire(marker)
        assert not store.has(_EPISODE)
        store.retire(marker)  # as one who is late does
        assert store.lost(store.committed().values()) == []

    def test_who_retires_a_marker_late_takes_no_new_one_away(
        self, place: Path, store: Store
    ) -> None:
        attempt = store.reserve_attempt(_EPISODE, {})
        self.write(store, attempt)
        gone = store.commit(_EPISODE, attempt, frames=1, versions=_VERSIONS)
        store.attempt_files(_EPISODE, attempt).discard()
        self.open(place).retire(gone)
        another = store.reserve_attempt(_EPISODE, {})
        assert another != attempt  # what was read of the one is never taken for the other
        self.write(store, another)
        again = store.commit(_EPISODE, another, frames=1, versions=_VERSIONS)
        self.open(place).retire(gone)
        assert store.committed() == {_EPISODE: again}

    def test_attempts_that_were_begun_are_told_with_who_holds_them(self, store: Store) -> None:
        attempt = store.reserve_attempt(_EPISODE, {"run_id": "one"})
        assert not store.attempt_files(_EPISODE, attempt).names()
        self.write(store, attempt)
        (left,) = store.unfinished({})
        assert (left.episode_id, left.attempt) == (_EPISODE, attempt)
        assert left.holder is not None
        assert left.holder["run_id"] == "one"
        assert store.has_attempt(_EPISODE, attempt)
        marker = store.commit(_EPISODE, attempt, frames=1, versions=_VERSIONS)
        assert store.unfinished({_EPISODE: marker}) == []
        assert not store.has_attempt(_EPISODE, "a7")

    def test_there_is_a_dataset_once_it_was_initialised(self, place: Path, store: Store) -> None:
        assert self.open(place).exists()
        store.check()
        assert store.committed() == {}

    def test_files_are_told_removed_and_compared(self, store: Store) -> None:
        self.write(store, "a1", "abc")
        files = store.attempt_files(_EPISODE, "a1")
        assert files.names() == ["episode.json", _PICTURE]
        same = FileEntry(_PICTURE, 3, hash_of(b"abc"))
        assert files.holds(same)
        assert not files.holds(FileEntry(_PICTURE, 3, hash_of(b"abd")))
        files.remove([_PICTURE, "sensors/CAM/000009.png"])
        assert files.names() == ["episode.json"]
        files.discard()
        assert files.names() == []
        files.discard()

    def test_files_can_be_handed_to_another_process(self, store: Store) -> None:
        files = pickle.loads(pickle.dumps(store.attempt_files(_EPISODE, "a1")))
        with files.stream() as stream:
            entry = stream.write("a/b.bin", memoryview(b"abc"))
        assert entry == FileEntry("a/b.bin", 3, hash_of(b"abc"))
        assert self.read(store, "a1", "a/b.bin") == b"abc"

    def test_a_large_file_and_many_small_ones_arrive_whole(self, store: Store) -> None:
        large = bytes(range(256)) * 80_000  # larger than a part
        with store.attempt_files(_EPISODE, "a1").stream() as stream:
            stream.write("large.bin", large)
            for k in range(40):
                stream.write(f"sensors/CAM/{k:06d}.png", b"%d" % k)
        assert self.read(store, "a1", "large.bin") == large
        assert self.read(store, "a1", "sensors/CAM/000039.png") == b"39"
        assert len(self.names(store, "a1")) == 41

    def test_a_file_whose_writing_breaks_off_does_not_appear(self, store: Store) -> None:
        files = store.attempt_files(_EPISODE, "a1")

        def fail() -> None:
            with files.whole("labels.parquet"):
                raise KeyError

        with pytest.raises(KeyError):
            fail()
        assert files.names() == []

    def test_an_uncommitted_attempt_is_no_episode(self, store: Store) -> None:
        self.write(store, "a1")
        assert store.committed() == {}

    def test_a_commit_lists_every_file_with_size_and_hash(self, store: Store) -> None:
        self.write(store, "a1", "abc")
        marker = store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS)
        assert [entry.path for entry in marker.files] == [
            "episode.json",
            "sensors/CAM/000000.png",
        ]
        assert marker.files[1].bytes == 3
        assert marker.files[1].hash == (
            "blake3:6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85"
        )

    def test_a_file_that_was_hashed_as_it_was_written_is_listed_so(self, store: Store) -> None:
        self.write(store, "a1", "abc")
        known = FileEntry("sensors/CAM/000000.png", 3, f"blake3:{'f' * 64}")
        marker = store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS, hashed=[known])
        assert [entry.path for entry in marker.files] == ["episode.json", known.path]
        assert marker.files[1] == known

    @pytest.mark.parametrize("name", ["sensors/CAM/000000.png", "sensors/CAM/000001.png"])
    def test_a_file_that_is_not_as_it_was_written_is_refused(self, store: Store, name: str) -> None:
        self.write(store, "a1", "abc")
        known = FileEntry(name, 4, f"blake3:{'f' * 64}")
        with pytest.raises(StorageError, match=name):
            store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS, hashed=[known])
        assert store.committed() == {}

    def test_a_commit_is_seen_by_a_new_handle(self, place: Path, store: Store) -> None:
        self.write(store, "a1")
        marker = store.commit(_EPISODE, "a1", frames=7, versions=_VERSIONS)
        found = self.open(place).committed()
        assert found == {_EPISODE: marker}
        assert found[_EPISODE].frames == 7
        assert found[_EPISODE].versions["server"] == "0.9.16"
        assert "carstage" in found[_EPISODE].versions

    def test_the_second_commit_loses_and_leaves_the_first_alone(self, store: Store) -> None:
        self.write(store, "a1")
        first = store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS)
        self.write(store, "a2", "other")
        with pytest.raises(EpisodeExistsError):
            store.commit(_EPISODE, "a2", frames=1, versions=_VERSIONS)
        assert store.committed() == {_EPISODE: first}
        assert self.names(store, "a2") == []
        assert self.read(store, "a1") == b"content"

    def test_committing_the_committed_attempt_again_keeps_its_files(self, store: Store) -> None:
        self.write(store, "a1")
        store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS)
        with pytest.raises(EpisodeExistsError):
            store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS)
        assert self.read(store, "a1", "episode.json") == b"{}"

    def test_of_many_concurrent_commits_exactly_one_wins(self, place: Path, store: Store) -> None:
        attempts = [f"a{number}" for number in range(6)]
        for attempt in attempts:
            self.write(store, attempt, attempt)
        won: list[str] = []
        lost: list[str] = []
        start = threading.Barrier(len(attempts))

        def commit(attempt: str) -> None:
            handle = self.open(place)
            start.wait()
            try:
                handle.commit(_EPISODE, attempt, frames=1, versions=_VERSIONS)
                won.append(attempt)
            except EpisodeExistsError:
                lost.append(attempt)

        threads = [threading.Thread(target=commit, args=(attempt,)) for attempt in attempts]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(won) == 1
        assert sorted(won + lost) == attempts
        marker = store.committed()[_EPISODE]
        assert marker.attempt == won[0]
        assert self.read(store, won[0]).decode() == won[0]

    def test_an_attempt_without_files_cannot_be_committed(self, store: Store) -> None:
        with pytest.raises(StorageError):
            store.commit(_EPISODE, "a1", frames=0, versions=_VERSIONS)
        assert store.committed() == {}

    def test_an_attempt_with_temporary_files_cannot_be_committed(self, store: Store) -> None:
        self.write(store, "a1")
        write_document(store.attempt_files(_EPISODE, "a1"), "sensors/.half", b"half")
        with pytest.raises(StorageError):
            store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS)
        assert store.committed() == {}

    def test_discarding_removes_an_attempt_and_nothing_else(self, store: Store) -> None:
        self.write(store, "a1")
        self.write(store, "a2")
        store.discard_attempt(_EPISODE, "a1")
        store.discard_attempt(_EPISODE, "never-written")
        assert self.names(store, "a1") == []
        assert self.read(store, "a2", "episode.json") == b"{}"

    def test_the_committed_attempt_cannot_be_discarded(self, store: Store) -> None:
        self.write(store, "a1")
        store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS)
        with pytest.raises(StorageError):
            store.discard_attempt(_EPISODE, "a1")
        assert self.read(store, "a1", "episode.json") == b"{}"

    def test_every_attempt_that_has_files_is_listed(self, store: Store) -> None:
        assert list(store.attempts()) == []
        for attempt in ("a1", "a2", "a3"):
            self.write(store, attempt)
        store.commit(_EPISODE, "a1", frames=1, versions=_VERSIONS)
        store.discard_attempt(_EPISODE, "a3")
        assert sorted(store.attempts()) == [(_EPISODE, "a1"), (_EPISODE, "a2")]

    def test_an_attempts_files_are_counted_and_dated(self, store: Store) -> None:
        before_s = time.time()
        self.write(store, "a1", "abc")
        found = store.attempt_size(_EPISODE, "a1")
        assert (found.files, found.bytes) == (2, 5)
        assert abs(found.modified_s - before_s) < 3600.0  # the store's clock may be another one
        with pytest.raises(StorageError):
            store.attempt_size(_EPISODE, "a2")

    @pytest.mark.parametrize("name", ["", "..", "a/b", ".hidden", "ü"])
    def test_names_that_leave_the_place_are_refused(self, store: Store, name: str) -> None:
        with pytest.raises(StorageError):
            store.attempt_files(_EPISODE, name)
        with pytest.raises(StorageError):
            store.attempt_files(name, "a1")
