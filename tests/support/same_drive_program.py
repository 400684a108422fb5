"""Somebody's own program that makes the world of a recorded run again: ``HOST PORT SCENE.json``.

It knows the CARLA client alone. It prints the ego's id when everybody stands where the scene says
and drives, waits for a line on standard input, and ticks at a pace that can be followed.
"""

from __future__ import annotations

import json
import socket
import sys
import threading
from pathlib import Path
from typing import Any

import carla

LAW_ABIDING = (
    "ignore_lights_percentage",
    "ignore_signs_percentage",
    "ignore_vehicles_percentage",
    "ignore_walkers_percentage",
)
PACE_S = 0.15


def synchronous(world: carla.World, scene: dict[str, Any]) -> None:
    before, settings = world.get_settings(), world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, scene["step_s"]
    settings.substepping = True
    settings.max_substep_delta_time = scene["max_substep_s"]
    settings.max_substeps = scene["max_substeps"]
    if settings != before:  # applying them takes a step of the world
        world.apply_settings(settings)


def spawn(world: carla.World, wanted: dict[str, Any], points: list[Any]) -> Any:
    blueprint = world.get_blueprint_library().find(wanted["blueprint"])
    for name, value in wanted["attributes"].items():
        if blueprint.has_attribute(name) and blueprint.get_attribute(name).is_modifiable:
            blueprint.set_attribute(name, value)
    near = carla.Location(*wanted["near"])
    return world.spawn_actor(blueprint, min(points, key=lambda p: p.location.distance(near)))


def main() -> None:
    scene = json.loads(Path(sys.argv[3]).read_text())
    client = carla.Client(sys.argv[1], int(sys.argv[2]))
    client.set_timeout(120.0)
    synchronous(client.get_world(), scene)
    world = client.load_world(scene["map"], False)
    synchronous(world, scene)
    weather = carla.WeatherParameters()
    for name, value in scene["weather"].items():
        setattr(weather, name, value)
    world.set_weather(weather)
    points = world.get_map().get_spawn_points()
    cars = [spawn(world, wanted, points) for wanted in scene["cars"]]
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    manager = client.get_trafficmanager(port)
    manager.set_synchronous_mode(True)
    manager.set_random_device_seed(scene["traffic_manager_seed"])
    world.tick()
    lamps = world.get_lightmanager()
    lamps.set_day_night_cycle(False)
    lamps.turn_on(lamps.get_all_lights(carla.LightGroup.Street))
    for car in cars:
        car.set_autopilot(True, port)
        for name in LAW_ABIDING:
            getattr(manager, name)(car, 0.0)
        car.set_light_state(carla.VehicleLightState(scene["lights"][str(car.id)]))
    sys.stdout.write(f"{cars[0].id}\n")
    sys.stdout.flush()
    sys.stdin.readline()
    pace = threading.Event()
    for _ in range(scene["ticks"]):
        world.tick()
        # Lights are asked for beside the frames: who lags behind is told of a later frame's.
        pace.wait(PACE_S)
    for car in cars:
        car.destroy()
    world.tick()
    manager.shut_down()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = False, None
    world.apply_settings(settings)


if __name__ == "__main__":
    main()
