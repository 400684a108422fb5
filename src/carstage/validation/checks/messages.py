"""Received V2X messages against who sent them: places, headings, speeds, powers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from carstage.annotation.schema import OBJECT_COLUMNS
from carstage.dataset.messages import V2X
from carstage.dataset.reading import Episode, Sensor
from carstage.dataset.tables import row_sensor
from carstage.errors import CarStageError
from carstage.geometry import compass_rad
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.table_schema import require_rows

_PLACE_M, _HEADING_DEG, _SPEED_M_S = 0.2, 0.2, 0.02
_TURN_DEG_S, _ACCELERATION_M_S2 = 60.0, 15.0
"""What a vehicle may do while a message gets old, see :func:`_oldest_s`."""
_LATE_S = 1.0
"""How long messages may wait for a sensor's report where reports may be left out."""
_SIGMAS = 6.0
_METRE_DEG = 180.0 / math.pi / 6.378e6
_SENSITIVITY_DBM = -99.0


def check_messages(episode: Episode, findings: Findings) -> None:
    """Compare tables of V2X sensors with the objects that sent (check ``messages``).

    Senders that the labels do not know, such as roadside units, are left out.

    Args:
        episode: as the ego's; its agents are checked, too.
        findings: where problems go.
    """
    try:
        views = episode.views
        noise = _noise(views)
    except CarStageError:
        return  # the checks of the files say so
    for view in views:
        try:
            _check_view(view, noise, findings)
        except CarStageError:
            continue  # as above


def _check_view(view: Episode, noise: Mapping[str, float], findings: Findings) -> None:
    radios = [sensor for sensor in view.sensors if sensor.kind == V2X]
    if not radios:
        return
    carriers = view.carriers()
    senders = _senders(view.objects())
    for sensor in radios:
        row_kind = row_sensor(sensor.kind)
        if row_kind is None or not sensor.table.schema.equals(row_kind.schema):
            continue  # check_row_sensors says so
        for row in sensor.table.to_pylist():
            for message in _messages(row):
                for text in _faults(view, sensor, row["k"], message, carriers, senders, noise):
                    findings.add("messages", text, frame=row["k"], sensor=sensor.id)


def _messages(row: Mapping[str, Any]) -> list[dict[str, float]]:
    lists = {name: value for name, value in row.items() if isinstance(value, list)}
    count = min((len(value) for value in lists.values()), default=0)
    return [{name: value[i] for name, value in lists.items()} for i in range(count)]


def _senders(objects: pa.Table) -> dict[tuple[int, int], Mapping[str, Any]]:
    names = ["k", "track_id", "actor_location", "actor_rotation_deg", "velocity"]
    require_rows(objects, [c for c in OBJECT_COLUMNS if c.name in names], "objects.parquet")
    rows = objects.select(names).to_pylist()
    return {(row["k"], row["track_id"]): row for row in rows}


def _noise(views: Sequence[Episode]) -> dict[str, float]:
    """What noise may add to a message: the largest of all V2X sensors of the recording."""
    of_all = [
        sensor.calibration.attributes
        for view in views
        for sensor in view.sensors
        if sensor.kind == V2X
    ]
    return {
        name: _SIGMAS * max((float(one.get(f"noise_{name}", 0.0)) for one in of_all), default=0.0)
        for name in ("lat_stddev", "lon_stddev", "head_stddev", "vel_stddev_x")
    }


def _faults(
    view: Episode,
    sensor: Sensor,
    k: int,
    message: Mapping[str, float],
    carriers: Mapping[str, int | None],
    senders: Mapping[tuple[int, int], Mapping[str, Any]],
    noise: Mapping[str, float],
) -> Iterator[str]:
    """What is wrong with a message, in sentences."""
    whose = "" if view.agent_name is None else f"agent {view.agent_name}: "
    if not np.isfinite(message["station_id"]):
        yield f"{whose}a message does not say who sent it"
        return
    if not np.isfinite([message["latitude_deg"], message["longitude_deg"]]).all():
        yield f"{whose}a message does not say where its sender is"
        return
    station = round(message["station_id"])
    head = f"{whose}a message of station {station}"
    least = float(sensor.calibration.attributes.get("receiver_sensitivity", _SENSITIVITY_DBM))
    if not message["power_dbm"] >= least:
        power = f"{message['power_dbm']:.1f} dBm"
        yield f"{head} has {power}, below the sensitivity of {least:g} dBm"
    if station == carriers.get(sensor.id):
        yield f"{head} comes from what carries the sensor"
    sender = senders.get((k, station))
    if sender is None:
        return
    speed = math.hypot(*sender["velocity"])
    age_s = _oldest_s(view, sensor)
    place = view.geo_frame.gnss_place(sender["actor_location"])
    metres = _PLACE_M + speed * age_s + _ACCELERATION_M_S2 * age_s**2
    off_lat = abs(message["latitude_deg"] - place.latitude_deg) - noise["lat_stddev"]
    off_lon = abs(message["longitude_deg"] - place.longitude_deg) - noise["lon_stddev"]
    shrunk = math.cos(math.radians(place.latitude_deg))
    off_m = max(off_lat, off_lon * shrunk) / _METRE_DEG
    if off_m > metres:
        yield f"{head} tells a place {off_m:.2f} m off the sender's"
    heading = math.degrees(compass_rad(sender["actor_rotation_deg"][1]))
    turned = abs((message["heading_deg"] - heading + 180.0) % 360.0 - 180.0)
    if turned > _HEADING_DEG + _TURN_DEG_S * age_s + noise["head_stddev"]:
        yield f"{head} tells a heading {turned:.1f} deg off the sender's"
    if message["drive_direction"] == 0 and np.isfinite(message["speed_m_s"]):
        off = abs(message["speed_m_s"] - speed)
        if off > _SPEED_M_S + 0.02 * speed + _ACCELERATION_M_S2 * age_s + noise["vel_stddev_x"]:
            yield f"{head} tells a speed {off:.2f} m/s off the sender's"


def _oldest_s(view: Episode, sensor: Sensor) -> float:
    """How old a message may be in the frame that has it.

    One step: a server may send what it knew at the step's beginning. Where sensors need not deliver
    in every step, messages also wait for the sensor's next report.
    """
    step_s = 1.0 / view.spec.fps
    if view.spec.timing.demands_all:
        return step_s
    return step_s + max(float(sensor.calibration.attributes.get("sensor_tick", 0.0)), _LATE_S)
