"""nuScenes's CAN-bus expansion: what the ego's own instruments would say, for ``NuScenesCanBus``.

Units and names are those of the devkit's ``can_bus/README.md``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.saved_frames import Row
from carstage.exporters.axes import flu_angular_velocity, flu_vector, quaternion_from_matrix
from carstage.exporters.json_rows import JsonRows
from carstage.geometry import FloatArray, specific_force

Messages = Mapping[str, Mapping[str, Any]]

MESSAGES: Final = ("ms_imu", "pose", "steeranglefeedback", "vehicle_monitor")
_FULL_LOCK_RAD = math.radians(70.0)  # CARLA's default of a vehicle's front wheels
_BRAKE_BAR, _THROTTLE = 126, 1000
_PEDAL_FREE, _PEDAL_PRESSED = 1, 3
_PARKED, _DRIVING = 0, 7
_RIGHT_BLINKER, _LEFT_BLINKER = 0x10, 0x20  # carla.VehicleLightState
_KMH_PER_MPS = 3.6


def can_messages(ego: Row, ego_object: Row | None, pose: FloatArray) -> Messages:
    """The messages of a frame by name, without their time.

    Args:
        ego: the row of ``ego.parquet``.
        ego_object: the ego's row of ``objects.parquet``, which knows its lights.
        pose: ``(4, 4)`` of the ego in nuScenes's map.
    """
    acceleration = ego["acceleration"] or (0.0, 0.0, 0.0)
    force = flu_vector(specific_force(ego["rotation_deg"], acceleration)).tolist()
    turning = flu_angular_velocity(ego["angular_velocity_ego"]).tolist()
    rotation = quaternion_from_matrix(pose[:3, :3]).tolist()
    messages: dict[str, Mapping[str, Any]] = {
        "ms_imu": {"linear_accel": force, "q": rotation, "rotation_rate": turning},
        "pose": {
            "accel": force,
            "orientation": rotation,
            "pos": pose[:3, 3].tolist(),
            "rotation_rate": turning,
            "vel": flu_vector(ego["velocity_ego"]).tolist(),
        },
    }
    if ego["steer"] is not None:
        messages["steeranglefeedback"] = {"value": ego["steer"] * _FULL_LOCK_RAD}
        messages["vehicle_monitor"] = _monitor(ego, ego_object)
    return messages


def _monitor(ego: Row, ego_object: Row | None) -> dict[str, Any]:
    lights = (ego_object["light_state"] or 0) if ego_object is not None else 0
    return {
        "brake": round(ego["brake"] * _BRAKE_BAR),
        "brake_switch": _PEDAL_PRESSED if ego["brake"] > 0.0 else _PEDAL_FREE,
        "gear_position": _DRIVING if ego["gear"] else _PARKED,
        "left_signal": int(bool(lights & _LEFT_BLINKER)),
        "right_signal": int(bool(lights & _RIGHT_BLINKER)),
        "steering": round(math.degrees(ego["steer"] * _FULL_LOCK_RAD), 1),
        "throttle": round(ego["throttle"] * _THROTTLE),
        "vehicle_speed": round(ego["speed"] * _KMH_PER_MPS, 2),
        "yaw_rate": round(math.degrees(ego["yaw_rate_flu"]), 1),
    }


class CanBus:
    """The files of one scene; a file appears with its first message.

    Args:
        folder: ``can_bus``.
        scene: the scene's name.
    """

    def __init__(self, folder: Path, scene: str) -> None:
        self._folder, self._scene = folder, scene
        self._rows: dict[str, JsonRows] = {}
        self._statistics: dict[str, _Statistics] = {}

    def add(self, time_us: int, messages: Messages) -> None:
        """Append the messages of a frame."""
        for name, message in messages.items():
            row = {**message, "utime": time_us}
            self._file(name).add(row)
            self._statistics.setdefault(name, _Statistics()).add(row)
            if name == "pose":
                self._file("route").add_value(message["pos"][:2])

    def end(self) -> None:
        """Close the files and write the summary."""
        self.close()
        if self._statistics:
            meta = {name: found.document() for name, found in self._statistics.items()}
            path = self._folder / f"{self._scene}_meta.json"
            path.write_text(json.dumps(meta, indent=1) + "\n", "utf-8")

    def close(self) -> None:
        """Close what is open; a second call does nothing."""
        for rows in self._rows.values():
            rows.close()

    def _file(self, name: str) -> JsonRows:
        if name not in self._rows:
            self._rows[name] = JsonRows(self._folder / f"{self._scene}_{name}.json")
        return self._rows[name]


class _Statistics:
    """What ``meta`` says of one kind of message, kept without its values."""

    def __init__(self) -> None:
        self._values: dict[str, _Moments] = {}
        self._differences: dict[str, _Moments] = {}
        self._before: dict[str, NDArray[np.float64]] = {}
        self._first_us = self._last_us = self._count = 0

    def add(self, row: Mapping[str, Any]) -> None:
        time_us = int(row["utime"])
        self._first_us = self._first_us if self._count else time_us
        self._last_us = time_us
        self._count += 1
        for name, value in row.items():
            values = np.atleast_1d(np.asarray(value, np.float64))
            self._values.setdefault(name, _Moments()).add(values)
            if name in self._before:
                change = values - self._before[name]
                self._differences.setdefault(f"diff_{name}", _Moments()).add(change)
            self._before[name] = values

    def document(self) -> dict[str, Any]:
        timespan_s = (self._last_us - self._first_us) / 1e6
        moments = {**self._values, **self._differences}
        return {
            "message_count": self._count,
            "message_freq": (self._count - 1) / timespan_s if timespan_s else 0.0,
            "timespan": timespan_s,
            "var_stats": {name: found.document() for name, found in sorted(moments.items())},
        }


class _Moments:
    """Maximum, mean, minimum and standard deviation of vectors, one after the other (Welford)."""

    def __init__(self) -> None:
        self._count = 0

    def add(self, values: NDArray[np.float64]) -> None:
        if not self._count:
            self._least = self._most = self._mean = values
            self._squares = np.zeros_like(values)
        self._count += 1
        self._least, self._most = np.minimum(self._least, values), np.maximum(self._most, values)
        change = values - self._mean
        self._mean = self._mean + change / self._count
        self._squares = self._squares + change * (values - self._mean)

    def document(self) -> dict[str, Any]:
        deviation = np.sqrt(self._squares / self._count)
        found = {"max": self._most, "mean": self._mean, "min": self._least, "std": deviation}
        return {
            name: values.tolist() if len(values) > 1 else float(values[0])
            for name, values in found.items()
        }
