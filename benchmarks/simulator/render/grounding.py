"""Does everything stand on the ground? The gap below the lowest point of each object."""

from __future__ import annotations

from contextlib import closing

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.render.scene import NO_ACTORS, ReferenceScene
from carstage.bench.verdict import Figure
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import TriangleMesh
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.scene import Frame, SceneStore
from carstage_sim.world.state import ActorKind

Array = NDArray[np.float64]

_GROUND = (
    CityObjectLabel.ROADS, CityObjectLabel.ROAD_LINES, CityObjectLabel.SIDEWALKS,
    CityObjectLabel.TERRAIN, CityObjectLabel.GROUND,
)  # fmt: skip
_MOST_M = 0.03
_STEP_M = 0.5
_SUNK_M = 20.0


def ground_figures(scene: ReferenceScene) -> list[Figure]:
    """The largest gap below vehicles and walkers, and below what the map stands on its ground."""
    mesh = scene.world.town.static_mesh
    gap_below = GroundProbe(mesh)
    state = scene.state()
    frame = scene.sensors.frame_of(state)
    moving = state.actor_id[np.isin(state.kind, (ActorKind.VEHICLE, ActorKind.WALKER))]
    actors = [
        _actor_gap(frame, row, gap_below)
        for row in np.isin(frame.actor_id, moving).nonzero()[0].tolist()
    ]
    gaps = gap_below(lowest_vertices(mesh))
    return [
        Figure("largest_gap_below_an_actor_m", max(actors), "<=", _MOST_M),
        Figure("largest_gap_below_a_level_object_m", float(gaps.max()), "<=", _MOST_M),
        Figure("level_objects_with_a_gap", int((gaps > _MOST_M).sum())),
    ]


class GroundProbe:
    """Finds how far points are above the ground below them.

    Args:
        mesh: of a town.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        kept = np.isin(mesh.tag, [int(tag) for tag in _GROUND])
        ground = TriangleMesh(
            mesh.vertices, mesh.triangles[kept], mesh.normals[kept], mesh.material[kept],
            mesh.tag[kept], mesh.object_id[kept],
        )  # fmt: skip
        self._scene = SceneStore(ground, NO_ACTORS, cache=None).frame([]).scene

    def __call__(self, points: Array) -> Array:
        """``(N,)`` metres between points and the ground; negative for what is sunk into it."""
        with closing(RayCaster(1)) as caster:
            start = points + np.array([0.0, 0.0, _STEP_M])
            down = np.tile(np.array([0.0, 0.0, -1.0], np.float32), (len(points), 1))
            below = caster.cast(self._scene, start, down, low=0.0, high=100.0)
            above = caster.cast(self._scene, start, -down, low=0.0, high=_SUNK_M)
        gap = below.t.astype(np.float64) - _STEP_M
        # The ground above is nearer than what is below, if anything is: a foundation.
        depth = above.t.astype(np.float64) + _STEP_M
        buried = (above.row != NOTHING) & ((below.row == NOTHING) | (depth < gap))
        gap[buried] = -depth[buried]
        return gap


def _actor_gap(frame: Frame, row: int, gap_below: GroundProbe) -> float:
    """Gap below the corner of an actor's box that is nearest to the ground."""
    low, high = frame.bounds[row].astype(np.float64)
    corners = np.array([[(k >> axis) & 1 for axis in range(2)] + [0] for k in range(4)])
    turned = (low + (high - low) * corners) @ frame.scene.rotation[row].astype(np.float64).T
    return float(gap_below(turned + frame.scene.position[row]).min())


def lowest_vertices(mesh: TriangleMesh) -> Array:
    """``(N, 3)`` lowest vertex of each level object."""
    owner = np.repeat(mesh.object_id, 3)
    places = mesh.vertices[mesh.triangles].reshape(-1, 3)
    places, owner = places[owner > 0], owner[owner > 0]
    order = np.lexsort((places[:, 2], owner))
    _, first = np.unique(owner[order], return_index=True)
    lowest: Array = places[order][first].astype(np.float64)
    return lowest
