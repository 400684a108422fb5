"""Writing: bytes are what docs/formats/raw-log.md says, on Python 3.8 too."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

from carstage.rawlog import format as raw
from carstage.rawlog import payloads, writing


def test_segment_header_is_laid_out_as_documented() -> None:
    header = raw.pack_segment_header("CAM_FRONT", 7)
    assert len(header) == 64
    assert header[:8] == b"CSTAGLOG"
    assert struct.unpack_from("<HHI", header, 8) == (1, 64, 7)
    assert header[16:48] == b"CAM_FRONT".ljust(32, b"\0")
    assert struct.unpack_from("<I", header, 60)[0] == zlib.crc32(header[:60])
    assert raw.unpack_segment_header(header) == ("CAM_FRONT", 7)


def test_record_header_is_laid_out_as_documented() -> None:
    header = raw.RecordHeader(
        kind=raw.KIND_DATA,
        frame=2**40,
        timestamp_s=1.25,
        meta_bytes=16,
        flags=2,
        payload_bytes=2**33,
        sequence=5,
        tick=77,
    )
    data = raw.pack_record_header(header)
    assert data[:4] == b"CREC"
    assert struct.unpack_from("<HHQdIIQIIQI", data, 4) == (
        *(1, 64, 2**40, 1.25, 16, 2, 2**33, 0, 5, 77, 0),
    )
    assert struct.unpack_from("<I", data, 60)[0] == zlib.crc32(data[:60])
    assert raw.unpack_record_header(data) == header


@pytest.mark.parametrize("name", ["", "a/b", ".hidden", "a" * 32, "ümlaut", "a b"])
def test_names_that_cannot_be_folders_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="stream name"):
        raw.check_stream_name(name)


def test_payloads_begin_aligned(tmp_path: Path) -> None:
    with writing.SegmentWriter(str(tmp_path), "s", 0) as writer:
        for size in range(9):
            writer.append(raw.KIND_DATA, 0, 0, 0.0, {"x": "y" * size}, b"p" * size)
    data = (tmp_path / "000000.seg.open").read_bytes()
    whole, end = raw.iter_whole_records(data)
    assert end == len(data)
    assert len(whole) == 9
    assert all((offset + 64 + header.meta_bytes) % 8 == 0 for offset, header in whole)


def test_a_tick_outside_the_open_segment_is_refused(tmp_path: Path) -> None:
    with writing.StreamWriter(str(tmp_path), "s", 4) as writer:
        with pytest.raises(ValueError, match="belongs to segment 1"):
            writer.append(raw.KIND_DATA, 4, 0, 0.0, {})
        writer.seal(3)
        with pytest.raises(ValueError, match="belongs to segment 0"):
            writer.append(raw.KIND_DATA, 3, 0, 0.0, {})
        with pytest.raises(ValueError, match="cannot end with tick 8"):
            writer.seal(8)


def test_sealing_renames_and_cuts_what_was_reserved(tmp_path: Path) -> None:
    with writing.StreamWriter(str(tmp_path), "s", 2, expected_segment_bytes=1 << 20) as writer:
        writer.append(raw.KIND_DATA, 0, 3, 0.3, {}, b"12345")
        assert (tmp_path / "s" / "000000.seg.open").exists()
        sealed = writer.seal(1)
    assert (sealed.first_tick, sealed.last_tick, sealed.records) == (0, 1, 1)
    assert not (tmp_path / "s" / "000000.seg.open").exists()
    data = (tmp_path / "s" / "000000.seg").read_bytes()
    whole, end = raw.iter_whole_records(data)
    assert end == len(data)
    assert [header.kind for _, header in whole] == [raw.KIND_DATA, raw.KIND_SEAL]
    assert whole[-1][0] == sealed.bytes


def test_reserved_bytes_are_no_part_of_an_open_segment(tmp_path: Path) -> None:
    # A writer killed in the middle of a payload must not leave zeros that complete the record.
    with writing.SegmentWriter(str(tmp_path), "s", 0, expected_bytes=1 << 20) as writer:
        writer.append(raw.KIND_DATA, 0, 3, 0.3, {}, b"12345")
        path = tmp_path / "000000.seg.open"
        assert path.stat().st_size == writer.size < 1 << 20
        writer.seal(0, 0)
    sealed = (tmp_path / "000000.seg").stat()
    assert sealed.st_blocks * 512 < 1 << 20, "what was reserved is given back"


def test_a_segment_is_never_written_twice(tmp_path: Path) -> None:
    with writing.SegmentWriter(str(tmp_path), "s", 0) as writer:
        with pytest.raises(FileExistsError):
            writing.SegmentWriter(str(tmp_path), "s", 0)
        writer.seal(0, 0)
    with pytest.raises(FileExistsError):
        writing.SegmentWriter(str(tmp_path), "s", 0)


def test_a_write_cut_short_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole_write = os.pwritev

    def some_bytes_only(fd: int, buffers: list[memoryview], offset: int) -> int:
        return whole_write(fd, [buffers[0][:37]], offset)

    monkeypatch.setattr(os, "pwritev", some_bytes_only)
    payload = bytes(range(256)) * 3
    with writing.SegmentWriter(str(tmp_path), "s", 0) as writer:
        writer.append(raw.KIND_DATA, 0, 1, 0.1, {"a": 1}, payload)
    data = (tmp_path / "000000.seg.open").read_bytes()
    ((offset, header),) = raw.iter_whole_records(data)[0]
    start = offset + 64 + header.meta_bytes
    assert data[start : start + header.payload_bytes] == payload


def test_reserving_is_given_up_where_the_file_system_only_pretends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(payloads, "_FALLOCATE", lambda *_: 0)
    with (tmp_path / "file").open("wb") as file:
        assert not payloads.reserve(file.fileno(), 1 << 20)
    assert (tmp_path / "file").stat().st_size == 0


def test_meta_refuses_what_json_does_not_have() -> None:
    with pytest.raises(ValueError, match="Out of range"):
        raw.encode_meta({"x": float("nan")})


@pytest.mark.py38
def test_the_writer_runs_under_python_3_8(tmp_path: Path, python38: str) -> None:
    code = (
        "import sys; sys.path.insert(0, sys.argv[2])\n"
        "from carstage.rawlog.writing import StreamWriter\n"
        "for store in 'chunklog', 'mmap':\n"
        "    with StreamWriter(sys.argv[1], store, 2, store=store) as writer:\n"
        "        writer.append(1, 0, 1, 0.1, {'a': 1}, b'xyz')\n"
        "        writer.seal(1)\n"
    )
    source = Path(raw.__file__).parents[2]
    subprocess.run([python38, "-I", "-c", code, str(tmp_path / "old"), str(source)], check=True)
    subprocess.run(
        [sys.executable, "-I", "-c", code, str(tmp_path / "new"), str(source)], check=True
    )
    for file in ("chunklog/000000.seg", "mmap/000000.seg", "mmap/000000.raw"):
        assert (tmp_path / "old" / file).read_bytes() == (tmp_path / "new" / file).read_bytes()
