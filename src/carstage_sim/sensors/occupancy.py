"""A sensor that CARLA has not: the voxels around it that surfaces of the world pass through."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.town import Town
from carstage_sim.render.cast import Geometry
from carstage_sim.render.scene import Frame
from carstage_sim.sensors.attributes import number, require
from carstage_sim.sensors.measurements import SEMANTIC_POINT, SemanticLidarFrame, SensorRequest
from carstage_sim.sensors.sensor import MeasuringSensor, SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.sensors.voxel_kernels import EMPTY, collect, gather, mark, measure
from carstage_sim.world.state import WorldState

TYPE_ID: Final = "sensor.other.occupancy"
MOST_VOXELS: Final = 1 << 22
_AXES: Final = (("behind", "ahead"), ("right", "left"), ("down", "up"))
DEFAULTS: Final[Mapping[str, float]] = MappingProxyType(
    {"ahead": 40.0, "behind": 40.0, "left": 40.0, "right": 40.0, "up": 5.4, "down": 1.0,
     "resolution": 0.4}
)  # fmt: skip
_WHOLE: Final = 1e-6
_FLU_FROM_CARLA: Final = np.array([1.0, -1.0, 1.0])
_CORNERS: Final = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_ALL: Final = (np.full(3, -1e30), np.full(3, 1e30))
"""A box that holds all there is, but no child that is not there, whose box is infinite."""
_FEW: Final = 1 << 12


@SensorRegistry.register(TYPE_ID)
class OccupancySensor(MeasuringSensor):
    """Sends the voxels that are occupied as points of a semantic LiDAR.

    Attributes ``ahead``, ``behind``, ``left``, ``right``, ``up`` and ``down`` say how far they
    reach from the sensor, ``resolution`` is a voxel's side (m). A voxel that surfaces of several
    actors pass through, or of one and the town, comes once for each.
    """

    beside_others = True
    casts_rays = False

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        a = request.attributes
        side_m = number(a, "resolution", DEFAULTS["resolution"])
        reach = {name: number(a, name, DEFAULTS[name]) for pair in _AXES for name in pair}
        require(side_m > 0, "resolution must be above 0")
        require(min(reach.values()) >= 0, "ahead, behind, left, right, up, down: none below 0")
        lengths = [(reach[low] + reach[high]) / side_m for low, high in _AXES]
        x, y, z = (round(length) for length in lengths)
        fits = all(abs(length - round(length)) < _WHOLE and length > 0.5 for length in lengths)
        require(fits, "ahead + behind, left + right, up + down: no whole numbers of resolution")
        require(x * y * z <= MOST_VOXELS, f"{x * y * z} voxels are above {MOST_VOXELS}")
        low_m = np.array([-reach[low] for low, _ in _AXES])
        self._scan = VoxelScan(low_m, (x, y, z), side_m)

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> SemanticLidarFrame:
        """The voxels of this tick, all in one channel."""
        rotation = rotation_matrix(request.rotation_deg)
        points = self._scan.points(view.frame, request.location, rotation)
        return SemanticLidarFrame(0.0, np.array([len(points)], np.uint32), points)


class VoxelScan:
    """Finds the voxels of one grid that surfaces pass through; it keeps its memory.

    Args:
        low_m: ``(3,)`` least forward, left and up of the voxels.
        size: voxels along each.
        side_m: of a voxel.
    """

    def __init__(
        self, low_m: NDArray[np.float64], size: tuple[int, int, int], side_m: float
    ) -> None:
        self._low_m, self._size, self._side_m = low_m, np.array(size, np.int64), side_m
        self._first: NDArray[np.int32] = np.empty(size, np.int32)
        self._triangles: NDArray[np.float32] = np.empty((_FEW, 9), np.float32)
        self._parts: NDArray[np.int32] = np.empty(_FEW, np.int32)
        self._visits: NDArray[np.int32] = np.empty((_FEW, 2), np.int32)
        self._links: NDArray[np.int32] = np.empty((_FEW, 2), np.int32)
        self._areas: NDArray[np.float64] = np.empty(_FEW, np.float64)
        self._stack: NDArray[np.int32] = np.empty(512, np.int32)
        self._brought: NDArray[np.float64] = np.empty((9, 8), np.float64)
        self._scratch: NDArray[np.float64] = np.empty((5, 30), np.float64)

    def points(
        self, frame: Frame, location: tuple[float, float, float], rotation: NDArray[np.float64]
    ) -> NDArray[np.void]:
        """``(N,)`` of ``SEMANTIC_POINT``: the voxels' middles, and what is in them.

        Args:
            frame: the world's surfaces.
            location: of the sensor, world metres.
            rotation: ``(3, 3)`` world_from_sensor.
        """
        count = self._gather(frame, np.asarray(location, np.float64), rotation)
        taken, shared, visits = self._mark(count)
        heads = np.full(shared, -1, np.int32)
        entries = self._measure(visits, heads)
        codes: NDArray[np.uint32] = np.zeros((taken + entries, 6), np.uint32)
        rows = collect(
            self._first, heads, self._links, self._areas, self._low_m, self._side_m,
            np.append(np.uint32(0), frame.actor_id), codes.view(np.float32), codes,
        )  # fmt: skip
        return codes[:rows].view(SEMANTIC_POINT).reshape(-1)

    def _gather(
        self, frame: Frame, location: NDArray[np.float64], rotation: NDArray[np.float64]
    ) -> int:
        """Bring all triangles near the grid into it; how many there are."""
        scene = frame.scene
        grid_from_world = np.empty((3, 4))
        grid_from_world[:, :3] = _FLU_FROM_CARLA[:, None] * rotation.T / self._side_m
        grid_from_world[:, 3] = -grid_from_world[:, :3] @ location - self._low_m / self._side_m
        corners = self._low_m + _CORNERS * self._size * self._side_m
        world = (corners * _FLU_FROM_CARLA) @ rotation.T + location
        box = world.min(axis=0), world.max(axis=0)
        count = self._of(scene.static, 0, grid_from_world, box, frame.static.tag, 0, 0)
        turned = np.einsum("ij,njk->nik", grid_from_world[:, :3], scene.rotation)
        moved = scene.position @ grid_from_world[:, :3].T + grid_from_world[:, 3]
        matrices = np.concatenate([turned, moved[:, :, None]], axis=2)
        middle, half = frame.bounds.mean(axis=1), np.ptp(frame.bounds, axis=1) / 2
        middle = np.einsum("nij,nj->ni", turned, middle) + moved
        reach = np.einsum("nij,nj->ni", np.abs(turned), half)
        near = ((middle + reach >= 0.0) & (middle - reach < self._size)).all(axis=1)
        owners = (frame.body + 1).tolist()  # a wheel's is its vehicle's body
        for row in np.sort(scene.top_row[near[scene.top_row]]).tolist():
            root, tags = int(scene.root[row]), frame.actors.tag
            count = self._of(scene.actors, root, matrices[row], _ALL, tags, owners[row], count)
        return count

    def _of(
        self,
        geometry: Geometry,
        root: int,
        matrix: NDArray[np.float64],
        box: tuple[NDArray[np.float64], NDArray[np.float64]],
        tags: NDArray[np.uint8],
        owner: int,
        before: int,
    ) -> int:
        """Bring the triangles of one hierarchy into the grid, behind ``before`` others."""
        if not len(geometry.planes):
            return before
        while True:
            count: int = gather(
                geometry.planes, geometry.children, geometry.corners, geometry.numbers, root,
                matrix, *box, self._size, tags, owner, self._stack, self._brought, before,
                self._triangles, self._parts,
            )  # fmt: skip
            if count < len(self._parts):
                return count
            triangles, parts = self._triangles[:before], self._parts[:before]
            self._triangles = np.empty((2 * count, 9), np.float32)
            self._parts = np.empty(2 * count, np.int32)
            self._triangles[:before], self._parts[:before] = triangles, parts

    def _mark(self, count: int) -> tuple[int, int, int]:
        """Find all voxels of the triangles; how many, how many have several parts, all visits."""
        while True:
            self._first.fill(EMPTY)
            taken, shared, visits = mark(
                self._triangles, self._parts, count, self._first, self._visits, self._scratch
            )
            if visits <= len(self._visits):
                return taken, shared, visits
            self._visits = np.empty((2 * visits, 2), np.int32)

    def _measure(self, visits: int, heads: NDArray[np.int32]) -> int:
        """Add up surfaces in voxels that several parts share; how many entries there are."""
        while True:
            entries: int = measure(
                self._triangles, self._parts, self._visits, visits, self._first,
                heads, self._links, self._areas, self._scratch,
            )  # fmt: skip
            if entries <= len(self._areas):
                return entries
            heads.fill(-1)
            self._links = np.empty((2 * entries, 2), np.int32)
            self._areas = np.empty(2 * entries, np.float64)


def warm_up(frame: Frame) -> None:
    """Compile or load the kernels.

    Args:
        frame: of any scene.
    """
    VoxelScan(np.zeros(3), (1, 1, 1), 1.0).points(frame, (0.0, 0.0, 0.0), np.eye(3))
