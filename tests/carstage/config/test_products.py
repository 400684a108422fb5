"""Sensors with the figures of data sheets."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from carstage.config import Config, parse_config
from carstage.config.products import PRODUCTS
from carstage.config.sensors import SENSOR_KINDS

HOW_TO = Path(__file__).parents[3] / "docs/how-to/flash-lidar.md"


def sensor_of(text: str) -> dict[str, object]:
    config = parse_config(f"{{fps: 10, rig: {{sensors: [{{id: L, {text}}}]}}}}")
    assert config.warnings() == []
    return dict(config.sensors[0].attributes)


@pytest.mark.parametrize("name", PRODUCTS)
def test_a_product_is_a_valid_sensor_of_each_of_its_kinds_with_its_figures(name: str) -> None:
    product = PRODUCTS[name]
    assert product.source
    for kind in product.kinds:
        found = sensor_of(f"kind: {kind}, product: {name}")
        known = SENSOR_KINDS[kind].model_fields["attributes"].annotation.model_fields  # type: ignore[union-attr]
        expected = {key: value for key, value in product.attributes.items() if key in known}
        assert {key: found[key] for key in expected} == expected
        assert len(expected) >= 5


def test_what_is_set_goes_before_the_data_sheet_by_either_name() -> None:
    text = "kind: lidar, product: velodyne_vlp16, attributes: {range: 30, channels: 8}"
    found = sensor_of(text)
    assert (found["range_m"], found["channels"], found["upper_fov_deg"]) == (30.0, 8, 15.0)


def test_a_sensor_without_a_product_is_as_ever_and_one_with_it_comes_back() -> None:
    assert sensor_of("kind: lidar")["channels"] == 64
    config = parse_config("rig: {sensors: [{id: L, kind: lidar, product: ouster_os1_64}]}")
    again = Config.model_validate(config.model_dump(mode="json"), strict=False)
    assert again == config
    assert (
        "product"
        not in parse_config("rig: {sensors: [{id: L, kind: lidar}]}").model_dump()["rig"][
            "sensors"
        ][0]
    )


def test_a_turn_of_a_rotating_one_has_the_rays_of_its_data_sheet() -> None:
    config = parse_config(
        "{fps: 10, rig: {sensors: [{id: L, kind: lidar, product: ouster_os1_128}]}}"
    )
    strings = config.sensors[0].carla(fps=10.0, image_size=(64, 64))
    assert int(strings["points_per_second"]) / 10 / int(strings["channels"]) == 2048


def test_the_how_to_has_every_product_with_its_figures() -> None:
    rows = {
        match[1]: match[0]
        for match in re.finditer(r"^\| `(\w+_\w+)` \|.*$", HOW_TO.read_text("utf-8"), re.M)
    }
    assert set(rows) == set(PRODUCTS)
    for name, product in PRODUCTS.items():
        given = product.attributes
        assert f"{given['range_m']:g} m" in rows[name]
        if "points_per_second" in given:
            assert f"| {given['channels']} |" in rows[name]
            assert f"{given['points_per_second']:,}" in rows[name]
            assert f"{given['lower_fov_deg']:g}° to {given['upper_fov_deg']:g}°" in rows[name]
            assert f"{100 * given['noise_stddev_m']:g} cm" in rows[name]
        else:
            assert f"{given['columns']} x {given['rows']}" in rows[name]
