"""Where a run converts: in a thread of its own process as long as the data are light."""

from __future__ import annotations

import pytest

from carstage.config import parse_config
from carstage.conversion import ThreadFirst
from carstage.processes import ProcessPool
from carstage.runs.converters import Converters, is_light

RIG = "rig: {sensors: [{id: A, kind: %s, pose: {z: 2.0}}, {id: B, kind: %s, pose: {z: 3.0}}]}\n"


@pytest.mark.parametrize(
    ("kinds", "labels", "light"),
    [
        (("lidar", "imu"), "", True),
        (("semantic_lidar", "radar"), "", True),
        (("lidar", "rgb"), "", False),
        (("lidar", "depth"), "", False),
        (("lidar", "flash_lidar"), "", False),
        (("lidar", "imu"), "birds_eye: {}", False),
        (("lidar", "imu"), "lidars: [A], occupancy: {}", False),
    ],
)
def test_data_are_light_that_are_written_as_they_were_recorded(
    kinds: tuple[str, str], labels: str, light: bool
) -> None:
    config = parse_config(RIG % kinds + f"labels: {{cameras: [], {labels}}}")
    assert is_light(config) is light


def test_pictures_of_a_variant_are_not_light() -> None:
    variants = "variants: {seen: {rig: {sensors: [{id: C, kind: rgb}]}}}"
    assert not is_light(parse_config(RIG % ("lidar", "imu") + "labels: {cameras: []}\n" + variants))


@pytest.mark.parametrize(("light", "kind"), [(True, ThreadFirst), (False, ProcessPool)])
def test_light_data_are_converted_in_a_thread(light: bool, kind: type) -> None:
    converters = Converters(1, pictures=False, light=light)
    try:
        pool = converters.pool()
        assert type(pool) is kind
        assert converters.pool() is pool
        assert pool.submit(len, "abc").result(30.0) == 3
        converters.retire()
        assert converters.pool() is not pool
    finally:
        converters.end()
