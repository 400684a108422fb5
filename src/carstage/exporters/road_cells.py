"""Where roads are, from what semantic sensors saw of them: cells of a map seen from above."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.semantic_points import points_xyz
from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.exporters.axes import flu_vector
from carstage.geometry import (
    FloatArray,
    invert_pose,
    optical_from_world,
    transform_points,
)
from carstage.sensor_kinds.columns import Instance
from carstage.sensor_kinds.model import DEPTH, INSTANCES, TAGGED_POINTS, TAGS
from carstage.tags import TAGS_0_9_14

CELL_M: Final = 0.5
_SURFACES = np.array(
    [value for value, tag in TAGS_0_9_14.items() if tag.name in ("Roads", "RoadLine", "SideWalks")]
)
_EVERY_PX, _FARTHEST_M = 4, 40.0
_GAP_CELLS = 3


@dataclass(frozen=True, slots=True)
class SurfaceSensors:
    """What sees the ground with its tag: semantic LiDARs, and pairs of tag and depth cameras."""

    lidars: tuple[str, ...]
    cameras: tuple[tuple[str, str], ...]

    def __bool__(self) -> bool:
        return bool(self.lidars or self.cameras)


def surface_sensors(episode: Episode) -> SurfaceSensors:
    """The sensors of an episode that tell where roads are."""
    by_content = {
        content: [s.calibration for s in episode.sensors if s.content == content]
        for content in (TAGGED_POINTS, TAGS, INSTANCES, DEPTH)
    }
    pairs = (
        (tags.id, depth.id)
        for tags in (*by_content[TAGS], *by_content[INSTANCES])
        for depth in by_content[DEPTH]
        if tags.shares_view(depth)
    )
    lidars = tuple(sensor.id for sensor in by_content[TAGGED_POINTS])
    return SurfaceSensors(lidars, tuple(pairs))


def surface_cells(
    frame: Frame, sensors: SurfaceSensors, shift_m: tuple[float, float]
) -> NDArray[np.int32]:
    """Cells ``(N, 2)`` east and north, of 0.5 m, with a point of a road or a sidewalk.

    Args:
        frame: what was seen.
        sensors: of its episode.
        shift_m: what is added to east and north.
    """
    places = [*_of_lidars(frame, sensors), *_of_cameras(frame, sensors)]
    if not places:
        return np.zeros((0, 2), np.int32)
    east_north = flu_vector(np.concatenate(places))[:, :2] + np.array(shift_m)
    cells = np.floor(east_north / CELL_M).astype(np.int32)
    return np.unique(cells, axis=0)


def _of_lidars(frame: Frame, sensors: SurfaceSensors) -> Iterator[FloatArray]:
    for lidar in sensors.lidars:
        if frame.has(lidar):
            points = frame.read(lidar)
            points = points[np.isin(points["object_tag"], _SURFACES)]
            yield transform_points(frame.world_from_sensor(lidar), points_xyz(points))


def _of_cameras(frame: Frame, sensors: SurfaceSensors) -> Iterator[FloatArray]:
    """Every fourth pixel of every fourth row, up to 40 m."""
    for tag_camera, depth_camera in sensors.cameras:
        if not (frame.has(tag_camera) and frame.has(depth_camera)):
            continue
        tags = frame.read(tag_camera)
        if tags.ndim == 3:
            tags = tags[..., Instance.TAG]
        depth_m = frame.read(depth_camera)[::_EVERY_PX, ::_EVERY_PX]
        wanted = np.isin(tags[::_EVERY_PX, ::_EVERY_PX], _SURFACES) & (depth_m < _FARTHEST_M)
        row, column = np.nonzero(wanted)
        uv = np.stack([column, row], axis=-1) * _EVERY_PX + 0.5
        camera = frame.episode.sensor(depth_camera).calibration
        optical = camera.back_project(uv, depth_m[wanted])
        world_from_optical = invert_pose(optical_from_world(frame.world_from_sensor(depth_camera)))
        yield transform_points(world_from_optical, optical)


class SurfaceMap:
    """The cells of one map.

    Args:
        east_m: its width, from 0.
        north_m: its height, from 0.
    """

    def __init__(self, east_m: float, north_m: float) -> None:
        size = (int(np.ceil(length / CELL_M)) for length in (north_m, east_m))
        self._seen = np.zeros(tuple(size), np.bool_)

    def add(self, cells: NDArray[np.int32]) -> None:
        """Mark cells; those off the map are left out."""
        east, north = cells.T
        height, width = self._seen.shape
        inside = (east >= 0) & (north >= 0) & (east < width) & (north < height)
        self._seen[north[inside], east[inside]] = True

    def closed(self) -> NDArray[np.bool_]:
        """``(north, east)`` whether a cell is on a road, gaps of up to 3 m closed."""
        grown = _spread(self._seen)
        return ~_spread(~grown) | self._seen


def _spread(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The cells and those up to three cells beside and before them."""
    for axis in (0, 1):
        source, cells = cells, cells.copy()
        for step in range(1, _GAP_CELLS + 1):
            near = [slice(None)] * 2
            far = [slice(None)] * 2
            near[axis], far[axis] = slice(None, -step), slice(step, None)
            cells[tuple(near)] |= source[tuple(far)]
            cells[tuple(far)] |= source[tuple(near)]
    return cells
