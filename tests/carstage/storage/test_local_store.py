"""The folder store: the contract of all stores, and what is its own."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest

from carstage.errors import (
    BadInputError,
    DatasetError,
    DiskFullError,
    EpisodeExistsError,
    StorageError,
)
from carstage.storage import CommitMarker, LocalStore, Store, open_store
from carstage.testing.store import StoreTests


class TestLocalStore(StoreTests):
    def open(self, place: Path) -> Store:
        return LocalStore(place / "out")

    def test_the_first_name_stays(self, place: Path, store: Store) -> None:
        self.open(place).initialise("another name")
        assert json.loads((place / "out" / "dataset.json").read_text())["name"] == "test"

    def test_nothing_but_the_marker_stays_in_commits(self, place: Path, store: Store) -> None:
        self.write(store, "a1")
        store.commit("0123456789abcdef", "a1", frames=1, versions={})
        store.initialise("test")
        names = sorted(path.name for path in (place / "out" / "commits").iterdir())
        assert names == ["0123456789abcdef.json"]

    def test_a_commit_removes_the_leases_of_its_episode(self, place: Path, store: Store) -> None:
        self.write(store, store.reserve_attempt("0123456789abcdef", {"run_id": "r"}))
        (lease,) = (place / "out" / "leases").iterdir()
        assert lease.name == "0123456789abcdef.1"
        assert json.loads(lease.read_bytes()) == {"run_id": "r"}
        store.commit("0123456789abcdef", "a1", frames=1, versions={})
        assert not (place / "out" / "leases").exists()
        self.write(store, store.reserve_attempt("0123456789abcdef", {}))  # one who comes late
        with pytest.raises(EpisodeExistsError):
            store.commit("0123456789abcdef", "a2", frames=1, versions={})
        assert not (place / "out" / "leases").exists()

    def test_leases_that_a_killed_commit_left_are_forgotten(
        self, place: Path, store: Store
    ) -> None:
        self.write(store, "a1")
        store.commit("0123456789abcdef", "a1", frames=1, versions={})
        store.reserve_attempt("0123456789abcdef", {})
        store.reserve_attempt("fedcba9876543210", {})  # which somebody may be recording
        store.forget_leases(store.committed().keys())
        (lease,) = (place / "out" / "leases").iterdir()
        assert lease.name == "fedcba9876543210.1"

    def test_an_attempt_that_cannot_be_begun_is_a_storage_error(self, place: Path) -> None:
        (place / "out").mkdir()
        (place / "out" / "episodes").write_text("a file")
        with pytest.raises(StorageError, match="cannot be created"):
            self.open(place).reserve_attempt("0123456789abcdef", {})

    def test_equal_attempts_give_equal_markers_in_any_folder(self, tmp_path: Path) -> None:
        contents = []
        for name in ("one", "two"):
            store = LocalStore(tmp_path / name)
            store.initialise("test")
            self.write(store, "a1")
            store.commit("0123456789abcdef", "a1", frames=1, versions={"client": "0.9.16"})
            contents.append((tmp_path / name / "commits" / "0123456789abcdef.json").read_bytes())
        assert contents[0] == contents[1]

    def test_a_damaged_marker_is_an_error_and_no_missing_episode(
        self, place: Path, store: Store
    ) -> None:
        (place / "out" / "commits" / "0123456789abcdef.json").write_text('{"format_version": 1')
        with pytest.raises(DatasetError, match=r"0123456789abcdef\.json"):
            store.committed()

    def test_a_marker_under_another_name_is_refused(self, place: Path, store: Store) -> None:
        self.write(store, "a1")
        store.commit("0123456789abcdef", "a1", frames=1, versions={})
        commits = place / "out" / "commits"
        (commits / "0123456789abcdef.json").rename(commits / "fedcba9876543210.json")
        with pytest.raises(DatasetError, match="speaks of episode"):
            store.committed()

    def test_a_file_in_the_place_of_the_folder_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "out").write_text("")
        with pytest.raises(StorageError, match="cannot be created"):
            LocalStore(tmp_path / "out").initialise("test")

    @pytest.mark.parametrize("number", [errno.EACCES, errno.EROFS, errno.ENOSPC])
    def test_a_folder_that_cannot_be_written_is_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
    ) -> None:
        def refuse(source: Path, target: Path) -> None:
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(os, "link", refuse)  # a mode would not stop root
        with pytest.raises(StorageError, match="not writable"):
            LocalStore(tmp_path).initialise("test")

    def test_a_disk_too_full_for_the_marker_is_told_as_full(
        self, place: Path, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(source: Path, target: Path) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        self.write(store, "a1")
        monkeypatch.setattr(os, "link", refuse)
        with pytest.raises(DiskFullError, match="No space left"):
            store.commit("0123456789abcdef", "a1", frames=1, versions={})
        assert list((place / "out" / "commits").iterdir()) == []

    def test_a_file_system_that_replaces_silently_is_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def overwrite(source: Path, target: Path) -> None:
            Path(target).write_bytes(Path(source).read_bytes())

        monkeypatch.setattr(os, "link", overwrite)
        with pytest.raises(StorageError, match="silently replaces"):
            LocalStore(tmp_path).initialise("test")
        assert list((tmp_path / "commits").iterdir()) == []

    def test_a_file_system_without_hard_links_is_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(source: Path, target: Path) -> None:
            raise PermissionError(1, "Operation not permitted")

        monkeypatch.setattr(os, "link", refuse)
        with pytest.raises(StorageError, match="hard links"):
            LocalStore(tmp_path).initialise("test")

    def test_a_dataset_of_another_version_is_refused(self, tmp_path: Path) -> None:
        tmp_path.joinpath("dataset.json").write_text('{"format_version": 99}')
        with pytest.raises(DatasetError, match="format version 99"):
            LocalStore(tmp_path).initialise("test")


def test_a_path_or_a_file_url_opens_the_folder_store(tmp_path: Path) -> None:
    for out in (tmp_path, str(tmp_path), f"file://{tmp_path}"):
        store = open_store(out)
        assert isinstance(store, LocalStore)
        assert store.root == tmp_path


def test_an_unknown_scheme_is_bad_input() -> None:
    with pytest.raises(BadInputError, match="gopher://"):
        open_store("gopher://example/data")


def test_a_file_url_is_decoded_and_names_this_machine(tmp_path: Path) -> None:
    for url in ("file:///data/my%20set", "file://localhost/data/my%20set"):
        store = open_store(url)
        assert isinstance(store, LocalStore)
        assert store.root == Path("/data/my set")
    with pytest.raises(BadInputError, match="otherhost"):
        open_store("file://otherhost/data")


def test_a_marker_of_another_version_is_refused() -> None:
    with pytest.raises(DatasetError, match="format version 3"):
        CommitMarker.from_bytes(b'{"format_version": 3}', "x.json")
