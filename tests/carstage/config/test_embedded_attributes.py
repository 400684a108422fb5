"""Attributes that only the embedded simulator has are refused where CARLA would get them."""

from __future__ import annotations

import pytest
from pydantic_core import PydanticCustomError

from carstage.config.attributes import attributes_model, check_server_has
from carstage.config.loading import check_config
from carstage.errors import ConfigError
from carstage.plan.rig import plan_sensors
from carstage.sensor_kinds import Attribute, AttributeSet

ROWS = (
    Attribute("grain", "bool", None, "Grain", "Of the film.", "grain", embedded_only=True),
    Attribute("gain", "float", None, "Gain", "Of the film.", "gain"),
)
MODEL = attributes_model(AttributeSet("GrainAttributes", "Of a test.", ROWS))


@pytest.mark.parametrize("server", ["carla", "remote"])
@pytest.mark.parametrize("value", [True, False])
def test_an_attribute_that_carla_has_not_is_refused_by_name(server: str, value: bool) -> None:
    given = MODEL.model_validate({"grain": value, "gain": 1.0})
    with pytest.raises(PydanticCustomError) as refused:
        check_server_has(server, ROWS, given, "rig", "sensors", 2)
    told = refused.value.context
    assert told is not None
    assert told["sentence"] == f"a {server} server has no grain."
    assert told["path"] == ("rig", "sensors", 2, "attributes", "grain")
    assert "{kind: embedded}" in told["hint"]


def test_what_carla_has_or_is_not_given_goes_to_every_server() -> None:
    for server in ("carla", "remote", "embedded", "class"):
        check_server_has(server, ROWS, MODEL.model_validate({"gain": 1.0}))


def test_the_embedded_simulator_gets_all() -> None:
    check_server_has("embedded", ROWS, MODEL.model_validate({"grain": True}))


@pytest.mark.parametrize("name", ["sensor_noise", "shutter_blur"])
def test_effects_of_the_embedded_simulator_need_it(name: str) -> None:
    camera = {"id": "CAM", "kind": "rgb", "attributes": {name: True}}
    rig = {"preset": None, "sensors": [camera]}
    asked = check_config({"rig": rig})
    (spec,) = (one for one in plan_sensors(asked) if one.id == "CAM")
    assert spec.attributes[name] == "true"
    with pytest.raises(ConfigError, match=f"a carla server has no {name}"):
        check_config({"rig": rig, "server": {"kind": "carla", "path": "/carla"}})


@pytest.mark.parametrize("server", [{"kind": "carla", "path": "/carla"}, {"kind": "remote"}])
@pytest.mark.parametrize("kind", ["rgb", "depth", "semantic", "instance", "normals"])
def test_rolling_shutters_are_refused_elsewhere(server: dict[str, str], kind: str) -> None:
    sensor = {"id": "CAM", "kind": kind, "attributes": {"rolling_shutter_s": 0.02}}
    check_config({"rig": {"sensors": [sensor]}})
    with pytest.raises(ConfigError, match="server has no rolling_shutter_s") as refused:
        check_config({"server": server, "rig": {"sensors": [sensor]}})
    assert "attributes.rolling_shutter_s" in str(refused.value)


@pytest.mark.parametrize(("kind", "seconds"), [("flow", 0.02), ("rgb", 0.2), ("rgb", -0.01)])
def test_rolling_shutters_that_cannot_be_are_refused(kind: str, seconds: float) -> None:
    sensor = {"id": "CAM", "kind": kind, "attributes": {"rolling_shutter_s": seconds}}
    with pytest.raises(ConfigError, match="rolling_shutter_s"):
        check_config({"rig": {"sensors": [sensor]}})
