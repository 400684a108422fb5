"""The bytes of a log, against CARLA's documented layout, and what becomes of bad files."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from carstage_sim.recording import RecorderController, RecordingError, RecordingsFolder
from carstage_sim.recording.events import ActorAdded, actors_added, actors_added_packet
from carstage_sim.recording.layout import HEADER, RECORDS, LogInfo, Packet, records, text
from carstage_sim.recording.log import RecordingLog
from carstage_sim.world.pose import Pose

NUMBERS = st.floats(-1000.0, 1000.0, width=32)
TEXTS = st.text(max_size=20)


@pytest.fixture
def recorder(tmp_path: Path) -> Iterator[RecorderController]:
    recorder = RecorderController(RecordingsFolder(tmp_path))
    yield recorder
    recorder.end_episode()


def test_head_has_the_documented_bytes() -> None:
    expected = (
        b"\x01\x00"
        + b"\x0e\x00CARLA_RECORDER"
        + struct.pack("<q", 1_550_000_000)
        + b"\x06\x00Town06"
    )
    assert LogInfo(1, 1_550_000_000, "Town06").encode() == expected


def test_records_have_the_documented_sizes() -> None:
    sizes = {packet.name: dtype.itemsize for packet, dtype in RECORDS.items()}
    assert sizes == {
        "EVENT_DEL": 4, "EVENT_PARENT": 8, "COLLISION": 14, "POSITION": 28, "STATE": 10,
        "ANIM_VEHICLE": 21, "ANIM_WALKER": 8, "VEHICLE_LIGHT": 8, "SCENE_LIGHT": 26,
        "KINEMATICS": 28, "BOUNDING_BOX": 28, "TRIGGER_VOLUME": 28, "TRAFFIC_LIGHT_TIME": 16,
        "VEHICLE_DOOR": 6, "WEATHER": 56,
    }  # fmt: skip


@given(
    actor_id=st.integers(1, 2**32 - 1),
    place=st.tuples(NUMBERS, NUMBERS, NUMBERS),
    type_id=TEXTS,
    attributes=st.lists(st.tuples(st.integers(0, 4), TEXTS, TEXTS), max_size=5),
)
def test_added_actors_are_read_as_they_were_written(
    actor_id: int,
    place: tuple[float, float, float],
    type_id: str,
    attributes: list[tuple[int, str, str]],
) -> None:
    added = ActorAdded(actor_id, 1, Pose(place, (1.0, 2.0, 3.0)), 7, type_id, tuple(attributes))
    packet = actors_added_packet([added, added])
    kind, size = HEADER.unpack_from(packet)
    assert (kind, size) == (Packet.EVENT_ADD, len(packet) - HEADER.size)
    first, second = actors_added(packet[HEADER.size :])
    assert first == second
    assert (first.actor_id, first.type_id, first.attributes) == (
        actor_id, type_id, tuple(attributes)
    )  # fmt: skip
    assert first.pose.location == pytest.approx(place, abs=1e-3)
    assert first.pose.rotation_deg == pytest.approx((1.0, 2.0, 3.0))


def test_bytes_of_a_client_that_are_no_utf8_are_written_as_they_came() -> None:
    assert text(b"a\xff".decode(errors="surrogateescape")) == b"\x02\x00a\xff"


def test_a_count_that_promises_more_records_than_there_are_counts_what_is_there() -> None:
    assert [int(row["id"]) for row in records(Packet.EVENT_DEL, b"\x09\x00\5\0\0\0\6\0")] == [5]


@given(garbage=st.binary(max_size=300))
def test_garbage_after_the_head_is_never_a_frame_and_never_fails(
    garbage: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("garbage") / "a.log"
    path.write_bytes(LogInfo(1, 0, "Town06").encode() + garbage)
    with RecordingLog(path) as log:
        for index in range(len(log.frames)):
            list(log.packets(index))


@pytest.mark.parametrize("content", [b"", b"\x01\x00", b"x" * 100, b"\xff\xff\xff\xff"])
def test_a_file_that_is_no_log_is_told_so(
    content: bytes, recorder: RecorderController, tmp_path: Path
) -> None:
    (tmp_path / "note.txt").write_bytes(content)
    with pytest.raises(RecordingError, match="File is not a CARLA recorder"):
        recorder.file_info("note.txt", show_all=True)


def test_a_missing_file_is_told_in_the_words_of_carla(
    recorder: RecorderController, tmp_path: Path
) -> None:
    with pytest.raises(RecordingError, match=f"File {tmp_path}/none.log not found on server"):
        recorder.file_info("none.log", show_all=False)


@pytest.mark.parametrize(
    "name", ["../up.log", "a/../../up.log", "", " ", "C:\\logs\\a.log", "a\0b", ".."]
)
def test_names_that_lead_out_of_the_folder_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError):
        RecordingsFolder(tmp_path).log(name)


def test_absolute_and_relative_paths_lie_in_the_folder(tmp_path: Path) -> None:
    folder = RecordingsFolder(tmp_path)
    assert folder.log("/data/a.log") == tmp_path / "data" / "a.log"
    assert folder.log("runs/a.log") == tmp_path / "runs" / "a.log"
    assert folder.log(str(tmp_path / "a.log")) == tmp_path / "a.log"  # as it answered before


def test_absolute_paths_are_refused_where_the_server_says_so(tmp_path: Path) -> None:
    folder = RecordingsFolder(tmp_path, absolute=False)
    with pytest.raises(RecordingError, match="absolute path"):
        folder.log("/data/a.log")
    assert folder.log(str(tmp_path / "a.log")) == tmp_path / "a.log"


def test_links_in_the_folder_lead_nowhere_else(tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "way").symlink_to(tmp_path)
    (tmp_path / "recordings" / "a.log").symlink_to(tmp_path / "authorized_keys")
    folder = RecordingsFolder(tmp_path / "recordings")
    for name in ("way/a.log", "a.log"):
        with pytest.raises(RecordingError, match="leads out"):
            folder.log(name)
