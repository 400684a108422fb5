"""What a configuration may ask of a camera model, and what is planned for it."""

from __future__ import annotations

from typing import Any

import pytest

from carstage.config import Config
from carstage.config.loading import check_config, dump_config
from carstage.errors import ConfigError
from carstage.plan.rig import plan_sensors
from carstage.spec import Fields, SensorSpec
from carstage.spec.plain import plain

FISHEYE = {"model": "kannala_brandt", "fx": 145.0, "fy": 146.0, "max_angle_deg": 95.0}
PINHOLE = {"model": "pinhole", "fx": 350.0, "fy": 360.0, "cx": 300.0}


def camera(**changes: Any) -> dict[str, Any]:
    attributes = {"image_size": [500, 400]}
    return {"id": "CAM", "kind": "rgb", "lens": FISHEYE, "attributes": attributes, **changes}


def config(*sensors: dict[str, Any]) -> Config:
    return Config.model_validate({"rig": {"sensors": list(sensors)}})


def test_a_fisheye_is_recorded_as_faces_of_a_cube_with_hidden_twins() -> None:
    planned = {sensor.id: sensor for sensor in plan_sensors(config(camera()))}
    asked = planned["CAM"]
    assert asked.faces == ("CAM.r", "CAM.l", "CAM.u", "CAM.d")
    assert (asked.depth, asked.instance) == ("CAM.depth", "CAM.instance")
    assert planned["CAM.depth"].lens == asked.lens
    assert planned["CAM.depth"].faces == (
        "CAM.depth.r",
        "CAM.depth.l",
        "CAM.depth.u",
        "CAM.depth.d",
    )
    assert planned["CAM.r"].pose.yaw_deg == 90.0
    assert planned["CAM.u"].pose.pitch_deg == 90.0
    assert planned["CAM.r"].hidden
    assert float(asked.attributes["fov"]) > 90.0
    assert asked.attributes["exposure_mode"] == "manual"
    for sensor in planned.values():
        assert SensorSpec.read(Fields(plain(sensor), "sensor"), None) == sensor


def test_cameras_of_one_place_and_model_serve_each_other() -> None:
    planned = plan_sensors(config(camera(), camera(id="DEPTH", kind="depth")))
    assert next(sensor for sensor in planned if sensor.id == "CAM").depth == "DEPTH"
    other = camera(id="DEPTH", kind="depth", lens={**FISHEYE, "fx": 150.0})
    planned = plan_sensors(config(camera(), other))
    assert next(sensor for sensor in planned if sensor.id == "CAM").depth == "CAM.depth"


def test_a_pinhole_beside_the_middle_is_one_wider_picture() -> None:
    planned = plan_sensors(config(camera(lens=PINHOLE)))
    asked = next(sensor for sensor in planned if sensor.id == "CAM")
    assert asked.faces is None
    assert asked.lens is not None
    assert (asked.lens.cx, asked.lens.cy) == (300.0, 200.0)
    assert int(asked.attributes["image_size_x"]) >= 2 * 300


def test_a_sensor_without_a_lens_is_planned_as_ever() -> None:
    planned = plan_sensors(config({"id": "CAM", "kind": "rgb"}))
    assert not {"lens", "faces"} & plain(planned[0]).keys()


@pytest.mark.parametrize(
    ("sensor", "path", "message"),
    [
        (camera(attributes={"fov_deg": 91.0}), "attributes.fov_deg", "says what its picture shows"),
        (camera(attributes={"lens_k": 0.1}), "attributes.lens_k", "says what its picture shows"),
        (
            camera(attributes={"rolling_shutter_s": 0.02}),
            "attributes.rolling_shutter_s",
            "not the rows of what",
        ),
        (camera(attributes={"bloom_intensity": 0.7}), "attributes.bloom_intensity", "seams"),
        (camera(attributes={"exposure_mode": "histogram"}), "attributes.exposure_mode", "seams"),
        (camera(attachment="follow"), "attachment", "keep their places"),
        (camera(id="A_CAMERA_OF_21_LETTRS"), "id", "faces"),
        (camera(kind="normals"), "lens", "not re-projected"),
        (camera(lens={**PINHOLE, "fx": 40.0}), "lens", "than one pinhole picture can hold"),
        (
            camera(lens={"model": "fisheye"}),
            "sensors[0].lens.model",
            "unknown model 'fisheye'. Known: brown_conrady, ",
        ),
        (camera(lens={"fx": 300.0}), "sensors[0].lens.model", "missing. Give one of pinhole, "),
        (camera(lens={"model": "pinhole"}), "sensors[0].lens.fx", "missing"),
    ],
)
def test_what_cannot_be_is_refused_with_its_path(
    sensor: dict[str, Any], path: str, message: str
) -> None:
    with pytest.raises(ConfigError, match=message) as refused:
        check_config({"rig": {"sensors": [sensor]}})
    assert path in str(refused.value)


def test_a_face_of_a_cube_keeps_its_name() -> None:
    with pytest.raises(ValueError, match="face of the cube"):
        config(camera(), {"id": "CAM.l", "kind": "rgb"})


@pytest.mark.parametrize(
    "lens",
    [
        FISHEYE,
        PINHOLE,
        {"model": "brown_conrady", "fx": 350.0, "fy": 360.0, "k1": -0.1},
        {"model": "equirectangular"},
    ],
    ids=lambda lens: str(lens["model"]),
)
def test_a_written_configuration_is_read_again(lens: dict[str, Any]) -> None:
    asked = check_config({"rig": {"sensors": [camera(lens=lens)]}})
    written = dump_config(asked)
    assert "fov_deg" not in written["rig"]["sensors"][0]["attributes"]
    assert check_config(written) == asked
    # As versions before wrote it.
    written["rig"]["sensors"][0]["attributes"]["fov_deg"] = 90.0
    assert check_config(written) == asked


def test_a_camera_with_a_lens_alone_is_written_without_its_defaults() -> None:
    lens = {"model": "equirectangular"}
    asked = config({"id": "CAM", "kind": "rgb", "lens": lens})
    written = asked.model_dump(mode="json", exclude_unset=True)
    assert written == {"rig": {"sensors": [{"id": "CAM", "kind": "rgb", "lens": lens}]}}
