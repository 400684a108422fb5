"""Structs of the protocol as msgpack values: arrays of fields in declaration order.

Decoders take what clients send; encoders give the longest form of all versions, because clients
ignore fields that they do not know.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import BakeOptions
from carstage_sim.maps.town import OrientedBox
from carstage_sim.wire.dialect import Dialect
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.rpc import shortened
from carstage_sim.wire.token import stream_token
from carstage_sim.world.actors import Actor
from carstage_sim.world.blueprints import AttributeType, Blueprint
from carstage_sim.world.controls import (
    AckermannControl,
    EpisodeSettings,
    VehicleControl,
    WalkerControl,
)
from carstage_sim.world.pose import Pose, Vector3
from carstage_sim.world.signals.traffic_lights import TrafficLightState
from carstage_sim.world.state import Weather

Value = list[Any]

_LONGEST_STEP_S = 60.0
_MOST_SUBSTEPS = 1000
_LARGEST = 1e9


def finite(*numbers: float) -> tuple[float, ...]:
    """Numbers that the world may compute with.

    One NaN would spread to whatever the actor meets, and stays in the world for good; so would a
    number whose square single precision cannot hold.

    Raises:
        CallError: one is not a number, infinite, or beyond 1e9.
    """
    for number in numbers:
        if not -_LARGEST <= number <= _LARGEST:
            raise CallError(f"numbers must be finite and at most {_LARGEST:g}, got {numbers}")
    return tuple(map(float, numbers))


def vector(value: Sequence[float]) -> Vector3:
    """A ``Vector3D`` or ``Location``."""
    x, y, z = value
    # As :func:`finite`, which would take twice as long: a batch holds hundreds of these.
    if -_LARGEST <= x <= _LARGEST and -_LARGEST <= y <= _LARGEST and -_LARGEST <= z <= _LARGEST:
        return (float(x), float(y), float(z))
    x, y, z = finite(x, y, z)
    return (x, y, z)


def pose(value: Sequence[Sequence[float]]) -> Pose:
    """A ``Transform``."""
    location, rotation = value
    return Pose(vector(location), vector(rotation))


def encode_pose(value: Pose) -> Value:
    """A ``Transform``."""
    return [list(value.location), list(value.rotation_deg)]


def bounding_box(center: Vector3, extent: Vector3, rotation_deg: Vector3, actor_id: int) -> Value:
    """A ``BoundingBox``; clients before 0.9.16 ignore the id."""
    return [list(center), list(extent), list(rotation_deg), actor_id]


def encode_box(box: OrientedBox, actor_id: int = 0) -> Value:
    """A ``BoundingBox`` of a box in the world."""
    return bounding_box(box.center, box.extent, box.rotation_deg, actor_id)


def encode_actor_box(actor: Actor) -> Value:
    """A ``BoundingBox`` in the actor's frame."""
    return bounding_box(actor.box_center, actor.box_extent, (0.0, 0.0, 0.0), actor.actor_id)


def encode_definition(blueprint: Blueprint, dialect: Dialect) -> Value:
    """An ``ActorDefinition``."""
    attributes = [
        [
            attribute.id,
            attribute.type + dialect.attribute_type_base,
            attribute.value,
            list(attribute.recommended),
            attribute.modifiable,
            attribute.restrict,
        ]
        for attribute in blueprint.attributes
    ]
    return [blueprint.uid, blueprint.id, blueprint.tags, attributes]


def encode_actor(actor: Actor, dialect: Dialect, streaming_port: int) -> Value:
    """An ``Actor``: description, box, tags and, for sensors, the token of its stream."""
    types = (
        {attribute.id: attribute.type for attribute in actor.blueprint.attributes}
        if actor.blueprint is not None
        else {}
    )
    attributes = [
        [key, types.get(key, AttributeType.STRING) + dialect.attribute_type_base, value]
        for key, value in actor.attributes.items()
    ]
    uid = actor.blueprint.uid if actor.blueprint is not None else 0
    tags = bytes(map(dialect.label, actor.semantic_tags))
    token = stream_token(actor.stream_id, streaming_port) if actor.stream_id else b""
    return [
        actor.actor_id,
        actor.parent_id,
        [uid, actor.type_id, attributes],
        encode_actor_box(actor),
        tags,
        token,
    ]


def encode_scenery(label: int, dialect: Dialect) -> Value:
    """An ``Actor`` for a part of the town: id 0 and a type id from its label, as CARLA makes it up.

    CARLA's ``CarlaGetRelevantTagAsString``: the label in lower case, without a plural's ``s``.
    """
    name = CityObjectLabel(label).name.replace("_", "").lower().removesuffix("s")
    if label in (CityObjectLabel.NONE, CityObjectLabel.OTHER):
        name = "unknown"
    nowhere = (0.0, 0.0, 0.0)
    box = bounding_box(nowhere, nowhere, nowhere, 0)
    return [0, 0, [0, f"static.{name}", []], box, bytes([dialect.label(label)]), b""]


def description(value: Sequence[Any]) -> tuple[str, dict[str, str]]:
    """Type id and attribute values of an ``ActorDescription``."""
    _uid, type_id, attributes = value
    return str(type_id), {str(name): str(text) for name, _type, text in attributes}


def vehicle_control(value: Sequence[Any]) -> VehicleControl:
    """A ``VehicleControl``; the dynamics bound its numbers, and take NaN for 0."""
    throttle, steer, brake, hand_brake, reverse, manual, gear = value
    return VehicleControl(
        float(throttle),
        float(steer),
        float(brake),
        bool(hand_brake),
        bool(reverse),
        bool(manual),
        int(gear),
    )


def light_flags(value: int) -> int:
    """The bits of a ``VehicleLightState``."""
    return int(value) & 0xFFFF_FFFF


def traffic_light_state(value: int) -> int:
    """A ``TrafficLightState``."""
    if not 0 <= value <= max(TrafficLightState):
        raise CallError(f"there is no state {shortened(value)} of a traffic light: 0 to 4")
    return value


def colour(value: Sequence[int]) -> tuple[int, int, int]:
    """A ``Color``; alpha, where there is one, has no meaning here."""
    red, green, blue = (min(max(int(part), 0), 255) for part in value[:3])
    return red, green, blue


def texels(texture: Sequence[Any], *, full: float) -> NDArray[np.float32]:
    """``(H, W, 3)`` float32 linear colours of a ``Texture``.

    Args:
        texture: width, height, pixels of red, green, blue, alpha.
        full: value of full brightness; 8-bit values (255) are sRGB, floats (1) are linear.

    Raises:
        CallError: not as many pixels as the size says, or none, or not numbers.
    """
    width, height, pixels = texture
    if not pixels or min(width, height) < 1 or len(pixels) != width * height:
        raise CallError(f"a texture of {width} x {height} has not {len(pixels)} pixels")
    values = np.array(pixels, np.float64)[:, :3] / full
    if not np.isfinite(values).all():
        raise CallError("a texture must consist of finite numbers")
    linear = values if full == 1.0 else np.clip(values, 0.0, 1.0) ** 2.2
    return np.clip(linear, 0.0, 1e3).astype(np.float32).reshape(height, width, 3)


def ackermann_control(value: Sequence[float]) -> AckermannControl:
    """A ``VehicleAckermannControl``."""
    steer, steer_speed, speed, acceleration, jerk = finite(*value)
    return AckermannControl(steer, steer_speed, speed, acceleration, jerk)


def walker_control(value: Sequence[Any]) -> WalkerControl:
    """A ``WalkerControl``."""
    direction, speed, jump = value
    (speed,) = finite(speed)
    return WalkerControl(vector(direction), speed, bool(jump))


def weather(value: Sequence[float]) -> Weather:
    """``WeatherParameters``, of any version's length."""
    return Weather(*finite(*value[: len(fields(Weather))]))


def encode_weather(value: Weather) -> Value:
    """``WeatherParameters``."""
    return [getattr(value, field.name) for field in fields(Weather)]


def settings(value: Sequence[Any]) -> EpisodeSettings:
    """``EpisodeSettings``, of any version's length.

    Raises:
        CallError: a value of another kind than its field, or a step that no tick can take.
    """
    names = [field.name for field in fields(EpisodeSettings)]
    given = dict(zip(names, value, strict=False))
    fixed, *step = given.pop("fixed_delta_seconds")
    step_s = _step(*step) if fixed else None
    like = EpisodeSettings()
    others: dict[str, Any] = {
        name: _like(name, getattr(like, name), setting) for name, setting in given.items()
    }
    decoded = EpisodeSettings(fixed_delta_seconds=step_s, **others)
    if not 0 <= decoded.max_substeps <= _MOST_SUBSTEPS:
        raise CallError(f"max_substeps must be 0 to {_MOST_SUBSTEPS}, got {decoded.max_substeps}")
    return decoded


def _step(value: float) -> float:
    (step_s,) = finite(value)
    if not 0.0 <= step_s <= _LONGEST_STEP_S:
        raise CallError(f"fixed_delta_seconds must be 0 to {_LONGEST_STEP_S:g}, got {step_s:g}")
    return step_s


def _like(name: str, default: bool | float, value: Any) -> bool | float:
    """A setting of the type of its default, because it goes back to clients, which want that."""
    if isinstance(default, bool) or isinstance(value, bool):
        if type(default) is not type(value):
            raise CallError(f"{name} cannot be {shortened(value)}")
        return bool(value)
    (number,) = finite(value)
    return int(number) if isinstance(default, int) else number


def bake_options(value: Sequence[Any]) -> BakeOptions:
    """``OpendriveGenerationParameters``: what counts here of its seven fields.

    The mesh follows the roads by itself, junctions are always closed and smooth, and the ground is
    always seen, so the fields about these change nothing.
    """
    _, _, wall_height, _, _, _, enable_pedestrian_navigation = value[:7]
    (wall_height_m,) = finite(wall_height)
    return BakeOptions(
        scenery=False,
        navigation=bool(enable_pedestrian_navigation),
        wall_height_m=max(wall_height_m, 0.0),
    )


def encode_settings(value: EpisodeSettings) -> Value:
    """``EpisodeSettings``."""
    encoded = [getattr(value, field.name) for field in fields(EpisodeSettings)]
    encoded[2] = encode_optional(value.fixed_delta_seconds)
    return encoded


def duration(seconds: float) -> float:
    """Seconds that something lasts.

    Raises:
        CallError: negative, or no number.
    """
    (seconds,) = finite(seconds)
    if seconds < 0.0:
        raise CallError(f"nothing lasts {seconds:g} s")
    return seconds


def optional(value: Sequence[Any]) -> Any:
    """The content of an ``optional`` or None."""
    return value[1] if value[0] else None


def encode_optional(value: Any) -> Value:
    """An ``optional``."""
    return [False] if value is None else [True, value]
