"""Traffic lights that show what an event needs, for as long as it needs it."""

from __future__ import annotations

from typing import Any, Dict, List, Tuple

import carla

GREEN, RED = carla.TrafficLightState.Green, carla.TrafficLightState.Red
HOLD_S = 1000.0
"""So long the cycle of a junction that is held would show each state."""


class HeldSignals:
    """The lights of a junction: one way has green, all others red, until they are released.

    A state alone would last until the junction's own cycle changes it, so its times are long
    meanwhile. Released, the cycle starts over, as it cannot know what was shown. Of several that
    hold one junction the last has its way, and the one before once it is released.

    Args:
        green: lights that show green.
        group: all lights of the junction.
        held: who holds each junction, by the lowest id of its lights; the first one first.
    """

    def __init__(
        self, green: List[Any], group: List[Any], held: Dict[int, List["HeldSignals"]]
    ) -> None:
        self._group = sorted(group, key=lambda light: int(light.id))
        self._wanted = {light.id: RED for light in group}
        self._wanted.update({light.id: GREEN for light in green})
        self._holders = held.setdefault(int(self._group[0].id), [])
        if self._holders:
            self._times: List[Tuple[float, float, float]] = self._holders[0]._times
        else:
            self._times = [
                (light.get_green_time(), light.get_yellow_time(), light.get_red_time())
                for light in self._group
            ]
        self._holders.append(self)
        self._show()

    def _show(self) -> None:
        for light in self._group:
            _set_times(light, (HOLD_S, HOLD_S, HOLD_S))
            light.set_state(self._wanted[light.id])

    def release(self) -> None:
        """Let the junction's own cycle go on; more than once does no harm."""
        if self not in self._holders:
            return
        self._holders.remove(self)
        if self._holders:
            self._holders[-1]._show()
            return
        for light, times in zip(self._group, self._times):
            _set_times(light, times)
        self._group[0].reset_group()


def _set_times(light: Any, times: Tuple[float, float, float]) -> None:
    light.set_green_time(times[0])
    light.set_yellow_time(times[1])
    light.set_red_time(times[2])
