"""A name in a dataset stands for a whole file or for none."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest

from carstage.dataset.tables import read_table, write_table
from carstage.files.whole import make_folders, whole_file, write_whole
from carstage.report import html, write_report


def test_content_replaces_what_stood_there(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    write_whole(path, b"first")
    write_whole(path, b"second")
    assert path.read_bytes() == b"second"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.bin"]


def test_the_names_of_new_folders_are_made_durable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed: list[Path] = []
    monkeypatch.setattr("carstage.files.whole.flush_folder", flushed.append)
    make_folders(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    assert set(flushed) == {tmp_path, tmp_path / "a"}
    flushed.clear()
    make_folders(tmp_path / "a" / "b")  # who made it may not have come to it
    assert flushed == [tmp_path / "a"]


def test_a_failure_keeps_what_stood_there_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    write_whole(path, b"first")

    def fail() -> None:
        with whole_file(path) as temporary:
            temporary.write_bytes(b"sec")
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        fail()
    assert path.read_bytes() == b"first"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.bin"]


def test_a_table_that_cannot_be_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.parquet"
    table = pa.table({"k": [1, 2]})
    write_table(table, path)

    def break_off(_: pa.Table, where: Path, **options: object) -> None:
        Path(where).write_bytes(b"PAR1")
        raise OSError("disk full")

    monkeypatch.setattr("carstage.dataset.tables.pq.write_table", break_off)
    with pytest.raises(OSError, match="disk full"):
        write_table(table, path)
    assert read_table(path).equals(table)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.parquet"]


def test_a_report_that_cannot_be_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "commits").mkdir()
    (tmp_path / "dataset.json").write_text('{"format_version": 1, "name": "empty", "tags": []}')
    path = write_report(tmp_path)
    before = path.read_bytes()
    monkeypatch.setattr(html, "page", lambda *_: "\ud800")  # no UTF-8 can hold it
    with pytest.raises(UnicodeEncodeError):
        write_report(tmp_path)
    assert path.read_bytes() == before
