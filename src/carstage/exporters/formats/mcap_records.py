"""What an MCAP file holds of a frame, before it becomes messages of one schema or another.

Everything is in right-handed axes here: ``map`` is east-north-up, ``ego`` and sensors that give
points or readings are forward-left-up, cameras optical.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset import SensorCalibration
from carstage.dataset.saved_frames import Row
from carstage.exporters.axes import NuscenesBox
from carstage.exporters.labels import CameraLabel
from carstage.geometry import FloatArray

MAP: Final = "map"
EGO: Final = "ego"
RADAR_POINT: Final = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "velocity", "azimuth", "elevation", "range")]
)
"""A detection of a radar: place (m), range rate (m/s, positive: receding), direction (rad, to the
left and up), distance (m)."""


@dataclass(frozen=True, slots=True)
class Transforms:
    """Poses ``(4, 4)`` of child frames in their parents: (parent, child, pose)."""

    poses: tuple[tuple[str, str, FloatArray], ...]


@dataclass(frozen=True, slots=True)
class ObjectBox:
    """A 3D box on the map.

    Attributes:
        name: what its class is called in the export.
        row: its row of ``objects.parquet``.
        box: centre, size and rotation in east-north-up.
    """

    name: str
    row: Row
    box: NuscenesBox


@dataclass(frozen=True, slots=True)
class Objects:
    """All 3D boxes of a frame, by track id."""

    boxes: tuple[ObjectBox, ...]


@dataclass(frozen=True, slots=True)
class EgoState:
    """The row of ``ego.parquet`` with the vectors in right-handed axes.

    Attributes:
        row: the row.
        pose: ``(4, 4)`` pose of the pivot on the map.
        velocity, acceleration, angular_velocity: along the ego's forward-left-up axes (m/s, m/s²,
            rad/s); acceleration may be None.
    """

    row: Row
    pose: FloatArray
    velocity: FloatArray
    acceleration: FloatArray | None
    angular_velocity: FloatArray


@dataclass(frozen=True, slots=True)
class CodedPicture:
    """A picture as a file: ``format`` is png or jpeg."""

    sensor: str
    data: bytes
    format: str


@dataclass(frozen=True, slots=True)
class Pixels:
    """A picture as an array.

    Attributes:
        sensor: id of the camera.
        what: end of the topic.
        encoding: ``rgb8``, ``mono8``, ``mono16`` or ``32FC1``.
        pixels: ``(H, W)`` or ``(H, W, 3)``, little-endian.
    """

    sensor: str
    what: str
    encoding: str
    pixels: NDArray[Any]


@dataclass(frozen=True, slots=True)
class CameraModel:
    """The intrinsics of a camera."""

    camera: SensorCalibration


@dataclass(frozen=True, slots=True)
class Labels:
    """The objects in a picture that the options keep.

    Attributes:
        sensor: id of the camera.
        labels: the objects, each with what its class is called in the export.
    """

    sensor: str
    labels: tuple[tuple[str, CameraLabel], ...]


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points with named fields: a structured array of 4-byte numbers."""

    sensor: str
    points: NDArray[Any]


@dataclass(frozen=True, slots=True)
class Inertial:
    """What an IMU reads along its forward-left-up axes (m/s², rad/s), and its compass (rad)."""

    sensor: str
    acceleration: FloatArray
    angular_velocity: FloatArray
    compass_rad: float


@dataclass(frozen=True, slots=True)
class Position:
    """What a satellite receiver reads (degrees, degrees, m)."""

    sensor: str
    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class Values:
    """What a sensor of a plug-in reads: numbers with names, in its own axes."""

    sensor: str
    names: tuple[str, ...]
    values: tuple[float, ...]


Record = (
    Transforms | Objects | EgoState | CodedPicture | Pixels | CameraModel | Labels | Cloud
    | Inertial | Position | Values
)  # fmt: skip
