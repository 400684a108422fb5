"""LiDAR points with semantic labels.

A semantic LiDAR labels its own points, but measures no intensity. A semantic flash LiDAR does
both. Points of an ordinary LiDAR take
the label of the nearest ray of a semantic LiDAR that stands at the same place and scans alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.semantic_points import points_xyz
from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import main_lidar
from carstage.sensor_kinds import sensor_kind
from carstage.sensor_kinds.columns import Point, TaggedPoint
from carstage.sensor_kinds.model import POINTS, TAGGED_POINTS

_SCAN: Final = {
    "channels": 32.0, "range": 10.0, "points_per_second": 56_000.0, "rotation_frequency": 10.0,
    "upper_fov": 10.0, "lower_fov": -30.0, "horizontal_fov": 360.0, "sensor_tick": 0.0,
}  # fmt: skip
"""What both LiDARs must have alike for their rays to be the same, with CARLA's defaults."""
_BIN_RAD: Final = np.radians(0.25)
_NEAREST_RAD: Final = np.radians(0.2)
_SAME_M, _SAME_SHARE = 0.3, 0.02
_NOISE_SIGMAS: Final = 4.0
_MOST_COLUMNS: Final = 20
"""Cells of azimuth to either side that are looked through: enough up to 87 degrees."""


@dataclass(frozen=True, slots=True)
class LabelledLidar:
    """Whose points are exported, and whose labels they take.

    Attributes:
        points: the LiDAR's id.
        labels: the semantic LiDAR's, which may be the same; None: no labels.
        noise_m: standard deviation along the ray of the LiDAR whose points are exported.
    """

    points: str
    labels: str | None
    noise_m: float = 0.0

    @classmethod
    def of(cls, lidar: SensorCalibration, labels: str | None) -> LabelledLidar:
        """A LiDAR that takes its labels from another one."""
        return cls(lidar.id, labels, float(lidar.attributes.get("noise_stddev", 0.0)))

    @property
    def is_semantic(self) -> bool:
        """Whether its points are labelled by itself."""
        return self.points == self.labels


@dataclass(frozen=True, slots=True)
class LabelledCloud:
    """One sweep.

    Attributes:
        points: ``(N, 4)`` float32 x, y, z (m), intensity, CARLA's sensor axes; intensity is 0 of a
            semantic LiDAR.
        tags: ``(N,)`` uint8 semantic tags as in ``dataset.json``; 0: no label.
        objects: ``(N,)`` uint32 actor ids; 0: none.
    """

    points: NDArray[np.float32]
    tags: NDArray[np.uint8]
    objects: NDArray[np.uint32]


def labelled_lidar(episode: Episode, options: ExportOptions) -> LabelledLidar:
    """The ego's LiDAR that the options name, else the first that has labels.

    An ordinary one goes before a semantic one.

    Raises:
        BadInputError: no LiDAR on the ego has labels, or the one that is named has none.
    """
    semantic = [
        sensor.id
        for sensor in episode.sensors
        if sensor.content == TAGGED_POINTS and sensor.calibration.on_ego
    ]
    if options.lidar in semantic:
        return LabelledLidar(options.lidar, options.lidar)
    named = main_lidar(episode, options)
    plain = [named] if options.lidar is not None and named is not None else [
        sensor.calibration for sensor in episode.sensors
        if sensor.content == POINTS and sensor.calibration.on_ego
    ]  # fmt: skip
    for lidar in plain:
        source = label_source(episode, lidar)
        if source is not None:
            return LabelledLidar.of(lidar, source)
    if options.lidar is None and semantic:
        return LabelledLidar(semantic[0], semantic[0])
    raise BadInputError(
        f"No LiDAR of episode {episode.id} has labels.",
        "Record with `labels: {lidars: all}`, or add a sensor of kind semantic_lidar to the rig.",
    )


def label_source(episode: Episode, lidar: SensorCalibration) -> str | None:
    """Id of the semantic LiDAR that labels a LiDAR's points; None: there is none.

    That is the LiDAR itself if its points have tags. Else it is the first one at the same place of
    the same carrier that scans alike, which none does like a flash or a sweeping LiDAR.
    """
    if lidar.content == TAGGED_POINTS or sensor_kind(lidar.kind).tags_points:
        return lidar.id
    if sensor_kind(lidar.kind).recorded:
        return None
    twins = (
        sensor.id
        for sensor in episode.sensors
        if sensor.content == TAGGED_POINTS and _scan_alike(lidar, sensor.calibration)
    )
    return next(twins, None)


def _scan_alike(lidar: SensorCalibration, twin: SensorCalibration) -> bool:
    """Whether both measure along the same rays in every frame."""
    return (
        lidar.carried == twin.carried
        and np.allclose(lidar.carrier_from_sensor, twin.carrier_from_sensor, atol=1e-9)
        and _scan(lidar.attributes) == _scan(twin.attributes)
    )


def _scan(attributes: Mapping[str, str]) -> dict[str, float]:
    return {name: float(attributes.get(name, usual)) for name, usual in _SCAN.items()}


def read_points(frame: Frame, lidar_id: str) -> NDArray[np.float32]:
    """``(N, 4)`` x, y, z (m), intensity of a sweep; a semantic LiDAR measures no intensity: 0."""
    read = frame.read(lidar_id)
    if read.dtype.names is None:
        return np.asarray(read[:, : Point.INTENSITY + 1], np.float32)
    points = np.zeros((len(read), 4), np.float32)
    points[:, :3] = points_xyz(read)
    return points


def read_rings(frame: Frame, lidar_id: str) -> NDArray[np.float32] | None:
    """``(N,)`` number of the laser of each point; None: the LiDAR does not keep it."""
    names = [column.name for column in sensor_kind(frame.episode.sensor(lidar_id).kind).columns]
    return frame.read(lidar_id)[:, names.index("ring")] if "ring" in names else None


def read_labelled(frame: Frame, lidar: LabelledLidar) -> LabelledCloud:
    """The sweep of a frame; without labels where the source has no data of it."""
    points = read_points(frame, lidar.points)
    if lidar.is_semantic:
        tagged = frame.read(lidar.points)
        if tagged.dtype.names is None:
            own = tagged[:, TaggedPoint.OBJECT :].astype(np.uint32)
            return LabelledCloud(points, own[:, 1].astype(np.uint8), own[:, 0])
        return LabelledCloud(points, tagged["object_tag"].astype(np.uint8), tagged["object_idx"])
    tags, objects = np.zeros(len(points), np.uint8), np.zeros(len(points), np.uint32)
    if lidar.labels is not None and frame.has(lidar.labels):
        tagged = frame.read(lidar.labels)
        nearest = nearest_rays(points_xyz(points), points_xyz(tagged), lidar.noise_m)
        found = nearest >= 0
        tags[found] = tagged["object_tag"][nearest[found]]
        objects[found] = tagged["object_idx"][nearest[found]]
    return LabelledCloud(points, tags, objects)


def nearest_rays(
    points: NDArray[np.float64], rays: NDArray[np.float64], noise_m: float = 0.0
) -> NDArray[np.int64]:
    """For each point the ray in the nearest direction that ends at the same surface.

    Args:
        points: ``(N, 3)`` m, in the sensor's axes.
        rays: ``(M, 3)`` ends of the rays, likewise.
        noise_m: standard deviation along the ray of what measured the points.

    Returns:
        ``(N,)`` indices into ``rays``; -1 where no ray within 0.2 degrees ends within 0.3 m + 2 %
        of the point's distance + 4 standard deviations.
    """
    if not len(rays) or not len(points):
        return np.full(len(points), -1, dtype=np.int64)
    direction, distance = _directions(points)
    ray_direction, ray_distance = _directions(rays)
    keys = _cells(ray_direction)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    best: NDArray[np.int64] = np.full(len(points), -1, dtype=np.int64)
    closest = np.full(len(points), np.cos(_NEAREST_RAD))
    allowed = _SAME_M + _NOISE_SIGMAS * noise_m + _SAME_SHARE * distance
    for offset in _neighbours(direction):
        cell = _cells(direction, offset)
        begin, end = np.searchsorted(keys, cell), np.searchsorted(keys, cell, side="right")
        for step in range(int((end - begin).max(initial=0))):
            some = np.flatnonzero(begin + step < end)
            candidate = order[begin[some] + step]
            cosine = np.einsum("ij,ij->i", direction[some], ray_direction[candidate])
            off = np.abs(distance[some] - ray_distance[candidate])
            better = (cosine > closest[some]) & (off <= allowed[some])
            best[some[better]] = candidate[better]
            closest[some[better]] = cosine[better]
    return best


def _directions(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    distance = np.linalg.norm(points, axis=1)
    return points / np.maximum(distance, 1e-9)[:, None], distance


def _cells(direction: NDArray[np.float64], offset: tuple[int, int] = (0, 0)) -> NDArray[np.int64]:
    """Numbers of cells of azimuth and elevation; the azimuth goes round."""
    columns = round(2.0 * np.pi / _BIN_RAD)
    azimuth = np.floor(np.arctan2(direction[:, 1], direction[:, 0]) / _BIN_RAD).astype(np.int64)
    elevation = np.floor(np.arcsin(np.clip(direction[:, 2], -1.0, 1.0)) / _BIN_RAD)
    cells: NDArray[np.int64] = (elevation.astype(np.int64) + offset[1] + columns) * columns + (
        azimuth + offset[0]
    ) % columns
    return cells


def _neighbours(direction: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Offsets of the cells that may hold a nearest ray: cells of azimuth narrow with elevation."""
    level = np.sqrt(max(1.0 - float(np.abs(direction[:, 2]).max()) ** 2, 1e-9))
    reach = min(int(np.ceil(_NEAREST_RAD / _BIN_RAD / level)), _MOST_COLUMNS)
    return [(column, row) for row in (-1, 0, 1) for column in range(-reach, reach + 1)]


def is_labelled(frame: Frame, lidar: LabelledLidar) -> bool:
    """Whether a frame has the data of both."""
    return frame.has(lidar.points) and lidar.labels is not None and frame.has(lidar.labels)


def moving_actors(frame: Frame, faster_than_m_s: float) -> list[int]:
    """Ids of actors that move, as LiDARs give them; the ego's too."""
    found = [
        track
        for track, row in frame.objects.items()
        if float(np.linalg.norm(row["velocity"])) > faster_than_m_s
    ]
    ego = frame.ego
    if ego is not None and ego["speed"] > faster_than_m_s:
        found.append(ego["track_id"])
    return found
