"""``... dropping_client HOST PORT RIG``: listens to sensors on the ego and drops what comes.

It waits for the vehicle whose role is ``hero``, attaches the sensors, and ends when the vehicle is
gone. ``RIG`` is a JSON object: attributes by the blueprint's id.
"""

from __future__ import annotations

import json
import sys
import time

import carla

_WAIT_S = 120.0


def _world_and_ego(client: carla.Client) -> tuple[carla.World, carla.Actor]:
    deadline_s = time.monotonic() + _WAIT_S
    while time.monotonic() < deadline_s:
        world = client.get_world()  # the program may replace it
        for vehicle in world.get_actors().filter("vehicle.*"):
            if vehicle.attributes.get("role_name") == "hero":
                return world, vehicle
        world.wait_for_tick(_WAIT_S)
    raise SystemExit("no ego came")


def main() -> None:
    """Run the program."""
    host, port, rig = sys.argv[1], int(sys.argv[2]), json.loads(sys.argv[3])
    client = carla.Client(host, port)
    client.set_timeout(_WAIT_S)
    world, ego = _world_and_ego(client)
    sensors = []
    for blueprint_id, attributes in rig.items():
        blueprint = world.get_blueprint_library().find(blueprint_id)
        for name, value in attributes.items():
            blueprint.set_attribute(name, value)
        place = carla.Transform(carla.Location(x=1.5, z=1.6))
        sensors.append(world.spawn_actor(blueprint, place, attach_to=ego))
    for sensor in sensors:
        sensor.listen(lambda _data: None)
    while world.wait_for_tick(_WAIT_S).has_actor(ego.id):
        pass
    for sensor in sensors:
        sensor.stop()


if __name__ == "__main__":
    main()
