"""Somebody's own program that has the server's recorder write a log: ``HOST PORT LOG TICKS``.

It prints one JSON object: by tick the poses (x, y, z, pitch, yaw, roll) of vehicles and walkers, by
id, and the ego's id.
"""

from __future__ import annotations

import json
import os
import socket
import sys

import carla

STEP_S = 0.05
BEFORE = 40
"""Ticks before the log begins, so that everybody moves in its first frame."""


def main() -> None:
    client = carla.Client(sys.argv[1], int(sys.argv[2]))
    client.set_timeout(120.0)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, STEP_S
    world.apply_settings(settings)
    world = client.load_world("Stage01", False)
    world.tick()
    library, points = world.get_blueprint_library(), world.get_map().get_spawn_points()
    cars = []
    for number, point in enumerate(points[:24:6]):
        blueprint = library.filter("vehicle.*.*")[number]
        if number == 0:
            blueprint = library.find("vehicle.tesla.model3")
            blueprint.set_attribute("role_name", "hero")
        cars.append(world.spawn_actor(blueprint, point))
    place = carla.Transform(world.get_random_location_from_navigation())
    place.location.z += 1.0
    walker = world.spawn_actor(library.filter("walker.pedestrian.*")[0], place)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    manager = client.get_trafficmanager(port)
    manager.set_synchronous_mode(True)
    manager.set_random_device_seed(7)
    world.tick()
    for car in cars:
        car.set_autopilot(True, port)
    walker.apply_control(carla.WalkerControl(carla.Vector3D(1.0, 0.0, 0.0), 1.2, False))
    for _ in range(BEFORE):
        world.tick()
    client.start_recorder(sys.argv[3])
    seen = []
    for _ in range(int(sys.argv[4])):
        world.tick()
        poses = {}
        for actor in (*cars, walker):
            pose = actor.get_transform()
            at, turned = pose.location, pose.rotation
            poses[actor.id] = [at.x, at.y, at.z, turned.pitch, turned.yaw, turned.roll]
        seen.append(poses)
    client.stop_recorder()
    manager.shut_down()
    sys.stdout.write(json.dumps({"ego": cars[0].id, "seen": seen}) + "\n")
    sys.stdout.flush()
    os._exit(0)  # the wheel may abort when its last object goes


if __name__ == "__main__":
    main()
