"""Calls about single sensors: ROS publication, G-buffers, V2X."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.wire.token import stream_token

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
def _get_gbuffer_token(call: Call, actor_id: int, _buffer: int) -> bytes:
    """A stream that stays silent: there are no G-buffers."""
    call.world.live_or_dead(actor_id)
    return stream_token(call.world.take_stream_id(), call.session.streaming_port)


@handles_void("enable_gbuffers")
def _enable_gbuffers(call: Call, actor_id: int, _enabled: bool) -> None:
    call.world.live_or_dead(actor_id)


@handles("are_gbuffers_enabled")
def _are_gbuffers_enabled(call: Call, actor_id: int) -> bool:
    call.world.live_or_dead(actor_id)
    return False


@handles_void("send")
def _send(call: Call, actor_id: int, *_message: Any) -> None:
    """V2X messages reach nobody."""
    call.world.live_or_dead(actor_id)
