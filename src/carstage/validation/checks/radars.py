"""Radars count what boxes hold, and cross sections are those that their model may give."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.calibration import SensorCalibration
from carstage.dataset.reading import Episode, Sensor
from carstage.dataset.tables import row_sensor
from carstage.sensor_kinds.columns import Detection, RcsDetection
from carstage.sensor_kinds.model import DETECTIONS
from carstage.tags import TAGS_0_9_14
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelledBox
from carstage.validation.checks.ranging import check_point_counts

RCS_RADAR: Final = "rcs_radar"
_PERSON_DBSM: Final = -1.37
_PERSON_DEVIATION_DB: Final = 3.94
_SIGMAS: Final = 8.0
_ROUNDED_DB: Final = 0.01
_MOST_GAMMA_DB: Final = 5.0 * math.log10(77.0 / 10.0)
"""Of what is built, see ``docs/formats/radar.md``."""
_PERSON: Final = "Pedestrian"
_ROAD_USERS: Final = frozenset(
    (_PERSON, "Rider", "Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle")
)


def check_cross_sections(episode: Episode, findings: Findings) -> None:
    """Report detections whose cross section fits nothing of their tag (check ``radar_rcs``)."""
    for sensor in episode.sensors:
        if sensor.kind != RCS_RADAR:
            continue
        for k, found in _detections(sensor):
            for what, wrong in _faults(found, sensor.calibration).items():
                if wrong.any():
                    text = f"{int(wrong.sum())} of {len(found)} detections {what}"
                    findings.add("radar_rcs", text, frame=k, sensor=sensor.id)


def check_radar_counts(
    episode: Episode, boxes: Mapping[int, Sequence[LabelledBox]], findings: Findings
) -> None:
    """Recount the detections inside each box (check ``radar_counts``).

    Args:
        episode: the episode.
        boxes: its objects with a box, by frame.
        findings: where problems go.
    """
    for sensor in episode.sensors:
        if sensor.content != DETECTIONS:
            continue
        for k, found in _detections(sensor):
            radar = sensor.calibration_at(k)
            check_point_counts(_points(found), radar, k, boxes.get(k, ()), findings, by="radar")


def _detections(sensor: Sensor) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Frames and their detections; what ``check_row_sensors`` reports is left out."""
    kind = row_sensor(sensor.kind)
    if kind is None or not sensor.table.schema.equals(kind.schema):
        return
    for row in sensor.table.to_pylist():
        if len({len(row[name]) for name, _ in kind.columns}) == 1:
            yield row["k"], kind.array(row)


def _points(found: NDArray[np.float32]) -> NDArray[np.float64]:
    """``(N, 3)`` detections in the sensor's axes (m): x ahead, y to the right, z up."""
    depth, azimuth, altitude = (
        found[:, column].astype(np.float64)
        for column in (Detection.DEPTH, Detection.AZIMUTH, Detection.ALTITUDE)
    )
    ahead = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(altitude)], axis=1)
    return np.asarray(ahead * (depth * np.cos(altitude))[:, None])


def _faults(found: NDArray[np.float32], radar: SensorCalibration) -> dict[str, NDArray[np.bool_]]:
    """``(N,)`` which detections are wrong, by what is wrong with them."""
    tag, rcs = found[:, RcsDetection.TAG], found[:, RcsDetection.RCS].astype(np.float64)
    numbers = {one.name: number for number, one in TAGS_0_9_14.items()}
    people = tag == numbers[_PERSON]
    users = np.isin(tag, [numbers[name] for name in _ROAD_USERS])
    fluctuates = str(radar.attributes.get("fluctuation", "true")).lower() == "true"
    slack_db = _SIGMAS * _PERSON_DEVIATION_DB if fluctuates else _ROUNDED_DB
    range_m = np.maximum(found[:, Detection.DEPTH].astype(np.float64), 1e-9)
    most_db = _MOST_GAMMA_DB + 10.0 * np.log10(_cone_sr(radar) * range_m**2)
    return {
        "have no semantic tag": ~np.isin(tag, list(TAGS_0_9_14)),
        "are of people and have no person's cross section": people
        & (np.abs(rcs - _PERSON_DBSM) > slack_db),
        "of surfaces have more than the whole cone would": ~users & (rcs > most_db + _ROUNDED_DB),
    }


def _cone_sr(radar: SensorCalibration) -> float:
    """No less than the cone's solid angle: its area at a distance of 1."""

    def slope(name: Any) -> float:
        return math.tan(math.radians(float(radar.attributes.get(name, 30.0))) / 2.0)

    return max(math.pi * slope("horizontal_fov") * slope("vertical_fov"), 1e-9)
