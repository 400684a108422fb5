"""Weather, scenery and its looks, ray queries."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import LevelObject, OrientedBox
from carstage_sim.wire import values
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.wire.scenery import light_heads, light_masts, sign_faces
from carstage_sim.world.blueprints.props import has_shape
from carstage_sim.world.pictures import PlacedPicture, reduced
from carstage_sim.world.pose import Pose, Vector3, compose
from carstage_sim.world.signals.traffic_light_actors import head_boxes
from carstage_sim.world.state import ActorKind

_ANY_LABEL = 255
_SHORTEST_DIRECTION = 1e-4
"""What is shorter points nowhere (Unreal's ``FVector::GetSafeNormal``)."""
_DIFFUSE, _EMISSIVE = 2, 3
"""Of ``carla.MaterialParameter``; the others say how a surface is rough or bumpy."""


@handles("get_weather_parameters")
def _get_weather_parameters(call: Call) -> list[Any]:
    return values.encode_weather(call.world.weather)


@handles_void("set_weather_parameters")
def _set_weather_parameters(call: Call, weather: list[float]) -> None:
    call.world.set_weather(values.weather(weather))


def _level_objects(call: Call, label: int) -> list[LevelObject]:
    """The scenery of a label, which is one of the dialect's; signs by their faces."""
    town, number = call.world.town, call.session.dialect.label
    chosen = [p for p in town.level_objects if label in (_ANY_LABEL, number(p.label))]
    faces: dict[int, OrientedBox] = {}
    if any(piece.label == CityObjectLabel.TRAFFIC_SIGNS for piece in chosen):
        faces = sign_faces(town.static_mesh, town.level_objects)
    return [replace(piece, box=faces.get(piece.object_id, piece.box)) for piece in chosen]


@handles("get_names_of_all_objects")
def _get_names_of_all_objects(call: Call) -> list[str]:
    return [*(piece.name for piece in call.world.town.level_objects), *_props(call)]


@handles("get_all_level_BBs")
def _get_all_level_bbs(call: Call, label: int) -> list[Any]:
    """Boxes of loaded scenery, parts of lights, vehicles and walkers, in the world."""
    pieces = filter(call.world.objects.is_loaded, _level_objects(call, label))
    boxes = [values.encode_box(piece.box) for piece in pieces]
    sites = call.world.town.traffic_lights
    if label in (_ANY_LABEL, call.session.dialect.label(CityObjectLabel.TRAFFIC_LIGHT)):
        boxes += [
            values.encode_box(box, actor_id)
            for site, actor_id in zip(sites, call.world.light_ids, strict=True)
            for box in head_boxes(site)
        ]
    if label in (_ANY_LABEL, call.session.dialect.label(CityObjectLabel.POLES)):
        masts = zip(light_masts(sites), call.world.light_ids, strict=True)
        boxes += [values.encode_box(mast.box, actor_id) for mast, actor_id in masts]
    for kind in (ActorKind.VEHICLE, ActorKind.WALKER):
        for actor in call.world.actors.of_kind(kind):
            if label in (_ANY_LABEL, call.session.dialect.label(actor.semantic_tags[0])):
                pose = call.world.actors.pose(actor.actor_id)
                center = compose(pose, Pose(actor.box_center)).location
                boxes.append(
                    values.bounding_box(center, actor.box_extent, pose.rotation_deg, actor.actor_id)
                )
    return boxes


@handles("get_environment_objects")
def _get_environment_objects(call: Call, label: int) -> list[Any]:
    """Scenery, and what traffic lights are made of, as ``ObjectRegister.cpp`` has it."""
    number, sites = call.session.dialect.label, call.world.town.traffic_lights
    pieces = list(filter(call.world.objects.is_loaded, _level_objects(call, label)))
    if label in (_ANY_LABEL, number(CityObjectLabel.TRAFFIC_LIGHT)):
        pieces += light_heads(sites)
    if label in (_ANY_LABEL, number(CityObjectLabel.POLES)):
        pieces += light_masts(sites)
    return [
        [
            values.encode_pose(Pose(piece.box.center, piece.box.rotation_deg)),
            values.encode_box(piece.box),
            piece.object_id,
            piece.name,
            number(piece.label),
        ]
        for piece in pieces
    ]


@handles_void("enable_environment_objects")
def _enable_environment_objects(call: Call, object_ids: list[int], enabled: bool) -> None:
    call.world.objects.enable(object_ids, bool(enabled))


@handles("project_point")
def _project_point(call: Call, origin: list[float], direction: list[float], range_m: float) -> Any:
    start, ahead = values.vector(origin), np.array(values.vector(direction))
    length = float(np.linalg.norm(ahead))
    # The length of a direction does not count, as in CARLA's ``RayTracer.cpp``.
    reach = range_m / length if length > _SHORTEST_DIRECTION else 0.0
    end = (np.array(start) + ahead * reach).tolist()

    def encode(hits: list[tuple[Vector3, int]]) -> list[Any]:
        if not hits:
            return [False, [[0.0, 0.0, 0.0], 0]]
        location, label = hits[0]
        return [True, [list(location), call.session.dialect.label(label)]]

    hits = call.simulation.segment_hits(start, values.vector(end), at_most=1)
    return call.once_done(hits, encode)


@handles("cast_ray")
def _cast_ray(call: Call, start: list[float], end: list[float]) -> Any:
    number = call.session.dialect.label
    return call.once_done(
        call.simulation.segment_hits(values.vector(start), values.vector(end)),
        lambda hits: [[list(location), number(label)] for location, label in hits],
    )


@handles_void("apply_color_texture_to_objects")
def _apply_color_texture(call: Call, names: list[str], parameter: int, texture: list[Any]) -> None:
    _apply(call, names, parameter, values.texels(texture, full=255.0))


@handles_void("apply_float_color_texture_to_objects")
def _apply_float_color_texture(
    call: Call, names: list[str], parameter: int, texture: list[Any]
) -> None:
    _apply(call, names, parameter, values.texels(texture, full=1.0))


def _apply(call: Call, names: list[str], parameter: int, texels: NDArray[np.float32]) -> None:
    """Put a texture on objects and props; of one colour, or of light, its mean is on all of it."""
    objects, props = call.world.objects, _props(call)
    found = objects.named(names)
    chosen = [props[name] for name in names if name in props]
    if not found and not chosen:
        raise CallError("unable to find Actor to apply the texture")
    red, green, blue = texels.mean(axis=(0, 1), dtype=np.float64).tolist()
    if parameter == _EMISSIVE:
        objects.apply_glow(found, (red, green, blue))
    elif parameter == _DIFFUSE:
        plain = bool((texels == texels[0, 0]).all())
        picture = reduced(texels)
        on_objects = {} if plain else _on_objects(call, found, picture)
        if plain:
            objects.apply_paint(found, (red, green, blue))
        try:
            objects.apply_pictures(on_objects, _on_props(call, chosen, picture))
        except ValueError as error:
            raise CallError(str(error)) from None


def _props(call: Call) -> dict[str, int]:
    """Ids of the props that are there, by the names that they have among a level's objects."""
    others = call.world.actors.of_kind(ActorKind.OTHER)
    shown = [actor for actor in others if has_shape(actor.type_id)]
    return {f"{actor.type_id}_{actor.actor_id}": actor.actor_id for actor in shown}


def _on_objects(
    call: Call, object_ids: list[int], picture: NDArray[np.float32]
) -> dict[int, PlacedPicture]:
    """A picture on the boxes of level objects, of signs on those of their faces."""
    boxes = {piece.object_id: piece.box for piece in _level_objects(call, _ANY_LABEL)}
    return {
        object_id: PlacedPicture(picture, box.center, rotation_matrix(box.rotation_deg), box.extent)
        for object_id, box in boxes.items()
        if object_id in object_ids
    }


def _on_props(
    call: Call, actor_ids: list[int], picture: NDArray[np.float32]
) -> dict[int, PlacedPicture]:
    found = {}
    for actor_id in actor_ids:
        actor = call.world.actors.get(actor_id)
        assert actor is not None  # its name was found among those that are there
        found[actor_id] = PlacedPicture(picture, actor.box_center, np.eye(3), actor.box_extent)
    return found


@handles("get_imui_gravity")
def _get_imui_gravity(call: Call) -> float:
    return call.simulation.imu_gravity


@handles_void("set_imui_gravity")
def _set_imui_gravity(call: Call, gravity: float) -> None:
    (call.simulation.imu_gravity,) = values.finite(gravity)


@handles_void("set_annotations_traverse_translucency")
def _set_annotations_traverse_translucency(_call: Call, _enabled: bool) -> None:
    """Annotations always stop at the first surface."""
