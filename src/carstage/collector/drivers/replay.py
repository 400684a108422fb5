"""Driver ``replay``: the commands of an earlier episode."""

from __future__ import annotations

from typing import Any, Sequence

import carla

from carstage.collector.drivers.base import Driver, Observation
from carstage.spec import Command


class ReplayDriver(Driver):
    """Gives the commands that were recorded, whatever it observes.

    Args:
        commands: one for each step.
    """

    def __init__(self, commands: Sequence[Command]) -> None:
        self._commands = commands

    def drive(self, observation: Observation) -> Any:
        """The command of that step."""
        return control_of(self._commands[observation.tick])


def control_of(command: Command) -> Any:
    """The ``carla.VehicleControl`` of a command."""
    return carla.VehicleControl(
        throttle=command.throttle,
        steer=command.steer,
        brake=command.brake,
        hand_brake=bool(command.hand_brake),
        reverse=bool(command.reverse),
        manual_gear_shift=bool(command.manual_gear_shift),
        gear=command.gear,
    )
