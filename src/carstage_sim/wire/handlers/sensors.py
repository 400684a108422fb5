"""Calls about single sensors: ROS publication, G-buffers, V2X."""

from __future__ import annotations

from carstage_sim.sensors.gbuffers import GBUFFERS
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.wire.streaming import SENSORS_SUBSCRIBED_WITHIN_S
from carstage_sim.wire.token import stream_token
from carstage_sim.world.actors import Actor
from carstage_sim.world.transmissions import CUSTOM_SENSOR, LONGEST_TEXT

_LARGEST_ID = 2**32 - 1


@handles_void("enable_sensor_for_ros", "disable_sensor_for_ros")
def _sensor_for_ros(_call: Call, _stream_id: int) -> None:
    """Nothing is published to ROS."""


@handles("is_sensor_enabled_for_ros")
def _is_sensor_enabled_for_ros(_call: Call, _stream_id: int) -> bool:
    return False


@handles_void("set_ignored_vehicles")
def _set_ignored_vehicles(call: Call, actor_id: int, ignored: list[int]) -> None:
    sensor = call.world.live_or_dead(actor_id)
    sensor.ignored = frozenset(one for one in map(int, ignored) if 0 < one <= _LARGEST_ID)


@handles("get_gbuffer_token")
def _get_gbuffer_token(call: Call, actor_id: int, buffer: int) -> bytes:
    """The stream of one of a camera's buffers; the same for all who ask."""
    camera = _camera(call, actor_id)
    if buffer not in GBUFFERS:
        raise CallError(f"{buffer} is no G-buffer: 0 to {max(GBUFFERS)}")
    if buffer not in camera.gbuffers:
        camera.gbuffers[buffer] = call.world.take_stream_id()
    stream_id = camera.gbuffers[buffer]
    call.session.expect_subscriber(stream_id, SENSORS_SUBSCRIBED_WITHIN_S, call.connection)
    return stream_token(stream_id, call.session.streaming_port)


def _camera(call: Call, actor_id: int) -> Actor:
    actor = call.world.live_or_dead(actor_id)
    if not actor.type_id.startswith("sensor.camera."):
        raise CallError(f"actor {actor_id} is no camera: it has no G-buffers")
    return actor


@handles_void("enable_gbuffers")
def _enable_gbuffers(call: Call, actor_id: int, _enabled: bool) -> None:
    """Those that somebody listens to are sent, enabled or not."""
    _camera(call, actor_id)


@handles("are_gbuffers_enabled")
def _are_gbuffers_enabled(call: Call, actor_id: int) -> bool:
    return bool(_camera(call, actor_id).gbuffers)


@handles_void("send")
def _send(call: Call, actor_id: int, message: str) -> None:
    """A V2X sensor sends a client's text in the next tick."""
    sensor = call.world.live_or_dead(actor_id)
    if sensor.type_id != CUSTOM_SENSOR:
        raise CallError(f"actor {actor_id} is {sensor.type_id}: only {CUSTOM_SENSOR} sends texts")
    size = len(message.encode("utf-8", "surrogateescape"))
    if size > LONGEST_TEXT:
        raise CallError(f"a V2X message has {LONGEST_TEXT} bytes at most, not {size}")
    call.world.v2x.send(actor_id, message)
