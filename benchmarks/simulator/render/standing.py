"""Does everything stand? What a town is made of, by kind, and all vehicles at all spawn points.

A thing stands on the parts of it that are near the ground. Those of one thing that lie together
are one support: each must touch the ground, and none may be deeper in it than the others. What is
between the ground and a person's height must not go through other things, nor leaves through walls.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from benchmarks.simulator.render.grounding import GroundProbe
from benchmarks.simulator.render.scene import town_of
from carstage.bench.verdict import Figure, Verdict
from carstage_sim.content.solids import placed
from carstage_sim.content.street_furniture import traffic_light_mesh
from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import Town
from carstage_sim.mesh import Material, TriangleMesh, merge_meshes
from carstage_sim.world.blueprints import Blueprint, catalogue
from carstage_sim.world.errors import SpawnError
from carstage_sim.world.pose import Pose
from carstage_sim.world.state import ActorKind
from carstage_sim.world.world import World

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

MOST_GAP_M = 0.03
MOST_INSIDE_M = 0.05
_DEEPEST_FOOT_M = 0.2
"""Posts, legs and the cores of hedges are made to begin this far below ground at most."""
_NEAR_GROUND_M = 0.12
_SUPPORT_M = 0.4
"""Side of the cells whose points are one support; smaller things have one."""
_SLICE_M = 2.2
_TREAD_M = 0.005
_SETTLING_TICKS = 30
_DELTA_S = 0.05
_LEAVES = [
    int(material)
    for material in Material
    if material.name.startswith("LEAVES") or material in (Material.NEEDLES, Material.BLADES)
]


@dataclass(frozen=True, slots=True)
class Things:
    """What stands in a town, as one mesh whose object ids count from 1.

    Attributes:
        mesh: of all things, and of the ground.
        kinds: ``(N + 1,)`` what each is; the first is the ground.
        on_wheels: ``(N + 1,)`` bool.
    """

    mesh: TriangleMesh
    kinds: list[str]
    on_wheels: NDArray[np.bool_]

    @classmethod
    def of(cls, town: Town) -> Things:
        """Level objects and traffic lights."""
        kinds, parts = ["ground"], [town.static_mesh]
        for thing in town.level_objects:
            kinds.append(thing.name.split("_")[0].rstrip("0123456789"))
        for site in town.traffic_lights:
            kinds.append("TrafficLight")
            mesh = traffic_light_mesh(site.head)
            yaw_deg = site.rotation_deg[1]
            number = len(kinds) - 1
            parts.append(placed(mesh, site.location, yaw_deg=yaw_deg, object_id=number))
        wheels = np.array([kind == "Parked" for kind in kinds])
        return cls(merge_meshes(parts), kinds, wheels)

    def points(self, wanted: NDArray[np.bool_]) -> tuple[Rows, Array]:
        """Owners ``(P,)`` and corners ``(P, 3)`` of triangles, each once."""
        owner = np.repeat(self.mesh.object_id[wanted], 3).astype(np.float64)
        corners = self.mesh.vertices[self.mesh.triangles[wanted]].reshape(-1, 3)
        both = np.unique(np.column_stack([owner, corners.astype(np.float64)]), axis=0)
        return both[:, 0].astype(np.int64), both[:, 1:]

    @property
    def solid(self) -> NDArray[np.bool_]:
        """``(T,)`` triangles of things that are no leaves."""
        found: NDArray[np.bool_] = self.mesh.object_id > 0
        return found & ~np.isin(self.mesh.material, _LEAVES)


def check_standing(*, towns: Sequence[str], blueprints: Sequence[str]) -> Verdict:
    """Measures towns.

    Args:
        towns: their names.
        blueprints: vehicles to set down at every spawn point; none for no vehicle.
    """
    figures: list[Figure] = []
    for name in towns:
        town = town_of(name)
        for found in (*thing_figures(town), *vehicle_figures(town, blueprints)):
            figures.append(replace(found, name=f"{name}: {found.name}"))
    return Verdict("standing", tuple(figures))


def thing_figures(town: Town) -> Iterator[Figure]:
    """Gaps, depths and overlaps of what a town has."""
    things = Things.of(town)
    gap, inside = gaps_and_depths(things)
    yield Figure("things", len(things.kinds) - 1)
    yield Figure("largest_gap_m", float(gap.max()), "<=", MOST_GAP_M)
    yield Figure("kind_with_the_largest_gap", things.kinds[int(gap.argmax()) + 1])
    yield Figure("deepest_in_the_ground_m", float(inside.max()), "<=", MOST_INSIDE_M)
    yield Figure("kind_that_is_deepest", things.kinds[int(inside.argmax()) + 1])
    pairs = overlaps(things)
    yield Figure("pairs_that_overlap", len(pairs), "==", 0)
    if pairs:
        yield Figure("overlapping_kinds", ", ".join(sorted({" in ".join(p) for p in pairs})))
    yield Figure("plants_in_walls", plants_in_walls(things), "==", 0)


def gaps_and_depths(things: Things) -> tuple[Array, Array]:
    """``(N,)`` largest gap below a support, and how far another is deeper in the ground (m).

    Feet that are made to begin underground may be ``_DEEPEST_FOOT_M`` deep, all of one thing alike.
    """
    rubber = things.mesh.material == int(Material.RUBBER)
    owner, points = things.points(
        things.solid & (rubber | ~things.on_wheels[things.mesh.object_id.astype(np.int64)])
    )
    count = len(things.kinds)
    lowest = np.full(count, np.inf)
    np.minimum.at(lowest, owner, points[:, 2])
    low = points[:, 2] < lowest[owner] + _SLICE_M
    owner, points = owner[low], points[low]
    gap = GroundProbe(things.mesh)(points)
    nearest = np.full(count, np.inf)
    np.minimum.at(nearest, owner, gap)
    near = gap < np.maximum(nearest[owner], 0.0) + _NEAR_GROUND_M
    owner, points, gap = owner[near], points[near], gap[near]
    support, number = np.unique(
        np.column_stack([owner, _cells(things, owner, points)]), axis=0, return_inverse=True
    )
    touches = np.full(len(support), np.inf)
    np.minimum.at(touches, number.reshape(-1), gap)
    most, least = np.full(count, -np.inf), np.full(count, np.inf)
    np.maximum.at(most, support[:, 0], touches)
    np.minimum.at(least, support[:, 0], touches)
    inside = np.maximum(most - least, -least - _DEEPEST_FOOT_M)
    return most[1:], inside[1:]


def _cells(things: Things, owner: Rows, points: Array) -> Rows:
    """``(P, 2)`` which points of a thing are one support: wheels by their corner of the car."""
    count = len(things.kinds)
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, owner, points[:, :2])
    np.maximum.at(high, owner, points[:, :2])
    cells = np.floor((points[:, :2] - low[owner]) / _SUPPORT_M)
    small = (high - low).max(axis=1) < 2.0 * _SUPPORT_M
    cells[small[owner]] = 0.0
    for number in np.flatnonzero(things.on_wheels).tolist():
        (mine,) = np.nonzero(owner == number)
        offset = points[mine, :2] - (low[number] + high[number]) / 2
        # The length of a car is the direction in which its tyres are spread most.
        _, _, axes = np.linalg.svd(offset - offset.mean(axis=0), full_matrices=False)
        cells[mine] = offset @ axes.T > 0.0
    whole: Rows = cells.astype(np.int64)
    return whole


def overlaps(things: Things) -> list[tuple[str, str]]:
    """Kinds of things that are within each other by more than allowed, below a person's height."""
    owner, points = things.points(things.solid)
    lowest = np.full(len(things.kinds), np.inf)
    np.minimum.at(lowest, owner, points[:, 2])
    low = points[:, 2] < lowest[owner] + _SLICE_M
    owner, points = owner[low], points[low]
    numbers, first = np.unique(owner, return_index=True)
    plans = np.array([
        shapely.convex_hull(shapely.multipoints(own[:, :2]))
        for own in np.split(points, first[1:])
    ])  # fmt: skip
    inner = shapely.buffer(plans, -MOST_INSIDE_M / 2, join_style="mitre")
    one, two = shapely.STRtree(inner).query(inner, predicate="intersects")
    z = lowest[numbers]
    met = (one < two) & (np.abs(z[one] - z[two]) < _SLICE_M)
    kinds = [things.kinds[k] for k in numbers.tolist()]
    masts = np.array([kind == "TrafficLight" for kind in kinds])
    apart = shapely.distance(shapely.centroid(plans[one]), shapely.centroid(plans[two]))
    # Maps may have two signals on one mast.
    met &= ~(masts[one] & masts[two] & (apart < MOST_INSIDE_M))
    return [(kinds[a], kinds[b]) for a, b in zip(one[met], two[met], strict=True)]


def plants_in_walls(things: Things) -> int:
    """How many plants have a leaf or branch deeper in a building than allowed."""
    is_building = np.array([kind == "Building" for kind in things.kinds])
    grows = things.mesh.tag == int(CityObjectLabel.VEGETATION)
    grower, leaves = things.points(grows & (things.mesh.object_id > 0))
    owner, corners = things.points(is_building[things.mesh.object_id.astype(np.int64)])
    tree = shapely.STRtree(np.asarray(shapely.points(leaves[:, :2])))
    found: set[int] = set()
    numbers, first = np.unique(owner, return_index=True)
    for own in np.split(corners, first[1:]) if len(numbers) else ():
        foot = own[own[:, 2] < own[:, 2].min() + _SLICE_M]
        plan = shapely.convex_hull(shapely.multipoints(foot[:, :2]))
        rows = tree.query(plan.buffer(-MOST_INSIDE_M, join_style="mitre"), predicate="contains")
        inside = rows[leaves[rows, 2] < own[:, 2].max() - MOST_INSIDE_M]
        found.update(grower[inside].tolist())
    return len(found)


def vehicle_figures(town: Town, blueprints: Sequence[str]) -> Iterator[Figure]:
    """How far wheels of vehicles are above or in the road where they were spawned and settled."""
    if not blueprints:
        return
    gap_below = GroundProbe(town.static_mesh)
    highest, lowest, where, stood = -np.inf, np.inf, "", 0
    for name in blueprints:
        treads = _treads(catalogue()[name])
        for location, rotation in _settled(town, name):
            stood += len(location)
            for tread in treads:
                points = np.einsum("nij,kj->nki", rotation, tread) + location[:, None]
                gap = gap_below(points.reshape(-1, 3)).reshape(len(location), -1).min(axis=1)
                if gap.max() > highest:
                    highest, where = float(gap.max()), name
                lowest = min(lowest, float(gap.min()))
    wanted = len(blueprints) * len(town.spawn_points)
    yield Figure("vehicles_at_spawn_points", stood, "==", wanted)
    yield Figure("largest_gap_below_a_wheel_m", highest, "<=", MOST_GAP_M)
    yield Figure("vehicle_with_the_largest_gap", where)
    yield Figure("deepest_wheel_in_the_road_m", -lowest, "<=", MOST_GAP_M)


def every_blueprint() -> list[str]:
    """Ids of all vehicles."""
    return sorted(name for name, b in catalogue().items() if b.kind == ActorKind.VEHICLE)


def _treads(blueprint: Blueprint) -> list[Array]:
    """The lowest points of each drawn wheel, in the vehicle's frame."""
    parameters = blueprint.vehicle
    assert parameters is not None
    mesh = vehicle_mesh(
        blueprint.id,
        blueprint.box_extent,
        blueprint.box_center,
        axles_m=(parameters.front_axle_x_m, parameters.rear_axle_x_m),
        wheel_radius_m=parameters.wheels[0].radius_m,
    )
    rows = np.unique(mesh.triangles[mesh.material == int(Material.RUBBER)])
    tyres = mesh.vertices[rows].astype(np.float64)
    found = []
    for axle in (tyres[:, 0] > 0.0, tyres[:, 0] <= 0.0):
        for side in (tyres[:, 1] > 0.0, tyres[:, 1] <= 0.0):
            tyre = tyres[axle & (side if parameters.track_m > 0.0 else True)]
            found.append(tyre[tyre[:, 2] < tyre[:, 2].min() + _TREAD_M])
    return found


def _settled(town: Town, name: str) -> Iterator[tuple[Array, Array]]:
    """Locations and rotations of vehicles of one kind, as many at once as have room."""
    left = [Pose((x, y, z), (pitch, yaw, roll))
            for x, y, z, pitch, yaw, roll in town.spawn_points.tolist()]  # fmt: skip
    while left:
        world, waiting, ids = World(town, 1), [], set[int]()
        for pose in left:
            try:
                ids.add(world.spawn(name, {}, pose).actor_id)
            except SpawnError:
                waiting.append(pose)
        if not ids:
            return
        for _ in range(_SETTLING_TICKS):
            state = world.tick(_DELTA_S).state
        rows = np.flatnonzero(np.isin(state.actor_id, list(ids)))
        yield state.location[rows], rotation_matrix(state.rotation_deg[rows])
        left = waiting
