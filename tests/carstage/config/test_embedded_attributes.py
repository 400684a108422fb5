"""Attributes that only the embedded simulator has are refused where CARLA would get them."""

from __future__ import annotations

import pytest
from pydantic_core import PydanticCustomError

from carstage.config.attributes import attributes_model, check_server_has
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
