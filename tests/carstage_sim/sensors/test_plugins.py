"""What a plug-in may register; that one works is the how-to's test."""

from __future__ import annotations

import pytest

from carstage_sim.sensors import register_sensor
from carstage_sim.sensors.radar import Radar


@pytest.mark.parametrize(
    ("type_id", "like", "said"),
    [
        ("sensor.other.radar", "sensor.other.radar", "is taken"),
        ("vehicle.sensor", "sensor.other.radar", "does not begin with 'sensor.'"),
        ("sensor.other.sonar", "sensor.other.echo", "no sensor of CARLA"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused(type_id: str, like: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        register_sensor(type_id, like=like)(Radar)
