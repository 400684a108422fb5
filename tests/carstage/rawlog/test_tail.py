"""The newest record of a stream that is being written."""

from pathlib import Path

import pytest

from carstage.rawlog import format as raw
from carstage.rawlog.reader import EpisodeLog
from carstage.rawlog.tail import NewestRecords
from carstage.rawlog.writing import BLOCKS, RAW_STORES, SegmentWriter, write_episode_file


def write(writer: SegmentWriter, tick: int, payload: bytes) -> None:
    writer.append(raw.KIND_DATA, tick, tick + 100, tick / 10, {"width": tick}, payload)


@pytest.mark.parametrize("store", RAW_STORES)
def test_the_newest_whole_record_is_read_before_its_segment_is_sealed(
    tmp_path: Path, store: str
) -> None:
    folder = tmp_path / "CAM"
    newest = NewestRecords(tmp_path, "CAM")
    assert newest.look() is None
    folder.mkdir()
    with SegmentWriter(str(folder), "CAM", 0, store=store, slots=4) as writer:
        assert newest.look() is None
        write(writer, 0, b"a" * 100)
        write(writer, 1, b"b" * 100)
        record = newest.look()
        assert record is not None
        assert (record.tick, record.meta, record.payload) == (1, {"width": 1}, b"b" * 100)
        assert newest.look() is None
        write(writer, 2, b"c" * 100)
        writer.seal(0, 2)
    record = newest.look()
    assert record is not None
    assert record.payload == b"c" * 100
    with SegmentWriter(str(folder), "CAM", 1, store=store, slots=4) as writer:
        write(writer, 3, b"d" * 100)
        record = newest.look()
        assert record is not None
        assert record.tick == 3


def test_a_record_that_is_still_written_is_not_read(tmp_path: Path) -> None:
    folder = tmp_path / "CAM"
    folder.mkdir()
    with SegmentWriter(str(folder), "CAM", 0) as writer:
        write(writer, 0, b"a" * 100)
        write(writer, 1, b"b" * 100)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    newest = NewestRecords(tmp_path, "CAM")
    path.write_bytes(whole[:-50])
    record = newest.look()
    assert record is not None
    assert record.tick == 0
    assert newest.look() is None
    path.write_bytes(whole)
    record = newest.look()
    assert record is not None
    assert record.tick == 1


def test_a_record_whose_segment_is_removed_while_it_is_read_is_not_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "CAM"
    folder.mkdir()
    write_episode_file(str(tmp_path), {"format_version": 1})
    log = EpisodeLog(tmp_path)
    with SegmentWriter(str(folder), "CAM", 0, store=BLOCKS) as writer:
        write(writer, 0, b"a" * 100)
        writer.seal(0, 0)

    def later(self: NewestRecords, suffix: str, place: int, size: int) -> bytes | None:
        log.remove_segment("CAM", 0)
        with SegmentWriter(str(folder), "CAM", 1, store=BLOCKS) as writer:
            write(writer, 1, b"b" * 100)
        return b"b" * size

    with monkeypatch.context() as patch:
        patch.setattr(NewestRecords, "_payload_elsewhere", later)
        newest = NewestRecords(tmp_path, "CAM")
        assert newest.look() is None
    record = newest.look()
    assert record is not None
    assert (record.tick, record.payload) == (1, b"b" * 100)


def test_a_log_that_is_removed_meanwhile_gives_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "CAM"
    folder.mkdir()
    newest = NewestRecords(tmp_path, "CAM")
    (folder / "000000.seg").write_bytes(b"")
    assert newest.look() is None
    (folder / "000000.seg").unlink()
    assert newest.look() is None
