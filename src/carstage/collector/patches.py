"""Patches: boards beside the road, on walls, on vehicles and people, and the pictures on them.

A board is a prop of the server's catalogue. Its texture is applied by name, as CARLA's client does
it: the name of a prop is the one that the server lists since it was spawned. Boards are the same
whether their pictures are shown or not, so that nothing but colours differs between the two.
"""

from __future__ import annotations

import logging
import math
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import carla

from carstage.collector.actors import find_blueprint
from carstage.collector.scenario import Population
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec
from carstage.spec.patches import (
    BILLBOARD,
    GROUND,
    SHOP_FRONT,
    VEHICLE_REAR,
    PatchSpec,
    board_face,
    patch_place,
)

TRIES_M = (0.0, 2.0, -2.0, 4.0, -4.0, 6.0, 9.0, 12.0, 16.0, 20.0, 25.0)
"""Places along the lane, from the wanted one on."""
STEP_M = 0.5
WIDEST_M = 30.0
"""No road's edge is farther from the middle of a lane."""
BESIDE_M = 1.0
"""Of a billboard from the road's edge."""
TURNED_DEG = 20.0
"""A billboard is turned that far towards the road."""
CAST_M = 45.0
WALL_M = 0.08
"""Between a wall and the board on it."""
SHOP_BOTTOM_M = 1.6
"""Of the board on a wall, above the ground."""
REAR_M = 0.05
CHEST_M = 0.12
"""Between a vehicle's rear, or a person, and the board."""
LEAST_WIDTH_M = 2.0
"""Of vehicles that carry a board."""

_log = logging.getLogger(__name__)

Vector = Tuple[float, float, float]


class PlacedPatch(NamedTuple):
    """A patch in the world.

    Attributes:
        name: of the patch.
        actor_id: of its board.
        target_id: of the vehicle or person that carries it, 0 for none.
    """

    name: str
    actor_id: int
    target_id: int


class _Pose(NamedTuple):
    """Where the middle of a board's box is, where its front looks (yaw, deg), who carries it."""

    center: Vector
    yaw_deg: float
    parent: Optional[Any]


def place_patches(
    session: WorldSession, spec: EpisodeSpec, population: Population
) -> List[PlacedPatch]:
    """Spawn the boards of an episode and put the pictures on them.

    What finds no place is left out, and logged.

    Args:
        session: the episode's world; everybody is in its newest frame.
        spec: the episode.
        population: who was spawned.

    Raises:
        SceneError: the server lacks a board.
    """
    placed: List[PlacedPatch] = []
    for number, patch in enumerate(spec.patches):
        path = "patches[%d].board" % number
        blueprint = find_blueprint(session.world.get_blueprint_library(), patch.board, path)
        known = set(session.world.get_names_of_all_objects())
        found = _spawn(session, population, patch, blueprint, {one.target_id for one in placed})
        if found is None:
            _log.warning("%s: no place for a patch on a %s", patch.name, patch.target)
            continue
        board, parent = found
        session.destroy_on_exit("board %d" % board.id, board)
        names = [name for name in session.world.get_names_of_all_objects() if name not in known]
        texture = _texture(patch, _extent(board))
        diffuse = carla.MaterialParameter.Diffuse
        session.world.apply_color_texture_to_objects(names, diffuse, texture)
        placed.append(PlacedPatch(patch.name, board.id, 0 if parent is None else parent.id))
    return placed


def patch_entries(placed: Sequence[PlacedPatch]) -> Dict[str, Any]:
    """What the header of a raw log says of patches; nothing where there are none."""
    return {"patches": [one._asdict() for one in placed]} if placed else {}


def _extent(board: Any) -> Vector:
    extent = board.bounding_box.extent
    return extent.x, extent.y, extent.z


def _spawn(
    session: WorldSession,
    population: Population,
    patch: PatchSpec,
    blueprint: Any,
    taken: Any,
) -> Optional[Tuple[Any, Optional[Any]]]:
    """The board and who carries it, or None if there is no room.

    How large a board is, only the spawned one tells: it is made high above the town first.
    """
    high = session.map.get_spawn_points()[0].location + carla.Location(z=300.0)
    model = session.try_spawn(blueprint, carla.Transform(high))
    if model is None:
        return None
    box, extent = model.bounding_box.location, _extent(model)
    session.client.apply_batch_sync([carla.command.DestroyActor(model.id)], False)
    middle = (box.x, box.y, box.z)
    for pose in _poses(session, population, patch, extent, taken):
        transform = _transform(pose, middle, extent)
        board = session.try_spawn(blueprint, transform, pose.parent)
        if board is not None:
            return board, pose.parent
    return None


def _poses(
    session: WorldSession, population: Population, patch: PatchSpec, extent: Vector, taken: Any
) -> Iterator[_Pose]:
    """Poses to try, the best first."""
    half_m = extent[board_face(extent).up]
    if patch.target not in (BILLBOARD, SHOP_FRONT):
        yield from _carried(population, patch, taken)
        return
    start = session.map.get_waypoint(population.ego.get_location())
    for more_m in TRIES_M:
        ahead_m = patch.distance_m + more_m
        places = start.next(ahead_m) if ahead_m > 0.0 else []
        if not places or places[0].is_junction:
            continue
        if patch.target == BILLBOARD:
            yield _beside_road(session, places[0], patch.side, half_m)
        else:
            wall = _on_wall(session, places[0], patch.side, half_m)
            if wall is not None:
                yield wall


def _right(transform: Any, side: str) -> Tuple[float, float]:
    """Unit vector across the road towards a side."""
    yaw = math.radians(transform.rotation.yaw)
    sign = 1.0 if side == "right" else -1.0
    return -math.sin(yaw) * sign, math.cos(yaw) * sign


def _beside_road(session: WorldSession, place: Any, side: str, half_m: float) -> _Pose:
    at, (x, y) = place.transform.location, _right(place.transform, side)
    away_m = 0.5 * float(place.lane_width)
    while away_m < WIDEST_M:
        spot = carla.Location(at.x + x * away_m, at.y + y * away_m, at.z)
        lane = session.map.get_waypoint(spot, False, carla.LaneType.Any)
        if lane is None or lane.lane_type == carla.LaneType.Sidewalk:
            break
        away_m += STEP_M
    away_m += BESIDE_M
    ground = carla.Location(at.x + x * away_m, at.y + y * away_m, at.z + 2.0)
    met = session.world.ground_projection(ground, 10.0)
    z = at.z if met is None else met.location.z
    turn = TURNED_DEG if side == "right" else -TURNED_DEG
    yaw_deg = place.transform.rotation.yaw + 180.0 + turn
    return _Pose((ground.x, ground.y, z + half_m + 0.05), yaw_deg, None)


def _on_wall(session: WorldSession, place: Any, side: str, half_m: float) -> Optional[_Pose]:
    """On the building beside the road, if there is one, along its wall."""
    at, (x, y) = place.transform.location, _right(place.transform, side)
    height_m = SHOP_BOTTOM_M + half_m
    met = []
    for along_m in (-0.8, 0.8):
        start = carla.Location(
            at.x - abs(along_m) / along_m * y * 0.8,
            at.y + abs(along_m) / along_m * x * 0.8,
            at.z + height_m,
        )
        hit = session.world.project_point(start, carla.Vector3D(x, y, 0.0), CAST_M)
        if hit is None or hit.label != carla.CityObjectLabel.Buildings:
            return None
        met.append(hit.location)
    first, second = met
    wall_x, wall_y = second.x - first.x, second.y - first.y
    length = math.hypot(wall_x, wall_y)
    if length < 0.1 or length > 2.5:
        return None
    nx, ny = wall_y / length, -wall_x / length
    if nx * x + ny * y > 0.0:
        nx, ny = -nx, -ny
    middle_x, middle_y = 0.5 * (first.x + second.x), 0.5 * (first.y + second.y)
    center = (middle_x + nx * WALL_M, middle_y + ny * WALL_M, at.z + height_m)
    return _Pose(center, math.degrees(math.atan2(ny, nx)), None)


def _carried(population: Population, patch: PatchSpec, taken: Any) -> Iterator[_Pose]:
    """On the rear of a vehicle, or before the chest of a person; the best first."""
    rear = patch.target == VEHICLE_REAR
    if rear:
        actors = [
            vehicle
            for vehicle in population.vehicles
            if 2.0 * vehicle.bounding_box.extent.y >= LEAST_WIDTH_M
        ]
    else:
        actors = [walker.actor for walker in population.walkers]
    ego = population.ego.get_transform()
    forward = ego.get_forward_vector()

    def off_m(actor: Any) -> Tuple[float, int]:
        at = actor.get_location()
        x, y = at.x - ego.location.x, at.y - ego.location.y
        ahead = x * forward.x + y * forward.y > 0.0
        return (
            abs(math.hypot(x, y) - patch.distance_m) + (0.0 if ahead else 1000.0),
            int(actor.id),
        )

    for actor in sorted(actors, key=off_m):
        if actor.id in taken:
            continue
        box = actor.bounding_box
        if rear:
            center = (box.location.x - box.extent.x - REAR_M, box.location.y, box.location.z)
            yield _Pose(center, 180.0, actor)
        else:
            height_m = box.location.z + 0.25 * box.extent.z
            center = (box.location.x + box.extent.x + CHEST_M, box.location.y, height_m)
            yield _Pose(center, 0.0, actor)


def _transform(pose: _Pose, middle: Vector, extent: Vector) -> Any:
    """Of a board whose front looks along a yaw, its picture upright, its box around a place."""
    thin = board_face(extent).thin
    if thin == 0:
        rotation = carla.Rotation(yaw=pose.yaw_deg)
    elif thin == 1:
        rotation = carla.Rotation(yaw=pose.yaw_deg - 90.0)
    else:
        rotation = carla.Rotation(pitch=90.0, yaw=pose.yaw_deg + 180.0)
    turn = carla.Transform(carla.Location(), rotation)
    x, y, z = turn.get_forward_vector(), turn.get_right_vector(), turn.get_up_vector()
    a, b, c = middle
    return carla.Transform(
        carla.Location(
            pose.center[0] - a * x.x - b * y.x - c * z.x,
            pose.center[1] - a * x.y - b * y.y - c * z.y,
            pose.center[2] - a * x.z - b * y.z - c * z.z,
        ),
        rotation,
    )


def _texture(patch: PatchSpec, extent: Vector) -> Any:
    """A board's texture: plain, and the picture at its place if it is shown.

    Row 0 of a texture is the lowest, as CARLA's own ``apply_texture.py`` has it.
    """
    place = patch_place(patch, extent)
    ground = carla.Color(GROUND[0], GROUND[1], GROUND[2], 255)
    texture = carla.TextureColor(place.columns, place.rows)
    picture = patch.picture
    rgb = picture.pixels() if patch.is_shown else b""
    for column in range(place.columns):
        inside_x = place.left <= column < place.left + place.width
        from_x = (column - place.left) * picture.width // place.width
        for row in range(place.rows):
            colour = ground
            if rgb and inside_x and place.low <= row < place.low + place.height:
                from_y = (place.low + place.height - 1 - row) * picture.height // place.height
                at = 3 * (from_y * picture.width + from_x)
                colour = carla.Color(rgb[at], rgb[at + 1], rgb[at + 2], 255)
            texture.set(column, row, colour)
    return texture
