"""OPV2V: what OpenCOOD's reader finds in an export is what the dataset holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from carstage.exporters.formats.opv2v_files import pcd
from carstage.geometry import box_corners, pose_matrix, transform_points
from fleet_dataset import FRAMES
from opencood_reading import CooperativeFrame, corners_from_lidar, read_pcd, read_split, world_from

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("fleet")]

Moments = list[dict[str, CooperativeFrame]]


@pytest.fixture(scope="module")
def exported(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("opv2v") / "out"
    export_dataset("opv2v", fleet, out, workers=0)
    return out


@pytest.fixture(scope="module")
def moments(exported: Path) -> Moments:
    (found,) = read_split(exported / "train").values()
    return found


def test_the_ego_comes_first_and_the_roadside_unit_last(fleet: Path, moments: Moments) -> None:
    (episode,) = Dataset(fleet).episodes
    assert len(moments) == FRAMES
    for moment in moments:
        ids = list(moment)
        assert int(ids[0]) == episode.document["ego_id"]
        assert int(ids[1]) == episode.agent("car2").document["ego_id"]
        assert ids[2] == "-1"
        assert [frame.is_ego for frame in moment.values()] == [True, False, False]
        assert [frame.params["RSU"] for frame in moment.values()] == [False, False, True]


def test_poses_points_and_speeds_are_those_of_the_dataset(fleet: Path, moments: Moments) -> None:
    (episode,) = Dataset(fleet).episodes
    for k, moment in enumerate(moments):
        for view, found in zip(episode.views, moment.values(), strict=True):
            frame = list(view.iter_frames())[k]
            pose = world_from(found.params["lidar_pose"])
            assert np.allclose(pose, frame.world_from_sensor("LIDAR"), atol=1e-5)
            assert np.allclose(
                world_from(found.params["true_ego_pos"]), frame.world_from_ego, atol=1e-5
            )
            sweep = frame.read("LIDAR")
            assert np.array_equal(found.points[:, :3].astype(np.float32), sweep[:, :3])
            assert np.abs(found.points[:, 3] - sweep[:, 3]).max() <= 0.5 / 255 + 1e-6
            assert frame.ego is not None
            assert found.params["ego_speed"] == pytest.approx(3.6 * frame.ego["speed"])


def test_boxes_as_the_reader_places_them_are_the_labels(fleet: Path, moments: Moments) -> None:
    (episode,) = Dataset(fleet).episodes
    compared = 0
    for view, found in zip(episode.views, moments[-1].values(), strict=True):
        frame = list(view.iter_frames())[-1]
        lidar_from_world = np.linalg.inv(world_from(found.params["lidar_pose"]))
        for track, vehicle in found.params["vehicles"].items():
            row = frame.objects[track]
            assert dict(row["num_lidar_points"])["LIDAR"] >= 1
            box = pose_matrix(row["box_center"], row["box_rotation_deg"])
            corners = transform_points(
                lidar_from_world, box_corners(box, np.array(row["box_extent"]))
            )
            read = corners_from_lidar(vehicle, found.params["lidar_pose"])
            assert np.allclose(_sorted(read), _sorted(corners), atol=1e-4)
            compared += 1
    assert compared >= 2


def test_each_car_has_the_other_among_its_vehicles(fleet: Path, moments: Moments) -> None:
    (episode,) = Dataset(fleet).episodes
    ego, other = episode.document["ego_id"], episode.agent("car2").document["ego_id"]
    first, second, _ = moments[0].values()
    assert other in first.params["vehicles"]
    assert ego in second.params["vehicles"]
    assert ego not in first.params["vehicles"]


def test_cameras_project_the_points_that_they_see(fleet: Path, moments: Moments) -> None:
    (episode,) = Dataset(fleet).episodes
    view = episode.agent("car2")
    found = list(moments[0].values())[1]
    assert [path.exists() for path in found.cameras] == [True, True, False, False]
    back, front = (np.asarray(Image.open(path)) for path in found.cameras[:2])
    frame = next(view.iter_frames())
    assert np.array_equal(back, frame.read("CAM_BACK"))
    assert np.array_equal(front, frame.read("CAM_FRONT"))
    camera = found.params["camera1"]
    by_poses = np.linalg.inv(world_from(camera["cords"])) @ world_from(found.params["lidar_pose"])
    assert np.allclose(camera["extrinsic"], by_poses, atol=1e-6)
    calibration = view.sensor("CAM_FRONT").calibration
    assert np.allclose(camera["intrinsic"], calibration.k)


def test_fused_clouds_hit_the_other_car_where_its_box_is(fleet: Path, moments: Moments) -> None:
    """Early fusion: points of the second car in the ego's axes lie on what the ego labels."""
    ego, other, _ = moments[-1].values()
    lidar_from_other = np.linalg.inv(world_from(ego.params["lidar_pose"])) @ world_from(
        other.params["lidar_pose"]
    )
    points = transform_points(lidar_from_other, other.points[:, :3])
    (episode,) = Dataset(fleet).episodes
    row = list(episode.agent("car2").iter_frames())[-1].objects[episode.document["ego_id"]]
    box = pose_matrix(row["box_center"], row["box_rotation_deg"])
    local = transform_points(np.linalg.inv(box) @ world_from(ego.params["lidar_pose"]), points)
    inside = (np.abs(local) <= np.array(row["box_extent"]) + 0.1).all(axis=1)
    assert inside.sum() >= dict(row["num_lidar_points"])["LIDAR"] > 0


def test_points_far_and_bright_keep_their_values(tmp_path: Path) -> None:
    points = np.array([[1.5, -2.0, 0.25, 0.0], [99.0, 7.0, -1.0, 1.0]], np.float32)
    path = tmp_path / "cloud.pcd"
    path.write_bytes(pcd(points))
    assert np.array_equal(read_pcd(path), points.astype(np.float64))


def test_all_agents_are_exported_so_none_can_be_chosen(fleet: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="does not use --agent"):
        export_dataset("opv2v", fleet, tmp_path / "out", ExportOptions(agent="car2"))


def _sorted(corners: np.ndarray) -> np.ndarray:
    rounded = np.round(corners, 3)
    return np.asarray(corners[np.lexsort(rounded.T)])
