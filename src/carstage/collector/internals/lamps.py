"""Street lamps, and the lights of vehicles that the Traffic Manager does not drive."""

from __future__ import annotations

from typing import Any, Dict, Mapping, Sequence

import carla

from carstage.collector.internals.dialect import set_day_night_cycle
from carstage.collector.world import WorldSession

# Angles and thresholds of the Traffic Manager's vehicle lights (LibCarla, VehicleLightStage and
# Constants.h), so that all vehicles follow one rule.
BEAM_BELOW_DEG = 15.0
POSITION_BELOW_DEG = 35.0
HEAVY_RAIN = 80.0
FOG = 20.0

_STATE = carla.VehicleLightState
DRIVING_LIGHTS = int(_STATE.Position) | int(_STATE.LowBeam)


def lights_for(weather: Mapping[str, float]) -> int:
    """``carla.VehicleLightState`` bits that a careful driver shows in this weather."""
    altitude_deg = weather["sun_altitude_angle"]
    bits = 0
    if altitude_deg < POSITION_BELOW_DEG:
        bits |= int(_STATE.Position)
    if altitude_deg < BEAM_BELOW_DEG or weather["precipitation"] > HEAVY_RAIN:
        bits |= DRIVING_LIGHTS
    if weather["fog_density"] > FOG:
        bits |= DRIVING_LIGHTS | int(_STATE.Fog)
    return bits


def planned_lights(mode: str, weather: Mapping[str, float]) -> int:
    """``carla.VehicleLightState`` bits of a vehicle that nobody else lights.

    Args:
        mode: ``auto``, ``on`` or ``off``.
        weather: its parameters.
    """
    bits = {"on": DRIVING_LIGHTS, "off": 0}.get(mode)
    return lights_for(weather) if bits is None else bits


class Lamps:
    """Switches lamps as planned.

    Args:
        session: the episode's world.
        mode: ``auto``, ``on`` or ``off``.
    """

    def __init__(self, session: WorldSession, mode: str) -> None:
        self._session = session
        self._mode = mode
        self._shown: Dict[int, int] = {}

    def switch_street_lamps(self) -> None:
        """``auto`` leaves them to the server, which lights them when the sun is low."""
        manager = self._session.world.get_lightmanager()
        set_day_night_cycle(manager, self._mode == "auto")
        if self._mode == "auto":
            return
        lamps = manager.get_all_lights(carla.LightGroup.Street)
        if lamps:
            (manager.turn_on if self._mode == "on" else manager.turn_off)(lamps)

    def light(self, vehicles: Sequence[Any], weather: Mapping[str, float]) -> None:
        """Set the lights of vehicles that nobody else sets; repeated calls do nothing new."""
        bits = planned_lights(self._mode, weather)
        changed = [vehicle.id for vehicle in vehicles if self._shown.get(vehicle.id) != bits]
        self._shown = {vehicle.id: bits for vehicle in vehicles}
        if changed:
            state = carla.VehicleLightState(bits)
            self._session.client.apply_batch(
                [carla.command.SetVehicleLightState(actor_id, state) for actor_id in changed]
            )
