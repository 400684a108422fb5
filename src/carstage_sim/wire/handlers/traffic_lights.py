"""Traffic lights: states, durations, groups."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.world.errors import ActorTypeError
from carstage_sim.world.signals.traffic_light_actors import head_boxes
from carstage_sim.world.state import ActorKind


def _index(call: Call, actor_id: int) -> int:
    """Number of a traffic light.

    Raises:
        ActorNotFoundError: no such actor.
        ActorTypeError: it is no traffic light.
    """
    if call.world.live_or_dead(actor_id).kind is not ActorKind.TRAFFIC_LIGHT:
        raise ActorTypeError(actor_id)
    return call.world.light_index(actor_id)


@handles_void("set_traffic_light_state")
def _set_traffic_light_state(call: Call, actor_id: int, state: int) -> None:
    call.world.lights.set_state(_index(call, actor_id), values.traffic_light_state(state))


@handles_void("set_traffic_light_green_time")
def _set_traffic_light_green_time(call: Call, actor_id: int, duration_s: float) -> None:
    call.world.lights.set_times(_index(call, actor_id), green=values.duration(duration_s))


@handles_void("set_traffic_light_yellow_time")
def _set_traffic_light_yellow_time(call: Call, actor_id: int, duration_s: float) -> None:
    call.world.lights.set_times(_index(call, actor_id), yellow=values.duration(duration_s))


@handles_void("set_traffic_light_red_time")
def _set_traffic_light_red_time(call: Call, actor_id: int, duration_s: float) -> None:
    call.world.lights.set_times(_index(call, actor_id), red=values.duration(duration_s))


@handles_void("freeze_traffic_light")
def _freeze_traffic_light(call: Call, actor_id: int, frozen: bool) -> None:
    call.world.lights.freeze(_index(call, actor_id), bool(frozen))


@handles_void("freeze_all_traffic_lights")
def _freeze_all_traffic_lights(call: Call, frozen: bool) -> None:
    call.world.lights.freeze_all(bool(frozen))


@handles_void("reset_traffic_light_group")
def _reset_traffic_light_group(call: Call, actor_id: int) -> None:
    call.world.lights.reset_group(_index(call, actor_id))


@handles_void("reset_all_traffic_lights")
def _reset_all_traffic_lights(call: Call) -> None:
    call.world.lights.reset_all()


@handles("get_group_traffic_lights")
def _get_group_traffic_lights(call: Call, actor_id: int) -> list[int]:
    group = call.world.lights.group(_index(call, actor_id))
    return [call.world.light_ids[index] for index in group]


@handles("get_light_boxes")
def _get_light_boxes(call: Call, actor_id: int) -> list[Any]:
    site = call.world.town.traffic_lights[_index(call, actor_id)]
    return [values.encode_box(box, actor_id) for box in head_boxes(site)]
