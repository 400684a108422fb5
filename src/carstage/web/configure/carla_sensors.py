"""CARLA-style JSON lists of sensors, in and out.

Three spellings are read: a list of sensors as scenario_runner's agents give them (``type, id, x, y,
z, roll, pitch, yaw`` in CARLA's axes and degrees, ``width`` and ``height`` or CARLA's attribute
names), the same below the key ``sensors``, and the ROS bridge's ``objects``, whose ``spawn_point``
is a ROS pose: y to the left, so that y, pitch and yaw change their signs. The first is written.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from carstage.errors import BadInputError
from carstage.web.messages.base import Document

_POSE = ("x", "y", "z")
_ANGLES = ("roll", "pitch", "yaw")
_SIZE = {"width": "image_size_x", "height": "image_size_y"}
_SET_BY_THE_RUN = frozenset({"sensor_tick", "role_name", "noise_seed"})
_MOST_SENSORS = 200


def read_sensors(text: str) -> tuple[list[Document], list[str]]:
    """Entries of ``rig.sensors`` for a list of CARLA's, and what was left out.

    Raises:
        BadInputError: it is no JSON, or no list of sensors.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadInputError(f"This is not JSON: {error}.", "Choose the sensors' file.") from error
    sensors, warnings = [], []
    names: set[str] = set()
    for number, entry in enumerate(_entries(document)):
        if number >= _MOST_SENSORS:
            raise BadInputError(f"These are more than {_MOST_SENSORS} sensors.", "Give fewer.")
        blueprint = str(entry.get("type", ""))
        kind = _kinds().get(blueprint)
        if kind is None:
            warnings.append(f"{entry.get('id', number)}: {blueprint or 'no type'} is left out.")
            continue
        sensors.append(_sensor(entry, kind, _unique(str(entry.get("id", kind)), names), warnings))
    if not sensors:
        raise BadInputError(
            "No sensor was found in it.", "A list of {type, id, x, y, z, …} is expected."
        )
    return sensors, warnings


def write_sensors(config: Any) -> str:
    """A configuration's sensors as a list that CARLA's tools read, presets included.

    Args:
        config: a ``carstage.config.Config``.
    """
    rows = []
    for sensor in config.sensors:
        pose = sensor.pose
        rows.append(
            {
                "type": sensor.row.blueprint,
                "id": sensor.id,
                "x": pose.x,
                "y": pose.y,
                "z": pose.z,
                "roll": pose.roll_deg,
                "pitch": pose.pitch_deg,
                "yaw": pose.yaw_deg,
                **{
                    name: _number(value)
                    for name, value in sensor.attributes.carla(
                        fps=sensor.measures_hz(config.fps), image_size=config.image_size
                    ).items()
                },
            }
        )
    return json.dumps(rows, indent=1) + "\n"


def _entries(document: Any) -> Iterator[Mapping[str, Any]]:
    """All sensors of a document, those below its vehicles too."""
    if isinstance(document, dict):
        document = document.get("sensors", document.get("objects"))
    if not isinstance(document, list):
        raise BadInputError("This is no list of sensors.", "A list of {type, id, …} is expected.")
    for entry in document:
        if not isinstance(entry, dict):
            continue
        if isinstance(entry.get("sensors"), list):
            yield from (below for below in entry["sensors"] if isinstance(below, dict))
        else:
            yield entry


def _sensor(entry: Mapping[str, Any], kind: str, name: str, warnings: list[str]) -> Document:
    given = entry.get("spawn_point")
    ros = isinstance(given, dict)
    place: Mapping[str, Any] = given if isinstance(given, dict) else entry
    pose: Document = {axis: _float(place.get(axis, 0.0)) for axis in _POSE}
    pose |= {f"{angle}_deg": _float(place.get(angle, 0.0)) for angle in _ANGLES}
    if ros:
        for key in ("y", "pitch_deg", "yaw_deg"):
            pose[key] = -pose[key] + 0.0
    known = _attributes(kind)
    attributes: Document = {}
    for key, value in entry.items():
        carla = _SIZE.get(key, key)
        if key in ("type", "id", "spawn_point", *_POSE, *_ANGLES):
            continue
        if carla in known:
            attributes[carla] = _typed(value)
        elif key not in _SET_BY_THE_RUN:
            warnings.append(f"{name}: attribute {key} is left out.")
    return {"id": name, "kind": kind, "pose": pose, "attributes": attributes}


def _kinds() -> dict[str, str]:
    from carstage.sensor_kinds import kinds

    return {kind.blueprint: kind.name for kind in kinds() if not kind.recorded}


def _attributes(kind: str) -> set[str]:
    from carstage.sensor_kinds import sensor_kind

    row = sensor_kind(kind)
    size = {"image_size_x", "image_size_y"} if row.is_camera else set()
    return {attribute.carla for attribute in row.attributes.rows if attribute.carla} | size


def _unique(name: str, names: set[str]) -> str:
    """A usable id that is not taken yet."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "_.-") else "_" for c in name)
    plain = plain.lstrip("_.-")[:18] or "sensor"
    candidate, number = plain, 2
    while candidate.lower() in names:
        candidate, number = f"{plain}_{number}", number + 1
    names.add(candidate.lower())
    return candidate


def _float(value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise BadInputError(f"{value!r:.40} is no number.", "Correct the file.") from error
    if not abs(number) < 1e6:
        raise BadInputError(f"{number} cannot be.", "Correct the file.")
    return number


def _typed(value: Any) -> Any:
    """CARLA's attributes may stand as texts; ours are numbers and booleans."""
    return _number(value) if isinstance(value, str) else value


def _number(text: str) -> Any:
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
