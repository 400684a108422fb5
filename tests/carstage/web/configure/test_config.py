"""The shared configuration: revisions, errors at fields, texts."""

import copy
import json
from typing import Any

import pytest

from carstage.config import RIG_PRESETS, SENSOR_KINDS, check_config, parse_config
from carstage.web.configure.carla_sensors import read_sensors, write_sensors
from sites import Site

pytestmark = pytest.mark.xdist_group("web")  # one site for all


def check(site: Site, config: dict[str, Any]) -> dict[str, Any]:
    answer = site.client.post("/api/config/check", json={"config": config})
    assert answer.status_code == 200
    document: dict[str, Any] = answer.json()
    return document


def test_the_schema_has_a_title_and_a_group_for_each_field(site: Site) -> None:
    message = site.client.get("/api/schema").json()
    groups = {group["name"] for group in message["groups"]}
    schema = message["config_schema"]
    for name, field in schema["properties"].items():
        section = schema["$defs"].get(field.get("$ref", "").rsplit("/", 1)[-1], {})
        assert field.get("title") or section.get("title"), name
        assert field["group"] in groups, name
    assert set(message["sensor_defaults"]) == set(SENSOR_KINDS)
    for defaults in message["sensor_defaults"].values():
        check_config({"rig": {"sensors": [defaults]}, "timing": {"sensor_sync": True}})


def test_the_page_gets_every_kind_of_sensor_and_its_group(site: Site) -> None:
    message = site.client.get("/api/sensor-kinds").json()
    shown = {kind["name"]: kind for kind in message["kinds"]}
    assert set(shown) == set(SENSOR_KINDS)
    groups = {modality["name"] for modality in message["modalities"]}
    assert {kind["modality"] for kind in shown.values()} == groups
    assert shown["rgb"]["is_camera"]
    assert shown["rgb"]["codecs"][0] == "png"
    assert shown["radar"]["viewer"] == "radar"
    assert not shown["imu"]["codecs"]


def test_presets_come_with_sensors_that_are_valid(site: Site) -> None:
    for name in RIG_PRESETS:
        preset = site.client.get(f"/api/presets/rig/{name}").json()
        check_config({"rig": {"sensors": preset["sensors"]}})


def test_changes_of_an_old_revision_are_conflicts(site: Site) -> None:
    state = site.client.get("/api/config").json()
    first = {**state["config"], "name": "first"}
    change = {"rev": state["rev"], "config": first, "author": "me"}
    saved = site.client.put("/api/config", json=change)
    assert saved.status_code == 200
    assert saved.json()["rev"] == state["rev"] + 1
    assert saved.json()["estimate"]["frames"] == 50
    late = site.client.put("/api/config", json={**change, "author": "you"})
    assert late.status_code == 409
    assert late.json()["current"]["config"]["name"] == "first"
    assert late.json()["current"]["author"] == "me"


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["fps"], 0),
        (["rig", "sensors", 0, "attributes", "fov_deg"], 181),
        (["rig", "sensors", 1, "pose", "x"], "far"),
        (["scenario", "kind"], "fly"),
        (["server", "port"], 80),
        (["weather", "choice"], "Sunny"),
        (["map", "choice"], "Atlantis"),
        (["ego", "blueprint"], "vehicle.flying.carpet"),
        (["conversion", "codecs", "CAM_FRONT"], "gif"),
    ],
)
def test_errors_carry_the_path_that_the_form_has(
    site: Site, demo: dict[str, Any], path: list[Any], value: Any
) -> None:
    config = copy.deepcopy(demo)
    place: Any = config
    for part in path[:-1]:
        place = place[part]
    place[path[-1]] = value
    assert [error["path"] for error in check(site, config)["errors"]] == [path]
    state = site.client.get("/api/config").json()
    refused = site.client.put("/api/config", json={"rev": state["rev"], "config": config})
    assert refused.status_code == 422
    assert [error["path"] for error in refused.json()["errors"]] == [path]
    assert site.client.get("/api/config").json() == state


def test_what_does_not_fit_on_the_disk_is_told_before_it_starts(
    site: Site, demo: dict[str, Any]
) -> None:
    found = check(site, {**demo, "episodes": 100_000, "image_size": [4096, 4096]})
    assert found["ok"]
    assert not found["estimate"]["fits"]
    assert found["estimate"]["frames"] == 5_000_000


def test_a_configuration_comes_back_from_its_yaml(site: Site, demo: dict[str, Any]) -> None:
    text = site.client.post("/api/config/export", json={"config": demo}).json()
    assert text["file_name"] == "demo.yaml"
    assert parse_config(text["text"]) == check_config(demo)
    read = site.client.post("/api/config/import", json={"text": text["text"]}).json()
    assert (read["config"], read["errors"]) == (demo, [])


def test_a_campaign_comes_through_the_page_as_text(site: Site, demo: dict[str, Any]) -> None:
    text = "{vehicles: {count: {range: [3, 9]}}, map: {choice: [Stage01, Stage02]}, episodes: 4}"
    read = site.client.post("/api/config/import", json={"format": "yaml", "text": text}).json()
    assert read["errors"] == []
    sample = read["config"]["campaign"]["sample"]
    assert sample["vehicles.count"] == {"range": [3, 9]}
    checked = check(site, read["config"])
    assert checked["ok"]
    assert checked["estimate"]["episodes"] == 4
    assert checked["warnings"][-1] == (
        "campaign: it is edited as text; what the form shows of map.choice, vehicles.count is one "
        "value of many."
    )
    wrong = {**demo, "vehicles": {"count": {"range": [3, 9000]}}}
    (problem,) = check(site, wrong)["errors"]
    assert problem["path"] == ["vehicles", "count", "range", 1]
    schema = site.client.get("/api/schema").json()["config_schema"]
    assert "campaign" not in schema["properties"]


def test_wrong_texts_come_back_with_their_errors(site: Site) -> None:
    read = site.client.post("/api/config/import", json={"text": "fps: 0\nmap: Stage01"}).json()
    assert [error["path"] for error in read["errors"]] == [["fps"]]
    assert read["config"] == {"fps": 0, "map": "Stage01"}


def test_sensors_come_back_from_carlas_list(demo: dict[str, Any]) -> None:
    config = check_config(demo)
    sensors, warnings = read_sensors(write_sensors(config))
    assert warnings == []
    again = check_config({**demo, "rig": {"sensors": sensors}})
    for before, after in zip(config.sensors, again.sensors, strict=True):
        assert (before.id, before.kind, before.pose) == (after.id, after.kind, after.pose)
        size = {"fps": config.fps, "image_size": config.image_size}
        assert before.attributes.carla(**size) == after.attributes.carla(**size)


def test_lists_of_agents_are_read(site: Site) -> None:
    rows = [
        {"type": "sensor.camera.rgb", "id": "Left cam", "x": 0.7, "y": -0.4, "z": 1.6, "yaw": -45,
         "roll": 0, "pitch": 0, "width": 300, "height": 200, "fov": 100},
        {"type": "sensor.speedometer", "id": "speed", "reading_frequency": 20},
    ]  # fmt: skip
    request = {"text": json.dumps(rows), "format": "carla-json"}
    read = site.client.post("/api/config/import", json=request).json()
    (sensor,) = read["config"]["rig"]["sensors"]
    assert sensor["id"] == "Left_cam"
    assert sensor["pose"]["yaw_deg"] == -45
    assert sensor["attributes"]["image_size"] == [300, 200]
    assert any("speedometer" in warning for warning in read["warnings"])


def test_poses_of_the_ros_bridge_are_turned_to_carlas_axes() -> None:
    point = {"x": 1.0, "y": 0.5, "z": 2.0, "roll": 3.0, "pitch": 4.0, "yaw": 5.0}
    sensor = {"type": "sensor.camera.rgb", "id": "front", "spawn_point": point}
    vehicle = {"type": "vehicle.tesla.model3", "id": "ego", "sensors": [sensor]}
    (read,), _ = read_sensors(json.dumps({"objects": [vehicle]}))
    assert read["pose"] == {
        "x": 1.0, "y": -0.5, "z": 2.0, "roll_deg": 3.0, "pitch_deg": -4.0, "yaw_deg": -5.0,
    }  # fmt: skip


def test_the_connection_test_says_what_is_wrong(site: Site) -> None:
    def tried(server: dict[str, Any]) -> dict[str, Any]:
        answer: dict[str, Any] = site.client.post(
            "/api/server/check", json={"server": server}
        ).json()
        return answer

    assert tried({"kind": "embedded"})["version"] == "0.9.16"
    assert not tried({"kind": "remote", "host": "127.0.0.1", "port": 1024})["ok"]
    assert not tried({"kind": "carla", "path": "/nowhere"})["ok"]
    assert not tried({"kind": "carla"})["ok"]


def test_vehicles_have_a_shape(site: Site) -> None:
    described = site.client.get("/api/description").json()
    assert "vehicle.tesla.model3" in {vehicle["id"] for vehicle in described["vehicles"]}
    shape = site.client.get("/api/vehicles/vehicle.tesla.model3").json()
    assert shape["box"]["extent"][0] > 2.0
    assert site.client.get("/api/vehicles/vehicle.no.such").status_code == 404
