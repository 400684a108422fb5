"""When a received V2X message is wrong: what it says, and how old it may be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from carstage.errors import DatasetError
from carstage.geometry import GeoFrame, GeoPoint
from carstage.validation.checks.messages import _faults, _senders

STATION = 7
SPEED_M_S = 10.0
NOISE = dict.fromkeys(("lat_stddev", "lon_stddev", "head_stddev", "vel_stddev_x"), 0.0)


def faults(*, off_m: float = 0.0, demands_all: bool = True, tick_s: float = 0.0, **told: float):
    """What is wrong with a message of a car that drives north at 10 m/s, recorded at 10 Hz."""
    frame = GeoFrame(GeoPoint(49.0, 8.0))
    sender = {
        "actor_location": [0.0, 0.0, 0.0],
        "actor_rotation_deg": [0.0, -90.0, 0.0],
        "velocity": [0.0, -SPEED_M_S, 0.0],
    }
    place = frame.gnss_place([off_m, 0.0, 0.0])
    view: Any = SimpleNamespace(
        agent_name=None,
        geo_frame=frame,
        spec=SimpleNamespace(fps=10.0, timing=SimpleNamespace(demands_all=demands_all)),
    )
    sensor: Any = SimpleNamespace(
        id="V2X", calibration=SimpleNamespace(attributes={"sensor_tick": str(tick_s)})
    )
    message = {
        "station_id": STATION, "power_dbm": -50.0, "latitude_deg": place.latitude_deg,
        "longitude_deg": place.longitude_deg, "heading_deg": 0.0, "speed_m_s": SPEED_M_S,
        "drive_direction": 0.0,
    }  # fmt: skip
    senders = {(3, STATION): sender}
    return list(_faults(view, sensor, 3, message | told, {"V2X": 1}, senders, NOISE))


def test_what_is_true_has_no_fault() -> None:
    assert faults() == []


@pytest.mark.parametrize("name", ["latitude_deg", "longitude_deg", "station_id"])
def test_a_message_without_place_or_sender_is_found(name: str) -> None:
    (text,) = faults(**{name: np.nan})
    assert "does not say" in text


def test_a_place_that_no_step_explains_is_found() -> None:
    (text,) = faults(off_m=3.0)
    assert "a place 3.00 m off" in text


def test_messages_may_wait_for_the_next_report_of_a_sensor_of_its_own_rate() -> None:
    assert faults(off_m=3.0, demands_all=False) == []
    assert len(faults(off_m=30.0, demands_all=False)) == 1
    assert faults(off_m=30.0, demands_all=False, tick_s=2.0) == []


def test_objects_without_what_is_compared_are_refused() -> None:
    with pytest.raises(DatasetError, match="no column actor_location"):
        _senders(pa.table({"k": [0], "track_id": [1]}))
