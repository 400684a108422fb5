"""Street lights: what ``carla.LightManager`` asks and sets."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.world.street_lights import LightState


@handles("query_lights_state")
def _query_lights_state(call: Call, _client: str) -> list[Any]:
    lights = call.world.street_lights
    return [
        [state.light_id, place, state.intensity, state.group, list(state.colour), state.active]
        for state, place in zip(lights.states(), lights.lamps.location.tolist(), strict=True)
    ]


@handles_void("update_lights_state")
def _update_lights_state(
    call: Call, _client: str, states: list[list[Any]], _discard_client: bool = False
) -> None:
    call.world.street_lights.apply([_light_state(state) for state in states])


def _light_state(state: list[Any]) -> LightState:
    light_id, _location, intensity, group, colour, active = state
    (intensity,) = values.finite(intensity)
    return LightState(
        int(light_id), intensity, int(group) & 0xFF, values.colour(colour), bool(active)
    )


@handles_void("update_day_night_cycle")
def _update_day_night_cycle(call: Call, _client: str, active: bool) -> None:
    call.world.street_lights.set_day_night_cycle(bool(active))
