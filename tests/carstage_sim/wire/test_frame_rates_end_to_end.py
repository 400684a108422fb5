"""A scripted drive of the real client, once with long and once with short ticks."""

from __future__ import annotations

import math
from typing import Any

import pytest

from benchmarks.simulator.client_process import run_trial
from running_simulator import RunningSimulator

pytestmark = pytest.mark.end_to_end

KEPT: list[Any] = []
"""A world that is freed while its client works on takes the process with it."""


def drive_of(port: int, fps: int) -> tuple[float, float, float, float]:
    """Where a car ends, and how far it went, after throttle, a gear, the wheel and the brake."""
    import carla

    client = carla.Client("127.0.0.1", port)
    client.set_timeout(60.0)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = 1.0 / fps
    # All that physics depends on: the server is shared, and settings outlive episodes.
    settings.substepping = True
    settings.max_substep_delta_time, settings.max_substeps = 0.01, 10
    world.apply_settings(settings)
    world = client.reload_world(False)
    KEPT.extend((client, world))
    points = world.get_map().get_spawn_points()
    car = world.spawn_actor(world.get_blueprint_library().find("vehicle.tesla.model3"), points[0])
    for _ in range(fps):  # it falls from its spawn point: both drives begin on the ground
        world.tick()
    start = car.get_location()
    control = carla.VehicleControl
    drive = (
        (2.0, control(throttle=0.7)),
        (1.0, control(throttle=0.4, manual_gear_shift=True, gear=2)),
        (0.5, control(throttle=0.3, steer=0.03)),
        (0.5, control(brake=0.5, steer=-0.03)),
        (1.5, carla.VehicleAckermannControl(speed=4.0, acceleration=2.0)),
        (1.0, control(brake=1.0)),
    )
    for seconds, command in drive:
        if isinstance(command, carla.VehicleAckermannControl):
            car.apply_ackermann_control(command)
        else:
            car.apply_control(command)
        for _ in range(round(seconds * fps)):
            world.tick()
    end = car.get_location()
    car.destroy()
    return (end.x, end.y, end.z, end.distance(start))


def test_the_client_ends_within_0_3_m_at_10_and_at_100_frames_per_second(
    simulator: RunningSimulator,
) -> None:
    slow, fast = (run_trial(drive_of, simulator.port, fps, timeout_s=120) for fps in (10, 100))
    assert math.dist(slow[:3], fast[:3]) < 0.3
    assert slow[3] > 10.0
