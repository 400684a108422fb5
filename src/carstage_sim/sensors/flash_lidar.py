"""Rays into the footprints of a flash LiDAR's beams, in one instant; CARLA has no such sensor."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import Town
from carstage_sim.render.cast import NOTHING
from carstage_sim.sensors.attributes import number, require, whole, within
from carstage_sim.sensors.measurements import SEMANTIC_POINT, SemanticLidarFrame, SensorRequest
from carstage_sim.sensors.sensor import MeasuringSensor, SensorRegistry
from carstage_sim.sensors.view import View, turned
from carstage_sim.world.state import WorldState

TYPE_ID: Final = "sensor.lidar.ray_cast_flash"
_MOST_SIDE: Final = 4096
_MOST_SAMPLES: Final = 16
_MOST_RAYS: Final = 4_000_000

_SIN = np.vectorize(math.sin, otypes=[np.float64])
_COS = np.vectorize(math.cos, otypes=[np.float64])

Vector = NDArray[np.float64]


@SensorRegistry.register(TYPE_ID)
class FlashRays(MeasuringSensor):
    """Sends where the rays end as points of a semantic LiDAR with a channel for each beam.

    Beams go row by row from the top left, in equal steps of azimuth and elevation. A beam's
    footprint is ``horizontal_divergence`` by ``vertical_divergence`` degrees, with a ray through
    the middle of each of ``samples`` by ``samples`` equal cells. There are no losses and no noise.
    """

    beside_others = True

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        a = request.attributes
        columns, rows = whole(a, "columns", 128), whole(a, "rows", 32)
        samples = whole(a, "samples", 1)
        across_deg, up_deg = number(a, "horizontal_fov", 60.0), number(a, "vertical_fov", 15.0)
        wide_deg = number(a, "horizontal_divergence", 0.0)
        high_deg = number(a, "vertical_divergence", 0.0)
        self.range_m = number(a, "range", 50.0)
        within("columns", columns, 1, _MOST_SIDE)
        within("rows", rows, 1, _MOST_SIDE)
        within("samples", samples, 1, _MOST_SAMPLES)
        within("horizontal_fov", across_deg, 0, 360)
        within("vertical_fov", up_deg, 0, 180)
        within("horizontal_divergence", wide_deg, 0, 360)
        within("vertical_divergence", high_deg, 0, 180)
        require(self.range_m >= 0, "range must not be negative")
        rays = columns * rows * samples**2
        require(rays <= _MOST_RAYS, f"{rays} rays are above {_MOST_RAYS}")
        self.beams = columns * rows
        self._beam = np.repeat(np.arange(self.beams), samples**2)
        self._local = _directions(
            (_steps(columns) * math.radians(across_deg), _steps(rows) * math.radians(up_deg)),
            (_steps(samples) * math.radians(wide_deg), _steps(samples) * math.radians(high_deg)),
        )

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> SemanticLidarFrame:
        """The rays that met something, beam by beam."""
        world = turned(self._local, request.rotation_deg)
        hits = view.rays(request.location, world, high=self.range_m, owner_id=request.owner_id)
        met = hits.row != NOTHING
        points = np.empty(int(met.sum()), SEMANTIC_POINT)
        for axis, name in enumerate("xyz"):
            points[name] = self._local[met, axis] * hits.t[met]
        normals, directions = view.flat_normals(hits)[met], hits.directions[met]
        cosine = (
            normals[:, 0] * directions[:, 0]
            + normals[:, 1] * directions[:, 1]
            + normals[:, 2] * directions[:, 2]
        )
        points["cos_inc_angle"] = np.abs(cosine)
        points["object_idx"] = view.actor_ids(hits)[met]
        points["object_tag"] = view.tags(hits)[met]
        counts = np.bincount(self._beam[met], minlength=self.beams).astype(np.uint32)
        return SemanticLidarFrame(0.0, counts, points)


def _steps(count: int) -> Vector:
    """Middles of equal parts of what is 1 wide, around 0."""
    return (np.arange(count) + 0.5) / count - 0.5


def _directions(beams_rad: tuple[Vector, Vector], cells_rad: tuple[Vector, Vector]) -> Vector:
    """``(rays, 3)`` unit vectors x forward, y right, z up: by row, column, row and column of cells.

    Args:
        beams_rad: azimuths of the columns; of the rows, what their elevations are below 0.
        cells_rad: likewise, of the cells of a footprint.
    """
    across = beams_rad[0][None, :, None, None] + cells_rad[0][None, None, None, :]
    up = -beams_rad[1][:, None, None, None] - cells_rad[1][None, None, :, None]
    # By functions of ``math``, whose bits are the same on every machine.
    cos_up, sin_up = _COS(up), _SIN(up)
    parts = cos_up * _COS(across), cos_up * _SIN(across), sin_up
    return np.stack(np.broadcast_arrays(*parts), axis=-1).reshape(-1, 3)
