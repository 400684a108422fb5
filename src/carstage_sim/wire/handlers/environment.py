"""Weather, scenery, ray queries, street lights, debug drawing."""

from __future__ import annotations

from typing import Any

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import LevelObject
from carstage_sim.wire import values
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.world.pose import Pose
from carstage_sim.world.traffic_light_actors import head_box

_ANY_LABEL = 255


@handles("get_weather_parameters")
def _get_weather_parameters(call: Call) -> list[Any]:
    return values.encode_weather(call.world.weather)


@handles_void("set_weather_parameters")
def _set_weather_parameters(call: Call, weather: list[float]) -> None:
    call.world.weather = values.weather(weather)


def _level_objects(call: Call, label: int) -> list[LevelObject]:
    """The scenery of a label, which is one of the dialect's."""
    objects, number = call.world.town.level_objects, call.session.dialect.label
    return [piece for piece in objects if label in (_ANY_LABEL, number(piece.label))]


@handles("get_names_of_all_objects")
def _get_names_of_all_objects(call: Call) -> list[str]:
    return [piece.name for piece in call.world.town.level_objects]


@handles("get_all_level_BBs")
def _get_all_level_bbs(call: Call, label: int) -> list[Any]:
    boxes = [values.encode_box(piece.box) for piece in _level_objects(call, label)]
    if label in (_ANY_LABEL, CityObjectLabel.TRAFFIC_LIGHT):
        lights = zip(call.world.town.traffic_lights, call.world.light_ids, strict=True)
        boxes += [values.encode_box(head_box(site), actor_id) for site, actor_id in lights]
    return boxes


@handles("get_environment_objects")
def _get_environment_objects(call: Call, label: int) -> list[Any]:
    return [
        [
            values.encode_pose(Pose(piece.box.center, piece.box.rotation_deg)),
            values.encode_box(piece.box),
            piece.object_id,
            piece.name,
            call.session.dialect.label(piece.label),
        ]
        for piece in _level_objects(call, label)
    ]


@handles_void("enable_environment_objects")
def _enable_environment_objects(_call: Call, _object_ids: list[int], _enabled: bool) -> None:
    """Scenery is baked into one mesh and stays visible."""


@handles("project_point")
def _project_point(
    call: Call, origin: list[float], direction: list[float], range_m: float
) -> list[Any]:
    start = values.vector(origin)
    end = tuple(o + d * range_m for o, d in zip(start, values.vector(direction), strict=True))
    hits = call.world.cast_ray(start, values.vector(end))
    if not hits:
        return [False, [[0.0, 0.0, 0.0], 0]]
    location, label = hits[0]
    return [True, [list(location), call.session.dialect.label(label)]]


@handles("cast_ray")
def _cast_ray(call: Call, start: list[float], end: list[float]) -> list[Any]:
    hits = call.world.cast_ray(values.vector(start), values.vector(end))
    number = call.session.dialect.label
    return [[list(location), number(label)] for location, label in hits]


@handles("query_lights_state")
def _query_lights_state(_call: Call, _client: str) -> list[Any]:
    """Street lamps are scenery here, none can be switched."""
    return []


@handles_void("update_lights_state", "update_day_night_cycle")
def _update_lights(_call: Call, *_arguments: Any) -> None:
    """No lamps to switch."""


@handles_void("draw_debug_shape", "clear_debug_shape", "clear_debug_string")
def _debug_drawing(_call: Call, *_arguments: Any) -> None:
    """There is no window to draw in; sensors never see debug shapes."""


@handles_void("apply_color_texture_to_objects", "apply_float_color_texture_to_objects")
def _apply_texture(_call: Call, *_arguments: Any) -> None:
    """Surfaces are procedural and take no textures."""


@handles("get_imui_gravity")
def _get_imui_gravity(call: Call) -> float:
    return call.simulation.imu_gravity


@handles_void("set_imui_gravity")
def _set_imui_gravity(call: Call, gravity: float) -> None:
    (call.simulation.imu_gravity,) = values.finite(gravity)


@handles_void("set_annotations_traverse_translucency")
def _set_annotations_traverse_translucency(_call: Call, _enabled: bool) -> None:
    """Annotations always stop at the first surface."""
