"""Reading: round trips, damage of every kind, and what is left after a kill."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from carstage.errors import RawLogError
from carstage.rawlog import format as raw
from carstage.rawlog import reader, writing
from carstage.rawlog.reader import EpisodeLog, Record
from torn_segments import WholeRecord, read_torn

FLOATS = st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.none() | st.booleans() | st.integers(-(2**53), 2**53) | FLOATS | st.text(max_size=8)
METAS = st.dictionaries(st.text(max_size=5), VALUES, max_size=4)
RECORDS = st.lists(st.tuples(METAS, st.binary(max_size=64)), max_size=8)
SETTINGS = settings(
    deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def episode(folder: Path, **header: Any) -> EpisodeLog:
    writing.write_episode_file(str(folder), {"format_version": 1, "ticks": 1, **header})
    return EpisodeLog(folder)


def write_segment(
    folder: Path,
    records: list[tuple[dict[str, Any], bytes]],
    *,
    stream: str = "s",
    seal: bool = True,
) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("000000.seg*"):
        old.unlink()
    with writing.SegmentWriter(str(folder), stream, 0) as writer:
        for number, (meta, payload) in enumerate(records):
            writer.append(raw.KIND_DATA, number, 100 + number, number / 10, meta, payload)
        if not seal:
            return Path(writer.open_path)
        return Path(writer.seal(0, max(0, len(records) - 1)).path)


def contents(records: Sequence[Record | WholeRecord]) -> list[tuple[dict[str, Any], bytes]]:
    return [(record.meta, bytes(record.payload)) for record in records]


@SETTINGS
@given(records=RECORDS)
def test_records_come_back_as_written(
    tmp_path: Path, records: list[tuple[dict[str, Any], bytes]]
) -> None:
    log = episode(tmp_path)
    write_segment(tmp_path / "s", records)
    found = log.read_segment("s", 0)
    assert contents(found) == records
    assert [(r.tick, r.frame, r.timestamp_s, r.sequence) for r in found] == [
        (n, 100 + n, n / 10, n) for n in range(len(records))
    ]


@SETTINGS
@given(data=st.data(), records=RECORDS)
def test_a_log_torn_at_any_byte_gives_back_the_whole_records_before(
    tmp_path: Path, data: st.DataObject, records: list[tuple[dict[str, Any], bytes]]
) -> None:
    path = write_segment(tmp_path / "s", records, seal=False)
    size = path.stat().st_size
    cut = data.draw(st.integers(raw.HEADER_BYTES, size))
    ends = [at + header.record_bytes for at, header in raw.iter_whole_records(path.read_bytes())[0]]
    with path.open("r+b") as file:
        file.truncate(cut)
    found = read_torn(path)
    assert contents(found.records) == records[: sum(end <= cut for end in ends)]
    assert found.whole_bytes == max((end for end in ends if end <= cut), default=raw.HEADER_BYTES)


def test_torn_at_every_single_byte(tmp_path: Path) -> None:
    records = [({"n": n}, bytes([n]) * (n * 5)) for n in range(4)]
    path = write_segment(tmp_path / "s", records, seal=False)
    whole = path.read_bytes()
    ends = [at + header.record_bytes for at, header in raw.iter_whole_records(whole)[0]]
    for cut in range(len(whole) + 1):
        path.write_bytes(whole[:cut])
        if cut < raw.HEADER_BYTES:
            with pytest.raises(raw.FormatError):
                read_torn(path)
        else:
            assert len(read_torn(path).records) == sum(end <= cut for end in ends)


def test_a_sealed_segment_cut_at_any_byte_is_refused(tmp_path: Path) -> None:
    log = episode(tmp_path)
    path = write_segment(tmp_path / "s", [({"n": 1}, b"abc"), ({}, b"defgh")])
    whole = path.read_bytes()
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        with pytest.raises(RawLogError, match=r"000000\.seg"):
            log.read_segment("s", 0)


def test_a_flipped_bit_is_caught_in_every_header_and_padding(tmp_path: Path) -> None:
    log = episode(tmp_path)
    path = write_segment(tmp_path / "s", [({"n": 1}, b"abcdefgh")])
    whole = path.read_bytes()
    expected = contents(log.read_segment("s", 0))
    (data_at, data_header), (seal_at, seal_header) = raw.iter_whole_records(whole)[0]
    # Only headers carry a CRC. Metas and payloads have none.
    unprotected = [
        range(at + raw.HEADER_BYTES, at + header.record_bytes)
        for at, header in ((data_at, data_header), (seal_at, seal_header))
    ]
    for offset in range(len(whole)):
        if any(offset in part for part in unprotected):
            continue
        path.write_bytes(whole[:offset] + bytes([whole[offset] ^ 0x10]) + whole[offset + 1 :])
        with pytest.raises(RawLogError, match=r"000000\.seg"):
            log.read_segment("s", 0)
    path.write_bytes(whole)
    assert contents(log.read_segment("s", 0)) == expected


def test_a_missing_record_is_noticed(tmp_path: Path) -> None:
    log = episode(tmp_path)
    path = write_segment(tmp_path / "s", [({}, b"12345678"), ({}, b"12345678")])
    whole = path.read_bytes()
    (first, header), *_ = raw.iter_whole_records(whole)[0]
    path.write_bytes(whole[:first] + whole[first + header.record_bytes :])
    with pytest.raises(RawLogError, match="record 0 is missing"):
        log.read_segment("s", 0)


def test_a_segment_in_the_wrong_place_is_refused(tmp_path: Path) -> None:
    log = episode(tmp_path)
    write_segment(tmp_path / "s", [({}, b"x")], stream="other")
    with pytest.raises(RawLogError, match="of stream 'other'"):
        log.read_segment("s", 0)


def test_open_segments_are_not_listed(tmp_path: Path) -> None:
    log = episode(tmp_path)
    with writing.StreamWriter(str(tmp_path), "s", 1) as writer:
        writer.append(raw.KIND_DATA, 0, 1, 0.1, {})
        assert log.sealed_segments("s") == ()
        writer.seal(0)
        writer.append(raw.KIND_DATA, 1, 2, 0.2, {})
        assert log.sealed_segments("s") == (0,)
    assert log.streams == ("s",)
    assert log.sealed_segments("nothing") == ()


@pytest.mark.parametrize("text", ["", "[]", '{"format_version": 2}', "{"])
def test_an_unreadable_episode_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "episode.json").write_text(text)
    with pytest.raises(RawLogError, match=r"episode\.json"):
        EpisodeLog(tmp_path)


def test_a_missing_episode_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RawLogError, match="is missing"):
        EpisodeLog(tmp_path)


def test_payloads_can_be_mapped_in_place(tmp_path: Path) -> None:
    log = episode(tmp_path)
    values = np.arange(6, dtype="<f8")
    write_segment(tmp_path / "s", [({"odd": True}, values.tobytes())])
    (record,) = log.read_segment("s", 0)
    array = np.frombuffer(record.payload, dtype="<f8")
    assert array.flags.aligned
    assert not array.flags.writeable
    np.testing.assert_array_equal(array, values)


def test_world_frames_and_actors_come_back(tmp_path: Path) -> None:
    log = episode(tmp_path, ticks=2)
    actors = {7: np.arange(15.0), 9: np.arange(15.0) + 100}
    payload = b"".join(raw.ACTOR_RECORD.pack(id, 0, *row) for id, row in actors.items())
    box = {"location": [0, 0, 1], "extent": [2, 1, 1], "rotation_deg": [0, 90, 0]}
    table = {
        "id": 7,
        "type_id": "vehicle.a.b",
        "parent": 0,
        "attributes": {"color": "1,2,3"},
        "semantic_tags": [14],
        "box": box,
    }
    with writing.StreamWriter(str(tmp_path), "world", 1) as world:
        world.append(raw.KIND_TABLE, 0, 50, 5.0, {"actors": [table]})
        world.append(raw.KIND_DATA, 0, 50, 5.0, {"delta_s": 0.1}, payload)
        world.seal(0)
        world.append(raw.KIND_TABLE, 1, 51, 5.1, {"actors": [{**table, "id": 9, "parent": 7}]})
        world.append(raw.KIND_DATA, 1, 51, 5.1, {"delta_s": 0.1}, payload)
        world.seal(1)
    (frame,) = log.world_frames(0)
    assert (frame.tick, frame.frame, frame.timestamp_s) == (0, 50, 5.0)
    assert frame.meta == {"delta_s": 0.1}
    np.testing.assert_array_equal(frame.actor_id, [7, 9])
    np.testing.assert_array_equal(frame.location, [[0, 1, 2], [100, 101, 102]])
    np.testing.assert_array_equal(frame.acceleration[1], [112, 113, 114])
    assert frame.row(9) == 1
    with pytest.raises(KeyError):
        frame.row(8)
    assert set(log.actors(up_to_segment=0)) == {7}
    found = log.actors()
    assert set(found) == {7, 9}
    assert found[9].parent == 7
    assert found[7].semantic_tags == (14,)
    np.testing.assert_array_equal(found[7].box_extent, [2, 1, 1])


def test_tables_of_earlier_segments_are_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    episode(tmp_path, ticks=20)
    box = dict.fromkeys(("location", "extent", "rotation_deg"), (0, 0, 0))
    row = {"name": "Sign", "label": 8, "light": 0, "box": box}
    with writing.StreamWriter(str(tmp_path), raw.WORLD, 1) as world:
        for tick in range(20):
            world.append(raw.KIND_TABLE, tick, tick, 0.0, {"level_objects": [{**row, "id": tick}]})
            world.seal(tick)
    opened = []
    mapped = reader._mapped
    monkeypatch.setattr(reader, "_mapped", lambda path: opened.append(path) or mapped(path))
    for segment in range(20):
        found = EpisodeLog(tmp_path).level_objects(up_to_segment=segment)
        assert [one.id for one in found] == list(range(segment + 1))
    assert len(opened) == 20


def test_the_log_is_complete_when_every_tick_is_sealed(tmp_path: Path) -> None:
    log = episode(tmp_path, ticks=3)
    with writing.StreamWriter(str(tmp_path), "ledger", 2) as ledger:
        for tick in range(3):
            ledger.append(raw.KIND_DATA, tick, tick + 9, tick / 10, {"k": tick})
            if tick == 1:
                ledger.seal(1)
        assert not log.is_complete()
        ledger.seal(2)
    assert log.is_complete()
    assert [(row["tick"], row["frame"], row["k"]) for row in log.ledger()] == [
        *((0, 9, 0), (1, 10, 1), (2, 11, 2)),
    ]


def test_level_objects_are_read_and_logs_without_them_have_none(tmp_path: Path) -> None:
    box = {"location": [1.0, 2.0, 3.0], "extent": [0.5, 0.5, 0.5], "rotation_deg": [0.0, 9.0, 0.0]}
    row = {"id": 2**64 - 1, "name": "Sign_1", "label": 8, "light": 0, "box": box}
    log = episode(tmp_path)
    for table in ({"actors": []}, {"actors": [], "level_objects": [row]}):
        folder = tmp_path / raw.WORLD
        folder.mkdir(exist_ok=True)
        for old in folder.iterdir():
            old.unlink()
        with writing.SegmentWriter(str(folder), raw.WORLD, 0) as writer:
            writer.append(raw.KIND_TABLE, 0, 100, 0.0, table, b"")
            writer.seal(0, 0)
        found = [(one.id, one.name, one.label) for one in log.level_objects()]
        assert found == [(2**64 - 1, "Sign_1", 8)] * len(table.get("level_objects", []))
        assert log.actors() == {}


def test_the_text_of_a_map_is_what_was_written_or_refused(tmp_path: Path) -> None:
    text = "<OpenDRIVE>\r\n\u00e9</OpenDRIVE>\n"
    log = episode(tmp_path, map_crc32=writing.write_map_file(str(tmp_path), text))
    assert log.opendrive() == text.encode()
    path = tmp_path / raw.MAP_FILE
    for damaged in (text.encode()[:-3], text.encode().replace(b"D", b"d"), b""):
        path.write_bytes(damaged)
        with pytest.raises(RawLogError, match="not what was written"):
            log.opendrive()
    path.unlink()
    with pytest.raises(RawLogError, match="is missing"):
        log.opendrive()
    assert episode(tmp_path).opendrive() is None  # as before versions that wrote it
