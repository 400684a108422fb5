"""The same drive ends at the same place, however long the ticks are."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from carstage_sim.world.controls import (
    AckermannControl,
    AckermannSettings,
    EpisodeSettings,
    VehicleControl,
)
from carstage_sim.world.vehicles.ackermann import AckermannController
from plain_scenes import CAR, fleet_on, hills, parameters

_SECONDS = 11
_FOLLOWED = AckermannControl(steer_rad=0.05, steer_speed=0.2, speed=6.0, acceleration=2.0)


def pedals(second: float) -> VehicleControl | None:
    """Gears, braking, steering, reverse; None where an Ackermann controller drives."""
    if second < 3.0:
        return VehicleControl(throttle=0.8)
    if second < 4.0:
        return VehicleControl(throttle=0.3, steer=0.15, manual_gear_shift=True, gear=2)
    if second < 5.0:
        return VehicleControl(throttle=0.4, steer=-0.2)
    if second < 6.0:
        return VehicleControl(brake=0.6)
    if second < 8.0:
        return None
    if second < 10.0:
        return VehicleControl(brake=1.0)
    return VehicleControl(throttle=0.5, reverse=True)


def driven(fps: int, settings: EpisodeSettings, *, on_hills: bool) -> tuple[float, ...]:
    fleet = fleet_on(hills())
    start_z = 1.0 if on_hills else 0.5
    fleet.add(CAR, parameters(), (0.0 if on_hills else -300.0, 0.0, start_z), (0.0, 0.0, 0.0))
    controller = AckermannController(_FOLLOWED, AckermannSettings())

    def follow(part_s: float) -> None:
        fleet.set_control(CAR, controller.step(float(fleet.speed[0]), parameters(), part_s))

    for index in range(_SECONDS * fps):
        control = pedals(index / fps + 1e-9)
        before: Callable[[float], None] | None = None
        if control is None:
            before = follow
        else:
            fleet.set_control(CAR, control)
        physics = settings.physics(1.0 / fps)
        fleet.step(1.0 / fps, physics.substeps, moving_s=physics.duration_s, before_substep=before)
    return tuple(fleet.location[0].tolist())


@pytest.mark.parametrize("on_hills", [False, True], ids=["plain", "hills"])
@pytest.mark.parametrize("substepping", [True, False], ids=["substeps", "none"])
def test_a_drive_at_10_and_at_100_frames_per_second_ends_within_0_3_m(
    substepping: bool, on_hills: bool
) -> None:
    settings = EpisodeSettings(substepping=substepping)
    slow, fast = (driven(fps, settings, on_hills=on_hills) for fps in (10, 100))
    assert math.dist(slow, fast) < 0.3
