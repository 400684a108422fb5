"""What every raw store must do: give back what was written, and know what a crash cut short."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from carstage.errors import RawLogError
from carstage.rawlog import format as raw
from carstage.rawlog import payloads
from carstage.rawlog.reader import EpisodeLog
from carstage.rawlog.writing import BLOCKS, MMAP, RAW_STORES, StreamWriter, write_episode_file
from torn_segments import read_torn

pytestmark = pytest.mark.parametrize("store", RAW_STORES)

FRAME_BYTES = 4 * 32 * 20
TICKS = 5
PAYLOADS_OF = {MMAP: "000000.raw", BLOCKS: "000000.blk"}


def frame(tick: int) -> bytes:
    return bytes([tick]) * FRAME_BYTES


def episode(folder: Path) -> EpisodeLog:
    write_episode_file(str(folder), {"format_version": 1, "ticks": TICKS})
    return EpisodeLog(folder)


def write(writer: StreamWriter, tick: int, payload: bytes) -> None:
    writer.append(raw.KIND_DATA, tick, 100 + tick, tick / 10, {"tick": tick}, payload)


def test_frames_come_back_as_written(tmp_path: Path, store: str) -> None:
    log = episode(tmp_path)
    with StreamWriter(str(tmp_path), "CAM", TICKS, store=store) as writer:
        for tick in range(2 * TICKS):
            write(writer, tick, frame(tick))
            if tick % TICKS == TICKS - 1:
                writer.seal(tick)
    assert log.sealed_segments("CAM") == (0, 1)
    found = [record for index in (0, 1) for record in log.read_segment("CAM", index)]
    assert [(r.tick, r.frame, r.meta, bytes(r.payload)) for r in found] == [
        (tick, 100 + tick, {"tick": tick}, frame(tick)) for tick in range(2 * TICKS)
    ]


def test_removed_segment_leaves_nothing_and_the_next_one_alone(tmp_path: Path, store: str) -> None:
    log = episode(tmp_path)
    with StreamWriter(str(tmp_path), "CAM", TICKS, store=store) as writer:
        for tick in range(2 * TICKS):
            write(writer, tick, frame(tick))
            if tick % TICKS == TICKS - 1:
                writer.seal(tick)
    read = log.read_segment("CAM", 0)
    log.remove_segment("CAM", 0)
    left = [path.name for path in (tmp_path / "CAM").glob("000000*")]
    assert sorted(left) == (["000000.blk.free", "000000.seg.free"] if store == BLOCKS else [])
    assert log.sealed_segments("CAM") == (1,)
    assert [bytes(record.payload) for record in read] == [frame(tick) for tick in range(TICKS)]
    assert len(log.read_segment("CAM", 1)) == TICKS


@pytest.mark.parametrize("durable", [True, False])
def test_only_what_must_outlive_a_crash_of_the_machine_is_brought_to_the_disk(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, store: str, durable: bool
) -> None:
    log = episode(tmp_path)
    brought: list[int] = []
    monkeypatch.setattr(os, "fsync", brought.append)
    with StreamWriter(str(tmp_path), "CAM", TICKS, store=store, durable=durable) as writer:
        for tick in range(TICKS):
            write(writer, tick, frame(tick))
        writer.seal(TICKS - 1)
    assert bool(brought) == durable
    assert [bytes(record.payload) for record in log.read_segment("CAM", 0)] == [
        frame(tick) for tick in range(TICKS)
    ]


def test_payloads_of_another_size_and_empty_ones_come_back(tmp_path: Path, store: str) -> None:
    log = episode(tmp_path)
    contents = [frame(1), b"", b"abc", frame(2) * 2, frame(3)]
    with StreamWriter(str(tmp_path), "CAM", TICKS, store=store) as writer:
        for tick, payload in enumerate(contents):
            write(writer, tick, payload)
        writer.seal(TICKS - 1)
    assert [bytes(record.payload) for record in log.read_segment("CAM", 0)] == contents


def test_more_records_than_ticks_come_back(tmp_path: Path, store: str) -> None:
    log = episode(tmp_path)
    with StreamWriter(str(tmp_path), "CAM", 1, store=store) as writer:
        for number in range(3):
            writer.append(raw.KIND_DATA, 0, 1, 0.0, {}, frame(number))
        writer.seal(0)
    found = [bytes(record.payload) for record in log.read_segment("CAM", 0)]
    assert found == [frame(0), frame(1), frame(2)]


def test_a_sealed_segment_takes_no_more_than_its_frames(tmp_path: Path, store: str) -> None:
    with StreamWriter(str(tmp_path), "CAM", 50, 50 * FRAME_BYTES, store=store) as writer:
        write(writer, 0, frame(0))
        writer.seal(49)
    sizes = [path.stat().st_size for path in (tmp_path / "CAM").iterdir()]
    assert FRAME_BYTES < sum(sizes) < FRAME_BYTES + 1024
    assert all(
        path.name.endswith((".seg", ".raw", ".blk")) for path in (tmp_path / "CAM").iterdir()
    )


def test_a_segment_without_frames_is_sealed_and_empty(tmp_path: Path, store: str) -> None:
    log = episode(tmp_path)
    with StreamWriter(str(tmp_path), "CAM", TICKS, store=store) as writer:
        writer.seal(TICKS - 1)
    assert log.read_segment("CAM", 0) == []


def test_a_missing_or_cut_file_is_named(tmp_path: Path, store: str) -> None:
    log = episode(tmp_path)
    with StreamWriter(str(tmp_path), "CAM", TICKS, store=store) as writer:
        write(writer, 0, frame(7))
        writer.seal(TICKS - 1)
    path = tmp_path / "CAM" / PAYLOADS_OF.get(store, "000000.seg")
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size - 1)
    with pytest.raises(RawLogError, match=path.name):
        log.read_segment("CAM", 0)
    path.unlink()
    with pytest.raises(RawLogError, match=f"{path.name} is missing"):
        log.read_segment("CAM", 0)


def test_frames_come_back_where_space_cannot_be_reserved(
    tmp_path: Path, store: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(payloads, "_FALLOCATE", None)
    log = episode(tmp_path)
    with StreamWriter(str(tmp_path), "CAM", TICKS, TICKS * FRAME_BYTES, store=store) as writer:
        write(writer, 0, frame(7))
        writer.seal(TICKS - 1)
    assert [bytes(record.payload) for record in log.read_segment("CAM", 0)] == [frame(7)]


def test_files_of_removed_segments_are_used_again_and_no_new_ones_made(
    tmp_path: Path, store: str
) -> None:
    log = episode(tmp_path)
    folder = tmp_path / "CAM"
    seen: set[int] = set()
    with StreamWriter(str(tmp_path), "CAM", TICKS, store=store) as writer:
        for segment in range(6):
            # Shorter than what stood in the file before, longer, and of several sizes.
            contents = [
                bytes([1 + segment]) * (1 + 5_000 * ((segment + tick) % 4)) for tick in range(TICKS)
            ]
            for tick, content in enumerate(contents):
                write(writer, segment * TICKS + tick, content)
            writer.seal(segment * TICKS + TICKS - 1)
            found = log.read_segment("CAM", segment)
            assert [bytes(record.payload) for record in found] == contents
            seen |= {path.stat().st_ino for path in folder.iterdir()}
            log.remove_segment("CAM", segment)
    assert list(folder.glob("*.seg")) == []
    if store == BLOCKS:
        assert len(seen) == 2


WRITER = """
import sys
sys.path.insert(0, sys.argv[2])
from carstage.rawlog.writing import StreamWriter
writer = StreamWriter(sys.argv[1], "s", 1000, expected_segment_bytes=1 << 22, store=sys.argv[3])
payload = bytearray(200_003)
for tick in range(1000):
    payload[:8] = payload[-8:] = tick.to_bytes(8, "little")
    writer.append(1, tick, tick, tick / 10, {"tick": tick}, payload)
    print(tick, flush=True)
"""


def test_a_killed_writer_leaves_whole_records_and_a_torn_tail(tmp_path: Path, store: str) -> None:
    log = episode(tmp_path)
    with StreamWriter(str(tmp_path), "s", 1000, store=store) as earlier:
        for tick in range(100):  # whole records, where the files are used again
            earlier.append(1, tick, tick, 0.0, {"tick": -1}, bytes([255]) * 200_003)
        earlier.seal(999)
    log.remove_segment("s", 0)
    source = str(Path(raw.__file__).parents[2])
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path), source, store],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert writer.stdout is not None
    with writer.stdout:
        acknowledged = [int(writer.stdout.readline()) for _ in range(15)]
        os.kill(writer.pid, signal.SIGKILL)
        acknowledged += [int(line) for line in writer.stdout if line.endswith("\n")]
    writer.wait()
    found = read_torn(tmp_path / "s" / "000000.seg.open")
    assert (found.stream, found.index) == ("s", 0)
    assert len(found.records) >= len(acknowledged)
    for tick, record in enumerate(found.records):
        assert record.meta == {"tick": tick}
        assert struct.unpack_from("<Q", record.payload) == (tick,)
        assert struct.unpack_from("<Q", record.payload, len(record.payload) - 8) == (tick,)
