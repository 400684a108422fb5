"""What a configuration may ask of a flash LiDAR, and what is planned for it."""

from __future__ import annotations

from typing import Any

import pytest

from carstage.config import Config, parse_config
from carstage.config.loading import check_config
from carstage.errors import ConfigError
from carstage.plan import ServerFacts, plan_episodes
from carstage.plan.rig import plan_sensors
from carstage.sensor_kinds import sensor_kind
from carstage.spec import SensorSpec

FACTS = ServerFacts(maps={"Stage01": 100})


def flash(**changes: Any) -> dict[str, Any]:
    return {"id": "FLASH", "kind": "flash_lidar", **changes}


def planned(*sensors: dict[str, Any], **rest: Any) -> dict[str, SensorSpec]:
    config = Config.model_validate({"rig": {"sensors": list(sensors)}, **rest})
    return {sensor.id: sensor for sensor in plan_sensors(config)}


def test_it_is_recorded_as_one_depth_camera_that_holds_all_its_beams() -> None:
    sensors = planned(flash(attributes={"samples": 1, "oversampling": 1}))
    asked = sensors["FLASH"]
    assert list(sensors) == ["FLASH"]
    assert (asked.kind, asked.blueprint) == ("flash_lidar", "sensor.camera.depth")
    assert asked.faces is None
    assert set(asked.attributes) == {"image_size_x", "image_size_y", "fov"}
    # 128 columns over 60 degrees: the middle pixel is as wide as a column, 0.469 degrees.
    assert int(asked.attributes["image_size_x"]) == pytest.approx(141, abs=6)
    assert float(asked.attributes["fov"]) > 60.0


def test_wide_ones_are_recorded_as_faces_of_a_cube_which_are_depth_cameras() -> None:
    sensors = planned(flash(attributes={"horizontal_fov_deg": 180.0, "columns": 64}))
    assert sensors["FLASH"].faces == ("FLASH.r", "FLASH.l")
    for name in ("FLASH.r", "FLASH.l"):
        face = sensors[name]
        assert (face.kind, face.hidden, face.flash) == ("depth", True, None)
        assert face.content != sensors["FLASH"].content
    assert sensors["FLASH.r"].pose.yaw_deg == 90.0


def test_labels_all_leaves_it_out_and_its_name_is_refused() -> None:
    lidar = {"id": "L", "kind": "lidar"}
    assert "FLASH.semantic" not in planned(flash(), lidar, labels={"lidars": "all"})
    with pytest.raises(ConfigError, match=r"labels\.lidars\[0\]: no semantic LiDAR scans like"):
        parse_config(
            "{rig: {sensors: [{id: FLASH, kind: flash_lidar}]}, labels: {lidars: [FLASH]}}"
        )


@pytest.mark.parametrize(
    ("sensor", "field", "words"),
    [
        (flash(attributes={"columns": 0}), "attributes.columns", "Give at least 1"),
        (flash(attributes={"min_range_m": 100.0}), "attributes.min_range_m", "not below range_m"),
        (flash(attributes={"returns": "second"}), "attributes.returns", "first"),
        (
            flash(attributes={"false_return_rate": 0.1}),
            "attributes.false_return_rate",
            "without range_reflectivity",
        ),
        (
            flash(attributes={"columns": 1024, "samples": 9, "horizontal_fov_deg": 20.0}),
            "attributes",
            "Pictures of",
        ),
        (
            flash(attributes={"horizontal_fov_deg": 200.0}, attachment="follow"),
            "attachment",
            "keep their places",
        ),
        (flash(product="velodyne_vlp16"), "product", "continental_hfl110"),
        ({"id": "R", "kind": "radar", "product": "velodyne_vlp16"}, "product", "unknown key"),
    ],
)
def test_what_cannot_be_is_refused_with_its_field(
    sensor: dict[str, Any], field: str, words: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        check_config({"rig": {"sensors": [sensor]}})
    assert f"rig.sensors[0].{field}" in str(refused.value)
    assert words in f"{refused.value} {refused.value.hint}"


def test_the_dataset_of_one_needs_room_for_its_points_and_the_log_for_its_pictures() -> None:
    def costs(attributes: str) -> Any:
        text = f"rig: {{sensors: [{{id: FLASH, kind: flash_lidar, attributes: {{{attributes}}}}}]}}"
        return plan_episodes(parse_config(text), FACTS).costs[0]

    one, dual = costs("returns: first"), costs("returns: dual")
    frames = int(one["frames"])
    assert dual["dataset_bytes"] - one["dataset_bytes"] == frames * 128 * 32 * 16
    assert dual["raw_bytes"] == one["raw_bytes"]
    sensor = planned(flash())["FLASH"]
    picture = 4 * int(sensor.attributes["image_size_x"]) * int(sensor.attributes["image_size_y"])
    assert one["raw_bytes"] > frames * picture


def test_a_raw_pixel_is_a_depth_cameras_and_a_datum_is_a_point() -> None:
    row = sensor_kind("flash_lidar")
    assert (row.raw_bytes, row.datum_bytes) == (4, 16)
    assert not row.is_camera
    assert [column.name for column in row.columns] == ["x", "y", "z", "intensity"]
