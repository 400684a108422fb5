"""Loads a map while this interpreter's carla wheel runs a Traffic Manager in asynchronous mode.

Usage: ``python reload.py PORT TM_PORT FOUND.json``; see ``drive.py``.
"""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path

import carla

LOADS = 2
FRAMES_TO_START = 90
WAIT_S = 20.0


def speeds_after_loads(port: int, tm_port: int) -> list[float]:
    """Speed over ground, m/s, of a car that is registered after each load.

    Not before it is in a snapshot: a Traffic Manager that runs freely forgets a vehicle again that
    the snapshot of its cycle does not show, with every server.
    """
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(WAIT_S)
    world = client.get_world()
    client.get_trafficmanager(tm_port)
    speeds = []
    for _ in range(LOADS):
        world = client.reload_world()
        place = world.get_map().get_spawn_points()[0]
        car = world.spawn_actor(world.get_blueprint_library().find("vehicle.tesla.model3"), place)
        while not world.get_snapshot().has_actor(car.id):
            world.wait_for_tick(WAIT_S)
        car.set_autopilot(True, tm_port)
        for _ in range(FRAMES_TO_START):
            world.wait_for_tick(WAIT_S)
            velocity = car.get_velocity()
            if math.hypot(velocity.x, velocity.y) > 0.5:
                break
        speeds.append(math.hypot(velocity.x, velocity.y))
    return speeds


if __name__ == "__main__":
    found = speeds_after_loads(int(sys.argv[1]), int(sys.argv[2]))
    Path(sys.argv[3]).write_text(json.dumps(found), encoding="utf-8")
    os._exit(0)  # the wheel may abort in an orderly exit
