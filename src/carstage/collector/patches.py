"""Patches: boards beside the road, on walls, on vehicles and people, and the pictures on them.

A board is a prop of the server's catalogue. Its texture is applied by name, as CARLA's client does
it: the name of a prop is the one that the server lists since it was spawned. Boards are the same
whether their pictures are shown or not, so that nothing but colours differs between the two.
"""

from __future__ import annotations

import logging
import math
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

import carla

from carstage.collector.actors import find_blueprint
from carstage.collector.patch_carriers import (
    Carriers,
    beyond_road,
    large_vehicles,
    places_ahead,
    to_side,
)
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

BESIDE_M = 0.3
"""Between a billboard and the road's edge."""
TURNED_DEG = 20.0
"""A billboard is turned that far towards the road."""
CAST_M = 45.0
WALL_M = 0.08
"""Between a wall and the board on it."""
WALL_ALONG = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Where a wall is looked for, as shares of half a board."""
RECESS_M = 0.8
"""Parts of a wall may be so far behind what is foremost: windows and doors."""
STEEPEST = 1.0
"""Of a wall to the road: 45 degrees."""
SHOP_BOTTOM_M = 1.6
"""Of the board on a wall, above the ground."""
REAR_M = 0.05
CHEST_M = 0.12
"""Between a vehicle's rear, or a person, and the board."""

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
    session: WorldSession, spec: EpisodeSpec, population: Population, carriers: Carriers
) -> List[PlacedPatch]:
    """Spawn the boards of an episode and put the pictures on them.

    What finds no place is left out, and logged.

    Args:
        session: the episode's world; everybody is in its newest frame.
        spec: the episode.
        population: who was spawned.
        carriers: who was put where the ego will see them; other patches that are carried get the
            nearest to where they are wanted.

    Raises:
        SceneError: the server lacks a board.
    """
    placed: List[PlacedPatch] = []
    for number, patch in enumerate(spec.patches):
        path = "patches[%d].board" % number
        blueprint = find_blueprint(session.world.get_blueprint_library(), patch.board, path)
        known = set(session.world.get_names_of_all_objects())
        taken = {one.target_id for one in placed}
        taken |= {actor.id for name, actor in carriers.items() if name != patch.name}
        own = carriers.get(patch.name)
        found = _spawn(session, population, patch, blueprint, taken, own)
        if found is None:
            _log.warning("%s: no place for a patch on a %s", patch.name, patch.target)
            continue
        board, parent = found
        session.destroy_on_exit("board %d" % board.id, board)
        if parent is not None and hasattr(board, "set_collisions"):  # not before 0.9.15
            board.set_collisions(False)  # else it pushes who carries it
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
    taken: Set[int],
    own: Optional[Any],
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
    for pose in _poses(session, population, patch, extent, taken, own):
        transform = _transform(pose, middle, extent)
        board = session.try_spawn(blueprint, transform, pose.parent)
        if board is not None:
            return board, pose.parent
    return None


def _poses(
    session: WorldSession,
    population: Population,
    patch: PatchSpec,
    extent: Vector,
    taken: Set[int],
    own: Optional[Any],
) -> Iterator[_Pose]:
    """Poses to try, the best first."""
    if patch.target not in (BILLBOARD, SHOP_FRONT):
        nearest = _nearest(population, patch, taken)
        for actor in nearest if own is None else [own, *nearest]:
            yield _carried(patch, actor)
        return
    start = session.map.get_waypoint(population.ego.get_location())
    for place in places_ahead(start, patch.distance_m):
        if patch.target == BILLBOARD:
            yield _beside_road(session, place, patch.side, extent)
        else:
            wall = _on_wall(session, place, patch.side, extent)
            if wall is not None:
                yield wall


def _beside_road(session: WorldSession, place: Any, side: str, extent: Vector) -> _Pose:
    face = board_face(extent)
    at, (x, y) = place.transform.location, to_side(place.transform, side)
    away_m = beyond_road(session, place, side)[0] + BESIDE_M + extent[face.across]
    ground = carla.Location(at.x + x * away_m, at.y + y * away_m, at.z + 2.0)
    met = session.world.ground_projection(ground, 10.0)
    z = at.z if met is None else met.location.z
    turn = TURNED_DEG if side == "right" else -TURNED_DEG
    yaw_deg = place.transform.rotation.yaw + 180.0 + turn
    return _Pose((ground.x, ground.y, z + extent[face.up] + 0.05), yaw_deg, None)


def _on_wall(session: WorldSession, place: Any, side: str, extent: Vector) -> Optional[_Pose]:
    """On the building beside the road, if there is one, touching what of its wall is foremost."""
    face = board_face(extent)
    half_m = extent[face.up]
    at, (x, y) = place.transform.location, to_side(place.transform, side)
    met: List[Tuple[float, float]] = []
    for along in WALL_ALONG:
        for up in (-1.0, 0.0, 1.0):
            along_m, height_m = along * extent[face.across], SHOP_BOTTOM_M + half_m + up * half_m
            start = carla.Location(at.x - y * along_m, at.y + x * along_m, at.z + height_m)
            hit = session.world.project_point(start, carla.Vector3D(x, y, 0.0), CAST_M)
            if hit is None or hit.label != carla.CityObjectLabel.Buildings:
                return None
            away_m = (hit.location.x - at.x) * x + (hit.location.y - at.y) * y
            met.append((along_m, away_m))
    found = _foremost(met)
    if found is None:
        return None
    away_m, slope = found
    away_m -= WALL_M * math.hypot(1.0, slope)
    yaw = math.atan2(slope * x - y, -slope * y - x)
    center = (at.x + x * away_m, at.y + y * away_m, at.z + SHOP_BOTTOM_M + half_m)
    return _Pose(center, math.degrees(yaw), None)


def _foremost(met: Sequence[Tuple[float, float]]) -> Optional[Tuple[float, float]]:
    """The line before a wall that touches it on both sides of the middle.

    Args:
        met: places of the wall seen from the road: along it, and how far away, m.

    Returns:
        How far away the line is in the middle, and by how much that grows along it; None if the
        wall is no plane: parts of it are far behind, or it is steep.
    """
    for one in met:
        for other in met:
            if one[0] > 0.0 or other[0] <= 0.0:
                continue
            slope = (other[1] - one[1]) / (other[0] - one[0])
            behind = [away - one[1] - slope * (along - one[0]) for along, away in met]
            if min(behind) >= -1e-6:
                is_wall = max(behind) <= RECESS_M and abs(slope) <= STEEPEST
                return (one[1] - slope * one[0], slope) if is_wall else None
    return None


def _nearest(population: Population, patch: PatchSpec, taken: Set[int]) -> List[Any]:
    """Vehicles, or people, from the nearest to where a patch is wanted on; ahead of the ego first.

    A vehicle whose rear looks away from the ego comes after those whose rear does not.
    """
    rear = patch.target == VEHICLE_REAR
    actors = large_vehicles(population) if rear else [one.actor for one in population.walkers]
    ego = population.ego.get_transform()
    forward = ego.get_forward_vector()

    def order(actor: Any) -> Tuple[bool, bool, float, int]:
        at, heading = actor.get_location(), actor.get_transform().get_forward_vector()
        x, y = at.x - ego.location.x, at.y - ego.location.y
        behind = x * forward.x + y * forward.y <= 0.0
        away = rear and x * heading.x + y * heading.y <= 0.0
        return behind, away, abs(math.hypot(x, y) - patch.distance_m), int(actor.id)

    return sorted((actor for actor in actors if actor.id not in taken), key=order)


def _carried(patch: PatchSpec, actor: Any) -> _Pose:
    """On the rear of a vehicle, or before the chest of a person."""
    box = actor.bounding_box
    if patch.target == VEHICLE_REAR:
        center = (box.location.x - box.extent.x - REAR_M, box.location.y, box.location.z)
        return _Pose(center, 180.0, actor)
    height_m = box.location.z + 0.25 * box.extent.z
    center = (box.location.x + box.extent.x + CHEST_M, box.location.y, height_m)
    return _Pose(center, 0.0, actor)


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
