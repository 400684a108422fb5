"""What is saved, how segments are cut, where an attempt may go."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace

import pytest

from carstage.collector.internals.errors import DiskFullError, RecordingError
from carstage.collector.internals.writing import expected_segments, writer_threads
from carstage.collector.paths import prepare_folder
from carstage.collector.sensors import sensor_of
from carstage.collector.timing import (
    MAX_SEGMENT_BYTES,
    Tick,
    skipped_ticks,
    ticks_per_segment,
)
from carstage.spec import SavedSteps
from carstage.spec.timing import SavedFrames


def saved(save_every: int, ticks: Iterable[int]) -> list[int | None]:
    frames = SavedFrames(SavedSteps(save_every))
    return [frames.index(tick) for tick in ticks]


def test_every_nth_tick_is_saved() -> None:
    assert saved(1, range(3)) == [0, 1, 2]
    assert saved(3, range(7)) == [0, None, None, 1, None, None, 2]


def test_a_due_frame_that_was_skipped_is_saved_at_the_next_tick_seen() -> None:
    assert saved(3, [0, 1, 4, 5, 6, 11, 12]) == [0, None, 1, None, 2, 3, 4]


def test_frames_that_a_free_server_skipped_are_ticks_with_times_in_between() -> None:
    first, later = Tick(10, 1.0, 0.1, object()), Tick(13, 1.6, 0.1, object())
    skipped = list(skipped_ticks(first, later))
    assert [(tick.frame, tick.snapshot) for tick in skipped] == [(11, None), (12, None)]
    assert [tick.timestamp_s for tick in skipped] == pytest.approx([1.2, 1.4])
    assert list(skipped_ticks(None, later)) == []
    assert list(skipped_ticks(first, first._replace(frame=11))) == []


@pytest.mark.parametrize(
    ("fps", "largest", "ticks"),
    [(10.0, 100, 10), (0.5, 100, 1), (20.0, MAX_SEGMENT_BYTES // 4, 4), (20.0, 2**40, 1)],
)
def test_a_segment_is_one_second_unless_that_is_too_much(
    fps: float, largest: int, ticks: int
) -> None:
    assert ticks_per_segment(fps, [24, largest]) == ticks


def test_only_saved_ticks_are_reserved_on_disk() -> None:
    assert expected_segments({"CAM": 100}, ticks_per_segment=10, saved_steps=SavedSteps(3)) == {
        "CAM": 400
    }


def test_small_streams_share_one_thread() -> None:
    assert writer_threads([24, 56, 5000]) == 1
    assert writer_threads([4_000_000] * 9) == 4


def test_an_attempt_is_never_recorded_over(tmp_path: Path) -> None:
    folder = tmp_path / "raw" / "a1"
    assert prepare_folder(str(folder)) == str(folder)
    (folder / "CAM").mkdir()
    with pytest.raises(RecordingError, match="is not empty"):
        prepare_folder(str(folder))
    with pytest.raises(RecordingError, match="cannot be made"):
        prepare_folder("/dev/null/a1")


def test_folder_that_finds_no_space_is_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "makedirs", refuse)
    with pytest.raises(DiskFullError, match="No space left"):
        prepare_folder(str(tmp_path / "a1"))


def test_a_cloud_keeps_its_points_per_channel() -> None:
    counts = [2, 0, 1]
    cloud = SimpleNamespace(
        channels=3,
        horizontal_angle=0.5,
        raw_data=bytes(48),
        get_point_count=counts.__getitem__,
        __len__=lambda: 3,
    )
    meta, payload = sensor_of("lidar").encode(cloud)
    assert meta == {"horizontal_angle_rad": 0.5, "counts": counts}
    assert bytes(payload) == bytes(48)


def test_the_imu_is_seven_numbers() -> None:
    vector = SimpleNamespace(x=1.0, y=2.0, z=3.0)
    data = SimpleNamespace(accelerometer=vector, gyroscope=vector, compass=0.25)
    meta, payload = sensor_of("imu").encode(data)
    assert meta == {}
    assert memoryview(payload).cast("B").cast("d").tolist() == [1, 2, 3, 1, 2, 3, 0.25]
