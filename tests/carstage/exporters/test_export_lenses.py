"""Cameras with a lens: where they have a place, and where they are left out or refused."""

from __future__ import annotations

import json
import shutil
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from analytic_dataset import attempt_of, edit_rows, recommit
from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from carstage.exporters.road_cells import (
    CELL_M,
    SurfaceSensors,
    surface_cells,
    surface_sensors,
)
from carstage.geometry import OPTICAL_FROM_SENSOR
from mcap_reading import foxglove_messages, ros2_messages

pytestmark = pytest.mark.xdist_group("export")

BROWN = {
    "model": "brown_conrady", "distortion": [-0.3, 0.1, 0.0, 0.0, 0.0], "max_angle_deg": 60.0,
    "depth": "z", "recorded_from": [],
}  # fmt: skip
FISHEYE = {
    "model": "kannala_brandt", "distortion": [0.03, -0.01, 0.0, 0.0], "max_angle_deg": 95.0,
    "depth": "range", "recorded_from": [],
}  # fmt: skip
PANORAMA = {
    "model": "equirectangular", "distortion": [], "max_angle_deg": 180.0, "depth": "range",
    "recorded_from": [],
}  # fmt: skip
LENSES: dict[str, Callable[[dict[str, Any]], None]] = {
    "CARLA's own": lambda sensor: sensor["attributes"].update(lens_k="-0.5"),
    "brown_conrady": lambda sensor: sensor.update(lens=BROWN),
    "kannala_brandt": lambda sensor: sensor.update(lens=FISHEYE),
    "equirectangular": lambda sensor: sensor.update(lens=PANORAMA),
}


def with_lenses(dataset: Path, folder: Path, lens: str, *cameras: str) -> Path:
    """A copy whose cameras have a lens; nothing is labelled where it is CARLA's own."""
    copy = Path(shutil.copytree(dataset, folder / "dataset"))
    path = attempt_of(copy) / "calibration.json"
    document = json.loads(path.read_text())
    for camera in cameras:
        LENSES[lens](document["sensors"][camera])
    path.write_text(json.dumps(document))
    recommit(copy)
    if lens == "CARLA's own":
        edit_rows(
            copy,
            "camera_objects.parquet",
            lambda rows: [row for row in rows if row["sensor_id"] not in cameras],
        )
    return copy


def cameras_of(name: str, out: Path) -> set[str]:
    """The cameras whose pictures an export has."""
    if name == "coco":
        document = json.loads((out / "annotations/instances_train.json").read_text())
        return {image["camera"] for image in document["images"]}
    if name == "yolo":
        return {path.stem.split("_", 1)[1][:-7] for path in (out / "images/train").glob("*.png")}
    if name == "nuscenes":
        rows = json.loads((out / "v1.0-carstage/sensor.json").read_text())
        return {row["channel"] for row in rows if row["modality"] == "camera"}
    rows = (out / "frames.csv").read_text().splitlines()[1:]
    return {row.rsplit(",", 1)[1] for row in rows}


@pytest.mark.parametrize(
    ("name", "lens", "choices"),
    [
        ("coco", "CARLA's own", {}),
        ("yolo", "CARLA's own", {}),
        ("nuscenes", "CARLA's own", {}),
        ("nuscenes", "brown_conrady", {}),
        ("kitti-object", "CARLA's own", {"cameras": ("all",)}),
    ],
)
def test_a_camera_without_a_place_is_left_out(
    dataset, tmp_path: Path, name: str, lens: str, choices: dict[str, Any]
) -> None:
    bent = with_lenses(dataset, tmp_path, lens, "CAM_LEFT")
    export_dataset(name, bent, tmp_path / "out", ExportOptions(**choices), workers=0)
    assert cameras_of(name, tmp_path / "out") == {"CAM_FRONT"}


@pytest.mark.parametrize(
    ("name", "lens", "told"),
    [
        *(
            (name, "CARLA's own", "^'CAM_LEFT' has a lens distortion of CARLA's own")
            for name in ("coco", "yolo", "nuscenes", "kitti-object", "kitti-tracking", "opv2v")
        ),
        *(
            (name, "brown_conrady", "the camera model brown_conrady of 'CAM_LEFT'")
            for name in ("nuscenes", "kitti-object", "opv2v")
        ),
    ],
)
def test_a_camera_without_a_place_is_refused_by_name(
    dataset, tmp_path: Path, name: str, lens: str, told: str
) -> None:
    bent = with_lenses(dataset, tmp_path, lens, "CAM_LEFT")
    options = ExportOptions(cameras=("CAM_LEFT",))
    with pytest.raises(BadInputError, match=told):
        export_dataset(name, bent, tmp_path / "out", options, workers=0)


@pytest.mark.parametrize("name", ["coco", "yolo", "kitti-object"])
def test_a_rig_without_any_other_camera_is_refused(dataset, tmp_path: Path, name: str) -> None:
    bent = with_lenses(dataset, tmp_path, "CARLA's own", "CAM_FRONT", "CAM_LEFT")
    with pytest.raises(BadInputError, match="lens distortion of CARLA's own"):
        export_dataset(name, bent, tmp_path / "out", workers=0)


@pytest.mark.parametrize(
    ("cameras", "left"), [(("CAM_LEFT",), ["CAM_FRONT"]), (("CAM_FRONT", "CAM_LEFT"), [])]
)
@pytest.mark.parametrize("lens", LENSES)
def test_opv2v_has_the_pinholes_of_an_agent(
    dataset, tmp_path: Path, lens: str, cameras: tuple[str, ...], left: list[str]
) -> None:
    bent = with_lenses(dataset, tmp_path, lens, *cameras)
    export_dataset("opv2v", bent, tmp_path / "out", workers=0)
    (path,) = (tmp_path / "out").rglob("data_protocol.yaml")
    (agent,) = yaml.safe_load(path.read_text())["agents"].values()
    assert agent["cameras"] == left
    pictures = {picture.stem.split("_")[1] for picture in path.parent.rglob("*.png")}
    assert pictures == {f"camera{number}" for number in range(len(left))}


@pytest.mark.parametrize(
    ("messages", "lens", "model", "coefficients"),
    [
        ("foxglove", "brown_conrady", "plumb_bob", BROWN["distortion"]),
        ("foxglove", "kannala_brandt", "kannala_brandt", FISHEYE["distortion"]),
        ("ros2", "brown_conrady", "plumb_bob", BROWN["distortion"]),
        ("ros2", "kannala_brandt", "equidistant", FISHEYE["distortion"]),
    ],
)
def test_mcap_names_camera_models_as_its_messages_do(
    dataset, tmp_path: Path, messages: str, lens: str, model: str, coefficients: list[float]
) -> None:
    """By the comments of ``foxglove.CameraCalibration`` and of ``sensor_msgs/CameraInfo``."""
    pytest.importorskip("mcap", reason="the extra mcap is not installed")
    bent = with_lenses(dataset, tmp_path, lens, "CAM_LEFT")
    options = ExportOptions(messages=messages)
    export_dataset("mcap", bent, tmp_path / "out", options, workers=0)
    (path,) = (tmp_path / "out").glob("*.mcap")
    if messages == "foxglove":
        _, found = foxglove_messages(path)["/CAM_LEFT/calibration"][0]
        assert (found.distortion_model, list(found.D)) == (model, coefficients)
    else:
        _, found = ros2_messages(path)["/CAM_LEFT/camera_info"][0]
        assert (found.distortion_model, list(found.d)) == (model, coefficients)


@pytest.mark.parametrize(
    ("messages", "calibration"), [("foxglove", "calibration"), ("ros2", "camera_info")]
)
@pytest.mark.parametrize("lens", ["CARLA's own", "equirectangular"])
def test_mcap_calls_no_camera_a_pinhole_that_is_none(
    dataset, tmp_path: Path, messages: str, calibration: str, lens: str
) -> None:
    pytest.importorskip("mcap", reason="the extra mcap is not installed")
    bent = with_lenses(dataset, tmp_path, lens, "CAM_LEFT")
    options = ExportOptions(messages=messages)
    export_dataset("mcap", bent, tmp_path / "out", options, workers=0)
    (path,) = (tmp_path / "out").glob("*.mcap")
    found = foxglove_messages(path) if messages == "foxglove" else ros2_messages(path)
    assert len(found[f"/CAM_FRONT/{calibration}"]) == 6
    assert f"/CAM_LEFT/{calibration}" not in found
    assert any(topic.startswith("/CAM_LEFT/image") for topic in found)
    # A message without boxes would say that the picture shows no object.
    assert ("/CAM_LEFT/annotations" in found) is (lens == "equirectangular")
    assert f"/CAM_LEFT/{calibration}" not in (tmp_path / "out/layout.json").read_text()


def test_roads_are_where_a_lens_shows_them(every_kind, tmp_path: Path) -> None:
    names = ("SEM_FRONT", "DEPTH_FRONT")
    bent = with_lenses(every_kind, tmp_path, "kannala_brandt", *names)
    (episode,) = Dataset(bent).episodes
    sensors = surface_sensors(episode)
    assert names in sensors.cameras
    frame = next(iter(episode.iter_frames()))
    found = surface_cells(frame, SurfaceSensors((), (names,)), (0.0, 0.0))
    camera = episode.sensor("DEPTH_FRONT").calibration
    depth_m, tags = frame.read("DEPTH_FRONT"), frame.read("SEM_FRONT")
    optical = (camera.pixel_rays() * depth_m[..., None])[::4, ::4]
    on_road = (np.isin(tags, (1, 2, 24)) & (depth_m < 40.0))[::4, ::4]
    pose = frame.world_from_sensor("DEPTH_FRONT")
    world = optical[on_road] @ OPTICAL_FROM_SENSOR @ pose[:3, :3].T + pose[:3, 3]
    expected = np.unique(np.floor(world[:, :2] * (1.0, -1.0) / CELL_M).astype(int), axis=0)
    assert len(expected) > 20
    np.testing.assert_array_equal(found, expected)


def test_webdataset_tells_no_pinhole_of_a_lens_that_nobody_knows(dataset, tmp_path: Path) -> None:
    bent = with_lenses(dataset, tmp_path, "CARLA's own", "CAM_LEFT")
    export_dataset("webdataset", bent, tmp_path / "out", workers=0)
    with tarfile.open(tmp_path / "out/train-000000.tar") as tar:
        (first, *_) = (name for name in tar.getnames() if name.endswith(".labels.json"))
        labels = json.load(tar.extractfile(first))  # type: ignore[arg-type]
    assert labels["sensors"]["CAM_LEFT"]["K"] is None
    assert labels["sensors"]["CAM_FRONT"]["K"] is not None
    assert labels["unlabelled_cameras"] == ["CAM_LEFT"]
