"""What is saved, how segments are cut, where an attempt may go."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from carstage.collector.errors import RecordingError
from carstage.collector.paths import prepare_folder
from carstage.collector.sensors import SENSOR_KINDS
from carstage.collector.timing import MAX_SEGMENT_BYTES, saved_index, ticks_per_segment
from carstage.collector.writing import expected_segments, writer_threads


def test_every_nth_tick_is_saved() -> None:
    assert [saved_index(tick, 1) for tick in range(3)] == [0, 1, 2]
    assert [saved_index(tick, 3) for tick in range(7)] == [0, None, None, 1, None, None, 2]


@pytest.mark.parametrize(
    ("fps", "largest", "ticks"),
    [(10.0, 100, 10), (0.5, 100, 1), (20.0, MAX_SEGMENT_BYTES // 4, 4), (20.0, 2**40, 1)],
)
def test_a_segment_is_one_second_unless_that_is_too_much(
    fps: float, largest: int, ticks: int
) -> None:
    assert ticks_per_segment(fps, [24, largest]) == ticks


def test_only_saved_ticks_are_reserved_on_disk() -> None:
    assert expected_segments({"CAM": 100}, ticks_per_segment=10, save_every=3) == {"CAM": 400}


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


def test_the_lidar_turns_once_per_tick_by_default() -> None:
    defaults = SENSOR_KINDS["lidar"].defaults(20.0)
    assert defaults["rotation_frequency"] == "20.0"
    assert defaults["range"] == "100.0"
    assert defaults["dropoff_general_rate"] == "0.0"
    assert int(defaults["points_per_second"]) % (20 * int(defaults["channels"])) == 0


def test_a_cloud_keeps_its_points_per_channel() -> None:
    counts = [2, 0, 1]
    cloud = SimpleNamespace(
        channels=3,
        horizontal_angle=0.5,
        raw_data=bytes(48),
        get_point_count=counts.__getitem__,
        __len__=lambda: 3,
    )
    meta, payload = SENSOR_KINDS["lidar"].encode(cloud)
    assert meta == {"horizontal_angle_rad": 0.5, "counts": counts}
    assert bytes(payload) == bytes(48)


def test_the_imu_is_seven_numbers() -> None:
    vector = SimpleNamespace(x=1.0, y=2.0, z=3.0)
    data = SimpleNamespace(accelerometer=vector, gyroscope=vector, compass=0.25)
    meta, payload = SENSOR_KINDS["imu"].encode(data)
    assert meta == {}
    assert memoryview(payload).cast("B").cast("d").tolist() == [1, 2, 3, 1, 2, 3, 0.25]
