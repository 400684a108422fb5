"""nuScenes's sensor files: LiDAR points with rings, radar detections as PCD, the map's mask."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.exporters.axes import nuscenes_lidar_points, radar_points
from carstage.exporters.road_cells import CELL_M
from carstage.sensor_kinds.columns import RcsDetection

METRES_PER_PX: Final = 0.1
FOREGROUND: Final = 255

_RADAR = np.dtype(
    [
        ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("dyn_prop", "i1"), ("id", "<i2"),
        ("rcs", "<f4"), ("vx", "<f4"), ("vy", "<f4"), ("vx_comp", "<f4"), ("vy_comp", "<f4"),
        ("is_quality_valid", "i1"), ("ambig_state", "i1"), ("x_rms", "i1"), ("y_rms", "i1"),
        ("invalid_state", "i1"), ("pdh0", "i1"), ("vx_rms", "i1"), ("vy_rms", "i1"),
    ]
)  # fmt: skip
_LIDAR_DEFAULTS = {"upper_fov": 10.0, "lower_fov": -30.0, "channels": 32}  # CARLA's
_UNAMBIGUOUS = 3
_SURE = 1  # pdh0: false with a probability below a quarter
_UNKNOWN_MOTION = 4


def lidar_file(
    points: NDArray[np.float32],
    attributes: Mapping[str, str],
    rings: NDArray[np.float32] | None = None,
) -> bytes:
    """A ``.pcd.bin``: float32 right, forward, up, intensity, ring per point.

    Args:
        points: ``(N, 4)`` x, y, z, intensity.
        attributes: of the LiDAR.
        rings: ``(N,)`` which laser each point is of, where the dataset has it. Else its elevation
            tells, as CARLA's lasers are spaced evenly from ``upper_fov`` (ring 0) to ``lower_fov``.
    """
    if rings is not None:
        return nuscenes_lidar_points(points, rings).tobytes()
    top, bottom, channels = (
        float(attributes.get(name, default)) for name, default in _LIDAR_DEFAULTS.items()
    )
    last = max(channels - 1, 1)
    x, y, z = points[:, :3].astype(np.float64).T
    elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
    rings = np.clip(np.rint((top - elevation) / (top - bottom) * last), 0, last)
    return nuscenes_lidar_points(points, rings.astype(np.float32)).tobytes()


def radar_file(detections: NDArray[np.float32], velocity_mps: NDArray[np.float64]) -> bytes:
    """A ``.pcd`` with the 18 fields of nuScenes; deviations are not simulated: 0.

    Args:
        detections: ``(N, 4)`` range rate, azimuth, altitude, depth; a fifth column is the RCS
            (dBsm), else it is 0.
        velocity_mps: ``(3,)`` the radar's own velocity in its forward-left-up axes.
    """
    places, velocities = radar_points(detections)
    rays = places / np.maximum(np.linalg.norm(places, axis=1, keepdims=True), 1e-9)
    compensated = velocities + (rays @ velocity_mps)[:, None] * rays
    rows = np.zeros(max(len(places), 1), _RADAR)
    if not len(places):
        rows["x"] = np.nan  # how nuScenes marks a cloud without points
    else:
        rows["x"], rows["y"], rows["z"] = places.T
        rows["vx"], rows["vy"] = velocities[:, :2].T
        rows["vx_comp"], rows["vy_comp"] = compensated[:, :2].T
        if detections.shape[1] > RcsDetection.RCS:
            rows["rcs"] = detections[:, RcsDetection.RCS]
        rows["id"] = np.arange(len(places)) & 0x7FFF
        rows["is_quality_valid"], rows["ambig_state"] = 1, _UNAMBIGUOUS
        rows["dyn_prop"], rows["pdh0"] = _UNKNOWN_MOTION, _SURE
    names = _RADAR.names or ()
    kinds = [_RADAR[name] for name in names]
    header = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        "FIELDS " + " ".join(names),
        "SIZE " + " ".join(str(kind.itemsize) for kind in kinds),
        "TYPE " + " ".join("F" if kind.kind == "f" else "I" for kind in kinds),
        "COUNT " + " ".join("1" for _ in names),
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(rows)}",
        "DATA binary",
    ]
    # The devkit reads only while a byte is left after the last value, as its own files have it.
    return ("\n".join(header) + "\n").encode() + rows.tobytes() + b"\0"


def write_mask(path: Path, width: int, height: int, surfaces: NDArray[np.bool_]) -> None:
    """A grey PNG, 0.1 m per pixel: 255 where roads and sidewalks are known, else 0.

    Args:
        path: the file.
        width: of the picture (px).
        height: likewise.
        surfaces: ``(north, east)`` cells of ``CELL_M``, from the lower left corner on.
    """
    packer = zlib.compressobj(1)
    per_cell = round(CELL_M / METRES_PER_PX)
    last_north, last_east = (length - 1 for length in surfaces.shape)
    columns = np.minimum(np.arange(width) // per_cell, last_east)
    packed = [
        packer.compress(
            b"\0" + (surfaces[min((height - row) // per_cell, last_north), columns] * FOREGROUND)
            .astype(np.uint8).tobytes()
        )
        for row in range(height)
    ]  # fmt: skip
    packed.append(packer.flush())
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = (_chunk(b"IHDR", header), _chunk(b"IDAT", b"".join(packed)), _chunk(b"IEND", b""))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


def _chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)
