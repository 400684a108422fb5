"""Reading a dataset gives what was recorded, and says what is missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import analytic_dataset
import analytic_scene
from annotation_scenes import actor
from benchmarks.framework.bare_specs import bare_sensor, bare_spec
from carstage.annotation.tracks import level_tracks
from carstage.conversion.documents import calibration_document
from carstage.conversion.sensors import plan_sensors
from carstage.dataset import Dataset, decode_mask
from carstage.dataset.calibration import calibration_of
from carstage.dataset.disparity import read_disparity_steps
from carstage.dataset.surroundings import read_occupancy
from carstage.errors import BadInputError, DatasetError, StoreAccessError
from carstage.spec import EpisodeSpec


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reading")
    return analytic_dataset.make_dataset(folder / "out", folder)


def test_cameras_on_two_vehicles_do_not_share_a_view() -> None:
    on_cars = [
        bare_sensor(name, kind, attach_to="vehicle.*", attach_index=index)
        for name, kind, index in (("SEEN", "rgb", 0), ("DEPTH", "depth", 0), ("OTHER", "depth", 1))
    ]
    for sensor in on_cars:
        sensor["blueprint"] = f"sensor.camera.{sensor['kind']}"
        sensor["attributes"] = {"image_size_x": "64", "image_size_y": "48", "fov": "90"}
    spec = EpisodeSpec.from_json(bare_spec(on_cars))
    document = calibration_document(spec, plan_sensors(spec, {}), actor(1))
    seen, depth, other = (
        calibration_of(name, entry) for name, entry in document["sensors"].items()
    )
    assert seen.shares_view(depth)
    assert not seen.shares_view(other)


def sensor_spec(name: str) -> dict[str, object]:
    sensors = analytic_scene.spec(size=analytic_dataset.SIZE)["sensors"]
    return next(sensor for sensor in sensors if sensor["id"] == name)


def test_an_episode_knows_its_spec_frames_and_rig(folder: Path) -> None:
    dataset = Dataset(folder)
    (episode,) = dataset.episodes
    assert dataset.name == "analytic <scene>"
    assert (episode.id, episode.frames, episode.spec.fps) == ("0123456789abcdef", 6, 10.0)
    front, left = (episode.calibration.sensors[name] for name in ("CAM_FRONT", "CAM_LEFT"))
    assert (front.width, front.height, front.fov_deg) == (192, 128, 90.0)
    np.testing.assert_allclose(front.k, [[96, 0, 96], [0, 96, 64], [0, 0, 1]])
    np.testing.assert_allclose(front.ego_from_sensor[:3, 3], [1.5, 0.0, 1.6])
    assert (front.depth, front.instance, front.labelled) == ("DEPTH_FRONT", "INST_FRONT", True)
    assert (left.depth, left.instance, left.labelled) == (None, None, True)
    assert episode.calibration.ego_box["extent"] == (2.3, 0.95, 0.75)


def test_images_and_points_come_back_exactly(folder: Path) -> None:
    (episode,) = Dataset(folder).episodes
    for k in (0, 5):
        rgb = analytic_scene.image("rgb", sensor_spec("CAM_LEFT"), k / 10)
        np.testing.assert_array_equal(episode.sensor("CAM_LEFT").read(k), rgb[..., 2::-1])
        tags = analytic_scene.image("semantic", sensor_spec("SEM_FRONT"), k / 10)[..., 2]
        np.testing.assert_array_equal(episode.sensor("SEM_FRONT").read(k), tags)
        points, _ = analytic_scene.sweep(sensor_spec("LIDAR_TOP")["pose"], k / 10)
        np.testing.assert_array_equal(episode.sensor("LIDAR_TOP").read(k), points)
    compass = np.radians((analytic_scene.EGO.yaw_deg + 90.0) % 360.0)
    np.testing.assert_allclose(episode.sensor("IMU").read(3), [0, 0, 9.81, 0, 0, 0, compass])
    place = analytic_scene.gnss_reading(sensor_spec("GNSS")["pose"], 0.3)
    np.testing.assert_allclose(episode.sensor("GNSS").read(3), place)


def test_tables_have_a_row_per_frame_and_object(folder: Path) -> None:
    (episode,) = Dataset(folder).episodes
    assert episode.ledger().num_rows == episode.ego().num_rows == 6
    actors, level = {41, 50, 51, 60}, set(level_tracks(analytic_scene.LEVEL_IDS.values()))
    assert set(episode.objects()["track_id"].to_pylist()) == actors | level
    assert set(episode.camera_objects()["sensor_id"].to_pylist()) == {"CAM_FRONT", "CAM_LEFT"}


def test_a_mask_marks_the_pixels_of_the_instance(folder: Path) -> None:
    (episode,) = Dataset(folder).episodes
    rows = [r for r in episode.camera_objects().to_pylist() if r["sensor_id"] == "CAM_FRONT"]
    assert rows
    parked, light = level_tracks(analytic_scene.LEVEL_IDS.values())
    of_level = {parked: analytic_scene.CAR, light: analytic_scene.LIGHT}  # no pixel has their id
    assert {parked, light} <= {row["track_id"] for row in rows}
    for row in rows:
        ids, tags = np.moveaxis(episode.sensor("INST_FRONT").read(row["k"]), -1, 0)
        track = row["track_id"]
        own = (ids == 0) & (tags == of_level[track]) if track in of_level else ids == track
        mask = decode_mask(row["mask_modal"], 128, 192)
        np.testing.assert_array_equal(mask, own)


def test_an_unknown_sensor_is_bad_input_that_names_the_rig(folder: Path) -> None:
    (episode,) = Dataset(folder).episodes
    with pytest.raises(BadInputError, match="CAM_FRONT"):
        episode.sensor("CAM_BACK")


def test_a_missing_frame_is_a_dataset_error(folder: Path) -> None:
    (episode,) = Dataset(folder).episodes
    for name in ("CAM_FRONT", "LIDAR_TOP", "IMU"):
        with pytest.raises(DatasetError, match=name):
            episode.sensor(name).read(6)


@pytest.mark.parametrize("counts", ["", "0", "zzzz", "P", "\x00", "é"])
def test_a_damaged_mask_is_a_dataset_error(counts: str) -> None:
    with pytest.raises(DatasetError, match="mask"):
        decode_mask(counts, 4, 4)


def test_only_labelled_cameras_have_labelled_pictures(folder: Path) -> None:
    (episode,) = Dataset(folder).episodes
    frame = next(episode.iter_frames())
    labelled = {sensor.id for sensor in episode.sensors if frame.has_labelled(sensor.id)}
    assert labelled == {"CAM_FRONT", "CAM_LEFT"}
    assert not frame.has_labelled("CAM_OF_NOBODY")


def test_a_store_that_lets_nobody_look_is_no_damage(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: Path, *_: int) -> bytes:
        raise StoreAccessError(f"{path}: the store refuses the credentials.")

    (episode,) = Dataset(folder).episodes
    sensor = episode.sensor("CAM_LEFT")
    for module in ("reading", "documents", "surroundings", "disparity", "splits"):
        monkeypatch.setattr(f"carstage.dataset.{module}.read_bounded", refused)
    for read in (
        lambda: sensor.read(0),
        lambda: Dataset(folder).episodes[0].spec,
        lambda: Dataset(folder).episodes[0].geo_frame,
        lambda: Dataset(folder).stored_splits,
        lambda: read_occupancy(episode.folder, 0),
        lambda: read_disparity_steps(episode.folder, sensor.id, 0),
    ):
        with pytest.raises(StoreAccessError, match="credentials"):
            read()
