"""Point clouds with a semantic tag and an object per point, for formats of segmentation.

A semantic LiDAR is such a cloud. CARLA's ordinary LiDAR has intensities and no tags: its points
take them from a *twin*, a semantic LiDAR of the same place and rays in the rig.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.semantic_points import points_xyz
from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame
from carstage.exporters.ray_lookup import RayLookup
from carstage.sensor_kinds.model import POINTS, TAGGED_POINTS

_RAYS: Final = {
    "channels": 32.0, "range": 10.0, "points_per_second": 56_000.0, "rotation_frequency": 10.0,
    "upper_fov": 10.0, "lower_fov": -30.0, "horizontal_fov": 360.0, "sensor_tick": 0.0,
}  # fmt: skip
"""What says where rays go, how far and how often, with CARLA's defaults."""
_RANGE_TOLERANCE_M, _NOISE_DEVIATIONS = 0.1, 4.0


@dataclass(frozen=True, slots=True)
class LabelledCloud:
    """The points of one sweep.

    Attributes:
        points: ``(N, 4)`` float32 x, y, z (m), intensity, in CARLA's sensor axes.
        tags: ``(N,)`` uint8 semantic tags of ``dataset.json``; 0: not known.
        ids: ``(N,)`` int64 ids of the actors that were hit; 0: none, or not known.
    """

    points: NDArray[np.float32]
    tags: NDArray[np.uint8]
    ids: NDArray[np.int64]


def tag_source(episode: Episode, lidar: SensorCalibration) -> str | None:
    """Id of the semantic LiDAR that knows the tags of a LiDAR's points; ``None``: there is none.

    That is the LiDAR itself, or the first one of the same carrier, pose, channels, angles, range,
    rays and rate.
    """
    if lidar.content == TAGGED_POINTS:
        return lidar.id
    twins = (
        sensor.id
        for sensor in episode.sensors
        if sensor.content == TAGGED_POINTS and _shares_rays(lidar, sensor.calibration)
    )
    return next(twins, None)


def labelled_cloud(frame: Frame, lidar_id: str, source_id: str | None) -> LabelledCloud:
    """A sweep with the tags that ``source_id`` knows.

    A point takes the tag of the source's nearest ray, if that ray is nearer than half the way to
    its neighbours and ends as far away, to 0.1 m and four deviations of the LiDAR's noise. Other
    points have tag 0, and so have all where the source is missing.

    Args:
        frame: whose sweep it is; the LiDAR has data of it.
        lidar_id: an ordinary or a semantic LiDAR. The latter measures no intensity: 0.
        source_id: see ``tag_source``.
    """
    points = _with_intensity(frame.read(lidar_id))
    tags, ids = np.zeros(len(points), np.uint8), np.zeros(len(points), np.int64)
    if source_id is None or not frame.has(source_id):
        return LabelledCloud(points, tags, ids)
    tagged = frame.read(source_id)
    if source_id == lidar_id:
        nearest = np.arange(len(points))
    else:
        nearest = _nearest(points, tagged, frame.episode.sensor(lidar_id).calibration)
    found = nearest >= 0
    tags[found] = tagged["object_tag"][nearest[found]]
    ids[found] = tagged["object_idx"][nearest[found]]
    return LabelledCloud(points, tags, ids)


def _with_intensity(points: NDArray[Any]) -> NDArray[np.float32]:
    if points.dtype.names is None:
        return np.asarray(points, np.float32)
    columns = [*(points[name] for name in "xyz"), np.zeros(len(points), np.float32)]
    return np.column_stack(columns).astype(np.float32)


def _nearest(
    points: NDArray[np.float32], tagged: NDArray[Any], lidar: SensorCalibration
) -> NDArray[np.int64]:
    """``(N,)`` index into ``tagged`` for each point, -1 where no ray fits."""
    rays = _rays(lidar.attributes)
    per_turn = rays["points_per_second"] / rays["rotation_frequency"] / rays["channels"]
    across = rays["horizontal_fov"] / max(per_turn, 1.0)
    up = (rays["upper_fov"] - rays["lower_fov"]) / max(rays["channels"] - 1.0, 1.0)
    lookup = RayLookup(points_xyz(tagged), np.radians(abs(across)), np.radians(abs(up)))
    noise = float(lidar.attributes.get("noise_stddev", 0.0))
    return lookup.nearest(points_xyz(points), _RANGE_TOLERANCE_M + _NOISE_DEVIATIONS * noise)


def _shares_rays(lidar: SensorCalibration, other: SensorCalibration) -> bool:
    """Whether both measure along the same rays in every frame."""
    return (
        lidar.content == POINTS
        and (lidar.attach_to, lidar.attachment) == (other.attach_to, other.attachment)
        and np.array_equal(lidar.carrier_from_sensor, other.carrier_from_sensor)
        and _rays(lidar.attributes) == _rays(other.attributes)
    )


def _rays(attributes: Mapping[str, str]) -> dict[str, float]:
    return {name: float(attributes.get(name, default)) for name, default in _RAYS.items()}
