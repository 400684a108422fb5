"""Calibrations of others become rigs: what we export comes back, and what cannot be is said."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import analytic_dataset
from carstage.cli.app import app
from carstage.config.loading import check_config
from carstage.config.presets import RIG_PRESETS
from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from carstage.geometry import pose_matrix
from carstage.web.configure.calibrations import read_calibration
from sites import Site

KITTI = """\
P0: 7.215377e+02 0 6.095593e+02 0 0 7.215377e+02 1.728540e+02 0 0 0 1 0
P2: 7.215377e+02 0 6.095593e+02 4.485728e+01 0 7.215377e+02 1.728540e+02 2.163791e-01 0 0 1 2.7e-03
P3: 7.215377e+02 0 6.095593e+02 -3.395242e+02 0 7.215377e+02 1.728540e+02 2.199936 0 0 1 2.7e-03
R0_rect: 9.999239e-01 9.83776e-03 -7.445048e-03 -9.869795e-03 9.999421e-01 -4.278459e-03 \
7.402527e-03 4.351614e-03 9.999631e-01
Tr_velo_to_cam: 7.533745e-03 -9.999714e-01 -6.16602e-04 -4.069766e-03 1.480249e-02 7.280733e-04 \
-9.998902e-01 -7.631618e-02 9.998621e-01 7.52379e-03 1.480755e-02 -2.717806e-01
"""
CAMERA_INFO = {
    "image_width": 800,
    "image_height": 600,
    "camera_name": "front left!",
    "camera_matrix": {"rows": 3, "cols": 3, "data": [400.0, 0, 400, 0, 400.0, 300, 0, 0, 1]},
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [-0.2, 0.1, 0, 0, 0]},
}


def by_id(sensors: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {sensor["id"]: sensor for sensor in sensors}


def matrix(pose: dict[str, float]) -> np.ndarray[Any, Any]:
    place = [pose.get(key, 0.0) for key in "xyz"]
    angles = [pose.get(key, 0.0) for key in ("pitch_deg", "yaw_deg", "roll_deg")]
    return np.asarray(pose_matrix(place, angles))


def test_kittis_own_calibration_gives_its_rig() -> None:
    read = read_calibration(KITTI)
    found = by_id(read.sensors)
    preset = by_id(RIG_PRESETS["kitti"].make())
    assert read.is_rig
    for name in ("CAM_2", "CAM_3"):
        there, here = preset[name], found[name]
        np.testing.assert_allclose(
            matrix(here["pose"])[:3, 3], matrix(there["pose"])[:3, 3], atol=0.06
        )
        assert here["attributes"]["fov_deg"] == pytest.approx(there["attributes"]["fov_deg"], 1e-3)
    base = matrix(found["CAM_3"]["pose"])[:3, 3] - matrix(found["CAM_2"]["pose"])[:3, 3]
    assert np.linalg.norm(base) == pytest.approx(0.533, abs=0.002)
    assert any("gives no size" in warning for warning in read.warnings)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calibrations")
    return analytic_dataset.make_dataset(folder / "out", folder)


def between(a: Any, b: Any) -> Any:
    return np.linalg.inv(a) @ b


def test_what_is_exported_to_nuscenes_comes_back(dataset: Path, tmp_path: Path) -> None:
    export_dataset("nuscenes", dataset, tmp_path / "out", ExportOptions(), workers=0)
    (folder,) = {path.parent for path in (tmp_path / "out").rglob("calibrated_sensor.json")}
    texts = {
        n: json.loads((folder / n).read_text()) for n in ("calibrated_sensor.json", "sensor.json")
    }
    found = by_id(read_calibration(json.dumps(texts)).sensors)
    own = Dataset(dataset).episodes[0].calibration.sensors
    shared = [name for name in found if name in own]
    assert len(shared) >= 2
    first = shared[0]
    for name in shared[1:]:
        np.testing.assert_allclose(
            between(matrix(found[first]["pose"]), matrix(found[name]["pose"])),
            between(own[first].ego_from_sensor, own[name].ego_from_sensor),
            atol=1e-3,
        )


def test_what_is_exported_to_kitti_comes_back(dataset: Path, tmp_path: Path) -> None:
    export_dataset("kitti-object", dataset, tmp_path / "out", ExportOptions(), workers=0)
    text = next((tmp_path / "out").rglob("calib/000000.txt")).read_text()
    found = by_id(read_calibration(text).sensors)
    own = Dataset(dataset).episodes[0].calibration.sensors
    lidar = next(sensor for sensor in own.values() if sensor.kind == "lidar")
    there = between(lidar.ego_from_sensor, own["CAM_FRONT"].ego_from_sensor)
    here = between(matrix(found["VELODYNE"]["pose"]), matrix(found["CAM_2"]["pose"]))
    np.testing.assert_allclose(here, there, atol=1e-3)


def test_a_camera_info_joins_the_rig_and_says_what_it_lacks() -> None:
    read = read_calibration(yaml.safe_dump(CAMERA_INFO))
    (camera,) = read.sensors
    assert not read.is_rig
    assert camera["id"] == "front_left_"
    assert camera["attributes"] == {"image_size": [800, 600]}
    lens = {"fx": 400.0, "fy": 400.0, "cx": 400.5, "cy": 300.5, "k1": -0.2, "k2": 0.1}
    assert camera["lens"] == {"model": "brown_conrady", **lens, "p1": 0.0, "p2": 0.0, "k3": 0.0}
    assert "no pose" in " ".join(read.warnings)
    check_config({"rig": {"sensors": [camera]}})


def test_a_camera_info_without_distortion_is_a_plain_pinhole() -> None:
    (camera,) = read_calibration(
        yaml.safe_dump({**CAMERA_INFO, "distortion_coefficients": [0.0] * 5})
    ).sensors
    assert camera["attributes"] == {"image_size": [800, 600], "fov_deg": 90.0}
    assert "lens" not in camera


def test_a_fisheyes_camera_info_becomes_a_fisheye() -> None:
    fisheye = {"distortion_model": "equidistant", "distortion_coefficients": [0.1, 0.02, 0, 0]}
    (camera,) = read_calibration(yaml.safe_dump({**CAMERA_INFO, **fisheye})).sensors
    assert camera["lens"]["model"] == "kannala_brandt"
    assert (camera["lens"]["k1"], camera["lens"]["k2"]) == (0.1, 0.02)


def test_a_distortion_with_more_terms_is_left_out_and_said() -> None:
    rational = {"distortion_model": "rational_polynomial", "distortion_coefficients": [0.1] * 8}
    read = read_calibration(yaml.safe_dump({**CAMERA_INFO, **rational}))
    assert "lens" not in read.sensors[0]
    assert "lens distortion is left out" in " ".join(read.warnings)


def test_kalibrs_camchain_gives_a_stereo_pair() -> None:
    """The second camera stands 0.11 m to the right of the first: its points move to the left."""
    camera = {
        "camera_model": "pinhole", "distortion_model": "radtan",
        "distortion_coeffs": [-0.28, 0.07, 0.0002, 0.00002],
        "intrinsics": [458.6, 457.3, 367.2, 248.4], "resolution": [752, 480],
    }  # fmt: skip
    step = [[1, 0, 0, -0.11], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    read = read_calibration(yaml.safe_dump({"cam0": camera, "cam1": {**camera, "T_cn_cnm1": step}}))
    first, second = read.sensors
    assert second["pose"]["y"] - first["pose"]["y"] == pytest.approx(0.11)
    assert (second["pose"]["x"], second["pose"]["yaw_deg"]) == (first["pose"]["x"], 0.0)
    assert (first["lens"]["p1"], first["lens"]["cx"]) == (0.0002, 367.7)
    check_config({"rig": {"sensors": read.sensors}})
    with pytest.raises(BadInputError, match="omni"):
        read_calibration(yaml.safe_dump({"cam0": {**camera, "camera_model": "omni"}}))


@pytest.mark.parametrize(
    "text",
    [
        "", "hello", "[1, 2]", "{}", '{"calibrated_sensor.json": [{"token": 1}]}', "P2: 1 2 3",
        yaml.safe_dump({**CAMERA_INFO, "image_width": -1}),
        yaml.safe_dump({**CAMERA_INFO, "camera_matrix": {"data": [0] * 9}}),
        "P2: " + "nan " * 12, "!!python/object/apply:os.system ['true']",
    ],
)  # fmt: skip
def test_what_is_no_calibration_is_refused_with_a_way_out(text: str) -> None:
    with pytest.raises(BadInputError) as refused:
        read_calibration(text)
    assert refused.value.hint


def test_the_command_prints_a_rig_that_the_configuration_takes(tmp_path: Path) -> None:
    files = [tmp_path / "left.yaml", tmp_path / "right.yaml"]
    for path in files:
        path.write_text(yaml.safe_dump({**CAMERA_INFO, "camera_name": path.stem}))
    ended = CliRunner().invoke(app, ["rig", "import", *map(str, files)])
    assert ended.exit_code == 0
    config = check_config(yaml.safe_load(ended.stdout))
    assert [sensor.id for sensor in config.sensors] == ["left", "right"]


def test_a_camera_that_joins_the_rig_leaves_what_names_the_others(site: Site) -> None:
    base = site.client.get("/api/schema").json()["demo"]
    ids = [sensor["id"] for sensor in base["rig"]["sensors"] if sensor["kind"] == "rgb"]
    named = {
        **base,
        "labels": {
            **base.get("labels", {}),
            "cameras": ids[:1],
            "lidars": ["LIDAR_TOP"],
            "occupancy": {"frame": "LIDAR_TOP"},
        },
        "ego": {**base.get("ego", {}), "driver": {"kind": "keyboard", "camera": ids[0]}},
        "conversion": {**base.get("conversion", {}), "codecs": {ids[0]: "jpeg"}},
    }

    def imported(text: str) -> Any:
        request = {"text": text, "format": "calibration", "base": named}
        answer = site.client.post("/api/config/import", json=request).json()
        assert not answer["errors"]
        return answer["config"]

    joined = imported(yaml.safe_dump(CAMERA_INFO))
    assert joined["rig"]["sensors"][-1]["id"] == "front_left_"
    assert joined["labels"]["cameras"] == ids[:1]
    assert joined["ego"]["driver"]["camera"] == ids[0]
    assert joined["labels"]["lidars"] == ["LIDAR_TOP"]
    assert joined["labels"]["occupancy"]["frame"] == "LIDAR_TOP"
    assert joined["conversion"]["codecs"] == {ids[0]: "jpeg"}
    other = imported(KITTI)
    assert other["labels"]["cameras"] == "all"
    assert other["labels"]["lidars"] == []
    assert other["labels"]["occupancy"]["frame"] == "ego"
    assert other["ego"]["driver"].get("camera") is None
    assert other["conversion"]["codecs"] == {}


def test_a_file_that_is_not_there_is_bad_input(tmp_path: Path) -> None:
    ended = CliRunner().invoke(app, ["rig", "import", str(tmp_path / "nothere.yaml")])
    assert ended.exit_code == 2
    assert "nothere.yaml cannot be read: No such file" in ended.stderr
