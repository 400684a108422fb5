"""Voxels that the embedded simulator tells: whose they are, and a recording of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import carstage
from carstage.annotation.point_sensors import record_dtype
from carstage.dataset import Dataset, Episode
from carstage.exporters import ExportOptions, export_dataset
from carstage.geometry import pose_matrix
from carstage.occupancy import FREE, VoxelGrid, Voxels, exact_voxels
from carstage.validation import validate_dataset
from running_simulator import RunningSimulator

GRID = VoxelGrid((-8.0, -8.0, -1.0), (40, 40, 10), 0.4)
HERE = pose_matrix([100.0, 50.0, 2.0], [0.0, 90.0, 0.0])
ROAD, LIGHT, RIDER, CAR, BICYCLE = 1, 7, 13, 14, 19
Said = tuple[tuple[int, int, int], int, int]
"""Voxel, actor, tag."""


def said(*rows: Said) -> NDArray[Any]:
    """A record of the simulator."""
    points = np.zeros(len(rows), record_dtype("occupancy"))
    for point, (cell, actor, tag) in zip(points, rows, strict=True):
        x, y, z = (np.array(cell) + 0.5) * GRID.side_m + GRID.low_m
        point["x"], point["y"], point["z"] = x, -y, z
        point["object_idx"], point["object_tag"] = actor, tag
    return points


def user(track_id: int, kind: str = "car", **more: Any) -> dict[str, Any]:
    """A row of a car 4 m ahead: the voxels' axis to the front is the world's y."""
    return {
        "track_id": track_id, "class": kind, "is_ego": False, "box_center": [100.0, 54.0, 2.75],
        "box_rotation_deg": [0.0, 90.0, 0.0], "box_extent": [2.0, 1.0, 0.75],
        "actor_location": [100.0, 54.0, 2.0], "actor_rotation_deg": [0.0, 90.0, 0.0],
        "velocity": [0.0, 3.0, 0.0], "angular_velocity": [0.0, 0.0, 0.0], **more,
    }  # fmt: skip


def found(points: NDArray[Any], *users: dict[str, Any]) -> Voxels:
    return exact_voxels(GRID, HERE, users, points)


def test_town_and_traffic_lights_keep_their_tags() -> None:
    voxels = found(said(((0, 1, 2), 0, ROAD), ((3, 4, 5), 77, LIGHT)))
    assert voxels.semantic[0, 1, 2] == ROAD
    assert voxels.semantic[3, 4, 5] == LIGHT
    assert np.count_nonzero(voxels.semantic != FREE) == 2
    assert not voxels.instance.any()


def test_of_the_town_what_has_most_surface_stays() -> None:
    assert found(said(((0, 0, 0), 77, LIGHT), ((0, 0, 0), 0, ROAD))).semantic[0, 0, 0] == LIGHT


def test_a_road_user_goes_before_the_town_and_the_first_before_others() -> None:
    rows = user(30), user(31, "bicycle")
    place = (30, 20, 4)
    points = said((place, 0, ROAD), (place, 31, BICYCLE), (place, 30, CAR))
    voxels = found(points, *rows)
    assert voxels.semantic[place] == BICYCLE
    assert voxels.track_id.tolist() == [31]
    assert voxels.instance[place] == 1
    assert voxels.velocity_m_s[0].tolist() == pytest.approx([3.0, 0.0, 0.0])


def test_a_van_has_the_tag_of_cars_and_a_rider_the_one_of_riders() -> None:
    rows = user(30, "van"), user(31, "bicycle")
    voxels = found(said(((30, 20, 4), 30, 15), ((31, 20, 4), 31, RIDER)), *rows)
    assert voxels.semantic[30:32, 20, 4].tolist() == [CAR, RIDER]
    assert voxels.track_id.tolist() == [30, 31]


def test_the_ego_and_who_has_no_box_leave_the_road_below_them() -> None:
    place = (20, 20, 2)
    points = said((place, 9, CAR), (place, 50, CAR), (place, 0, ROAD))
    voxels = found(points, user(9, is_ego=True))
    assert voxels.semantic[place] == ROAD
    assert len(voxels.track_id) == 0


def test_a_parked_car_is_whose_box_it_is_in() -> None:
    track = 2**52 + 7
    inside, outside = (30, 20, 4), (5, 5, 4)
    voxels = found(said((outside, 0, CAR), (inside, 0, CAR)), user(track))
    assert voxels.track_id.tolist() == [track]
    assert voxels.semantic[inside] == CAR
    assert voxels.semantic[outside] == FREE


def test_voxels_of_another_grid_are_refused() -> None:
    with pytest.raises(ValueError, match="1 voxels are outside of the grid"):
        found(said(((0, 0, 0), 0, ROAD), ((40, 0, 0), 0, ROAD)))


ASKED = {"ahead_m": 16, "behind_m": 8, "left_m": 8, "right_m": 8, "exact": True}
RECORDING: dict[str, Any] = {
    "seed": 5,
    "map": {"choice": "Stage01"},
    "duration_s": 0.4,
    "vehicles": {"count": 12},
    "pedestrians": {"count": 8},
    "image_size": [240, 160],  # so fine that it shows what a LiDAR meets far away
    "conversion": {"workers": 1},
    "labels": {"occupancy": ASKED},
    "rig": {
        "sensors": [
            {"id": "CAM", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "DEPTH", "kind": "depth", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "INSTANCE", "kind": "instance", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "LIDAR_TOP", "kind": "lidar", "pose": {"z": 2.2, "yaw_deg": 20}},
        ]
    },
}


@pytest.fixture(scope="module")
def recorded(simulator: RunningSimulator, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An episode with voxels around the ego."""
    folder = tmp_path_factory.mktemp("exact") / "out"
    at = {"kind": "remote", "host": simulator.host, "port": simulator.port}
    assert carstage.run({**RECORDING, "server": at}, folder).state == "done"
    return folder


def episode_of(dataset: Path) -> Episode:
    (episode,) = Dataset(dataset).episodes
    return episode


def test_a_recording_has_the_whole_street_and_is_valid(recorded: Path) -> None:
    assert validate_dataset(recorded).ok
    episode = episode_of(recorded)
    assert [sensor.id for sensor in episode.sensors] == ["CAM", "DEPTH", "INSTANCE", "LIDAR_TOP"]
    for k in range(episode.frames):
        content = episode.occupancy(k)
        assert content is not None
        assert content.grid.shape == (60, 40, 16)
        ground = np.isin(content.semantic, [1, 2, 10, 24, 25]).any(axis=2)
        assert ground.mean() > 0.9  # under the ego and behind houses, too
        assert (content.occupied & (content.seen == 0)).any()
        assert content.visible_by_camera.any()
        assert content.visible_by_lidar.any()


def test_a_recording_is_exported_for_readers_of_occ3d(recorded: Path, tmp_path: Path) -> None:
    export_dataset("nuscenes", recorded, tmp_path / "out", ExportOptions())
    assert list((tmp_path / "out").glob("gts/*/*/labels.npz"))


def test_voxels_around_a_sensor_are_asked_where_it_is(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    at = {"kind": "remote", "host": simulator.host, "port": simulator.port}
    labels = {"occupancy": {**ASKED, "frame": "LIDAR_TOP", "up_m": 2.0, "down_m": 3.2}}
    config = {**RECORDING, "duration_s": 0.2, "labels": labels, "server": at}
    assert carstage.run(config, tmp_path / "out").state == "done"
    assert validate_dataset(tmp_path / "out").ok
    episode = episode_of(tmp_path / "out")
    content = episode.occupancy(0)
    assert content is not None
    road_z = content.centres()[content.semantic == ROAD][:, 2]
    assert len(road_z) > 300
    assert np.abs(road_z + 2.2).max() < 0.5
