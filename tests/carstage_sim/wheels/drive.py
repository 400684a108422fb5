"""Drives a server with the carla wheel of this interpreter and writes down what it found.

Usage: ``python drive.py PORT TM_PORT FOUND.json``. It runs under an interpreter that the wheel
exists for, Python 3.8 the oldest, with nothing but that wheel and, on its path, the collector's
watch over ticks; the test judges what was found.
"""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path
from queue import Queue
from typing import Any

import carla
from carla import command

from carstage.collector.internals.traffic_manager_wakeup import TickWatch

TICKS = 20
STEP_S = 0.05
WAIT_S = 20.0
SENSORS = (
    "sensor.camera.rgb",
    "sensor.camera.depth",
    "sensor.camera.semantic_segmentation",
    "sensor.camera.instance_segmentation",
    "sensor.camera.normals",  # since 0.9.14
    "sensor.camera.optical_flow",
    "sensor.lidar.ray_cast",
    "sensor.lidar.ray_cast_semantic",
    "sensor.other.radar",
    "sensor.other.imu",
    "sensor.other.gnss",
    "sensor.lidar.ray_cast_sweeping",  # the simulator's own
    "sensor.other.occupancy",  # likewise
    "sensor.other.radar_rcs",  # likewise
    "sensor.lidar.ray_cast_flash",  # likewise
)
"""What delivers data in every frame."""


class WatchedWorld:
    """A ``carla.World`` whose ticks outlast a wake-up that the client's Traffic Manager loses."""

    def __init__(self, world: Any, tm_port: int) -> None:
        self._world = world
        self._watch = TickWatch(world, tm_port, ())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)

    def tick(self) -> int:
        """One tick; the number of its frame."""
        with self._watch.over_a_tick():
            return int(self._world.tick())


def find_all(port: int, tm_port: int) -> dict[str, Any]:
    """Everything in order; the Traffic Manager only after the last load of a map."""
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(WAIT_S)
    world = client.get_world()
    found = {
        "versions": (client.get_client_version(), client.get_server_version()),
        "library": library(world),
        "weather": weather(world),
    }
    settings = world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = STEP_S
    world.apply_settings(settings)
    found["loads"] = loads(client, world)
    world = WatchedWorld(client.get_world(), tm_port)
    found["map"] = (world.get_map().name, len(world.get_map().get_spawn_points()))
    found["scenery"] = scenery(world)
    found["gbuffers"] = gbuffers(world)
    found["drive"] = drive(client, world, tm_port)
    found["batch"] = batch(client, world, tm_port)
    return found


def library(world: Any) -> dict[str, Any]:
    """What the blueprint library says in the client's own types."""
    blueprints = world.get_blueprint_library()
    model3 = blueprints.find("vehicle.tesla.model3")
    return {
        "wheels": model3.get_attribute("number_of_wheels").as_int(),
        "red_at_most": model3.get_attribute("color").as_color().r,
        "fov": blueprints.find("sensor.camera.rgb").get_attribute("fov").as_float(),
        "sensors": sorted(blueprint.id for blueprint in blueprints.filter("sensor.*")),
    }


def weather(world: Any) -> list[float]:
    """Three parameters after a round trip."""
    world.set_weather(carla.WeatherParameters(cloudiness=12.5, sun_altitude_angle=33.0))
    got = world.get_weather()
    return [got.cloudiness, got.sun_altitude_angle, got.precipitation]


def loads(client: Any, world: Any) -> dict[str, Any]:
    """A vehicle is gone after each load, the world goes on, the settings stay."""
    episodes, left, frames = [], [], []
    for load in (
        lambda: client.reload_world(False),
        lambda: client.load_world("Stage01", False),
        lambda: client.reload_world(False),
    ):
        place = world.get_map().get_spawn_points()[0]
        world.spawn_actor(world.get_blueprint_library().find("vehicle.tesla.model3"), place)
        world.tick()
        world = load()
        first = world.tick()
        frames.append(world.tick() - first)
        episodes.append(world.id)
        left.append(len(world.get_actors().filter("vehicle.*")))
    return {
        "episodes": episodes,
        "vehicles_left": left,
        "frames": frames,
        "synchronous": world.get_settings().synchronous_mode,
        "refused": refusal(lambda: client.load_world("Nowhere")),
    }


def refusal(action: Any) -> str:
    """The text of the ``RuntimeError`` that an action must raise."""
    try:
        action()
    except RuntimeError as error:
        return str(error)
    return "nothing was refused"


def scenery(world: Any) -> dict[str, Any]:
    """Labels of scenery: asked for by the client's names, told by them."""
    place = world.get_map().get_spawn_points()[0].location
    above, below = carla.Location(place.x, place.y, 20.0), carla.Location(place.x, place.y, -5.0)
    labels = carla.CityObjectLabel
    poles = world.get_environment_objects(labels.Poles)
    everything = world.get_environment_objects(labels.Any)
    return {
        "building_boxes": len(world.get_level_bbs(labels.Buildings)),
        "buildings": sum(item.type == labels.Buildings for item in everything),
        "kinds_of_poles": sorted({str(item.type) for item in poles}),
        "road": [str(hit.label) for hit in world.cast_ray(above, below)],
    }


def drive(client: Any, world: Any, tm_port: int) -> dict[str, Any]:
    """A car under the Traffic Manager with every sensor, a car in its view, a walker."""
    blueprints = world.get_blueprint_library()
    manager = client.get_trafficmanager(tm_port)
    manager.set_synchronous_mode(True)
    manager.set_random_device_seed(3)
    start = world.get_map().get_spawn_points()[0]
    ahead = carla.Transform(start.location + start.get_forward_vector() * 12.0, start.rotation)
    model3 = blueprints.find("vehicle.tesla.model3")
    car, other = world.spawn_actor(model3, start), world.spawn_actor(model3, ahead)
    walker, controller = spawn_walker(world)
    offered = {blueprint.id for blueprint in blueprints}
    queues: dict[str, Queue[Any]] = {name: Queue() for name in SENSORS if name in offered}
    sensors = [listening(world, car, type_id, queue.put) for type_id, queue in queues.items()]
    await_first_data(world, queues)
    for vehicle in (car, other):
        vehicle.set_autopilot(True, tm_port)
    controller.start()
    controller.go_to_location(world.get_random_location_from_navigation())
    controller.set_max_speed(1.4)
    wrong_frames, last = [], {}
    for _ in range(TICKS):
        frame = world.tick()
        for type_id, queue in queues.items():
            data = last[type_id] = queue.get(timeout=WAIT_S)
            if data.frame != frame:
                wrong_frames.append((type_id, data.frame, frame))
    for sensor in sensors:
        sensor.stop()
    found = {
        "wrong_frames": wrong_frames,
        "kinds": {type_id: type(data).__name__ for type_id, data in last.items()},
        "speeds": [speed(actor) for actor in (car, other, walker)],
        "limit": car.get_speed_limit(),
        "tags": {"car": list(car.semantic_tags), "walker": list(walker.semantic_tags)},
        "seen": {
            "semantic": tags(last["sensor.camera.semantic_segmentation"]),
            "instance": tags(last["sensor.camera.instance_segmentation"]),
            "lidar": sorted({hit.object_tag for hit in last["sensor.lidar.ray_cast_semantic"]}),
        },
        "points": len(last["sensor.lidar.ray_cast"]),
        "gravity": last["sensor.other.imu"].accelerometer.z,
        "globe": on_the_globe(world.get_map(), last["sensor.other.gnss"]),
    }
    controller.stop()
    for vehicle in (car, other):
        vehicle.set_autopilot(False, tm_port)
    found["collision"] = run_into(world, car, other)
    gone = [*sensors, controller, walker, other, car]
    found["destroyed"] = [actor.destroy() for actor in gone]
    world.tick()
    found["left"] = [actor.id for actor in world.get_actors() if actor.id in {a.id for a in gone}]
    return found


def on_the_globe(world_map: Any, gnss: Any) -> dict[str, list[float]]:
    """Where a GNSS sensor says that it is, and where the client has that place."""
    place = world_map.transform_to_geolocation(gnss.transform.location)
    return {
        "sensor": [gnss.latitude, gnss.longitude],
        "client": [place.latitude, place.longitude],
    }


def spawn_walker(world: Any) -> Any:
    """A walker on the navigation mesh, and its controller."""
    world.set_pedestrians_seed(2)
    blueprints = world.get_blueprint_library()
    walker = None
    while walker is None:
        place = world.get_random_location_from_navigation()
        place.z += 1.0
        blueprint = blueprints.find("walker.pedestrian.0001")
        walker = world.try_spawn_actor(blueprint, carla.Transform(place))
    world.tick()
    blueprint = blueprints.find("controller.ai.walker")
    controller = world.spawn_actor(blueprint, carla.Transform(), attach_to=walker)
    world.tick()
    return walker, controller


def listening(world: Any, car: Any, type_id: str, callback: Any) -> Any:
    """A small sensor on the car's roof."""
    blueprint = world.get_blueprint_library().find(type_id)
    if "camera" in type_id:
        blueprint.set_attribute("image_size_x", "96")
        blueprint.set_attribute("image_size_y", "64")
    pose = carla.Transform(carla.Location(x=0.5, z=1.8))
    sensor = world.spawn_actor(blueprint, pose, attach_to=car)
    sensor.listen(callback)
    return sensor


def gbuffers(world: Any) -> dict[str, Any]:
    """Size and brightest byte of two of a camera's buffers; empty where the client knows none."""
    if not hasattr(carla, "GBufferTextureID"):
        return {}
    blueprint = world.get_blueprint_library().find("sensor.camera.rgb")
    blueprint.set_attribute("image_size_x", "96")
    blueprint.set_attribute("image_size_y", "64")
    place = world.get_map().get_spawn_points()[0]
    camera = world.spawn_actor(blueprint, carla.Transform(place.location + carla.Location(z=2.0)))
    found = {}
    for name in ("SceneDepth", "SSAO"):
        images: Queue[Any] = Queue()
        camera.listen_to_gbuffer(getattr(carla.GBufferTextureID, name), images.put)
        world.tick()
        image = images.get(timeout=WAIT_S)
        colours = [byte for place, byte in enumerate(bytes(image.raw_data)) if place % 4 < 3]
        found[name] = [image.width, image.height, max(colours)]
    camera.destroy()
    return found


def await_first_data(world: Any, queues: Any) -> None:
    """Tick until every stream is up and has delivered the frame of the last tick."""
    frame = world.tick()
    for queue in queues.values():
        while queue.empty():
            frame = world.tick()
    for queue in queues.values():
        while queue.get(timeout=WAIT_S).frame < frame:
            pass


def run_into(world: Any, car: Any, other: Any) -> list[Any]:
    """The first collision when one car is driven into the other: who with, tags and impulse."""
    events: Queue[Any] = Queue()
    blueprint = world.get_blueprint_library().find("sensor.other.collision")
    sensor = world.spawn_actor(blueprint, carla.Transform(), attach_to=car)
    sensor.listen(events.put)
    for _ in range(60):
        car.set_target_velocity(car.get_transform().get_forward_vector() * 15.0)
        world.tick()
        if not events.empty():
            break
    sensor.stop()
    sensor.destroy()
    event = events.get(timeout=WAIT_S)
    impulse = event.normal_impulse
    return [
        type(event).__name__,
        event.other_actor.id == other.id,
        list(event.other_actor.semantic_tags),
        math.hypot(impulse.x, impulse.y),
    ]


def tags(image: Any) -> list[int]:
    """The tags in a picture: byte R of BGRA."""
    return sorted(set(bytes(image.raw_data)[2::4]))


def speed(actor: Any) -> float:
    """Over ground, m/s."""
    velocity = actor.get_velocity()
    return math.hypot(velocity.x, velocity.y)


def batch(client: Any, world: Any, tm_port: int) -> dict[str, Any]:
    """Every command that this client can send, and what tells one from another.

    No client can send ``ShowDebugTelemetry``: its class is not registered as a command.
    """
    blueprints = world.get_blueprint_library()
    first, second, third = world.get_map().get_spawn_points()[:3]
    model3 = blueprints.find("vehicle.tesla.model3")
    full_throttle = carla.VehicleControl(throttle=1.0)
    go = command.ApplyVehicleControl(command.FutureActor, full_throttle)
    spawned = client.apply_batch_sync(
        [
            command.SpawnActor(model3, first).then(go),
            command.SpawnActor(model3, first),
            command.SpawnActor(blueprints.find("walker.pedestrian.0001"), third),
        ]
    )
    for _ in range(20):
        world.tick()
    car, walker = (world.get_actor(spawned[index].actor_id) for index in (0, 2))
    found = {
        "spawn_errors": [response.error for response in spawned],
        "throttled": (car.get_control().throttle, speed(car)),
    }
    physics = car.get_physics_control()
    physics.mass = 1234.0
    none = carla.Vector3D()
    commands = [
        command.ApplyImpulse(car, none),
        command.ApplyForce(car, none),
        command.ApplyAngularImpulse(car, none),
        command.ApplyTorque(car, none),
        command.ApplyVehiclePhysicsControl(car, physics),
        # By id: given an actor, the clients take the lights for a bool.
        command.SetVehicleLightState(car.id, carla.VehicleLightState.Fog),
        command.ApplyTransform(car, second),
        command.ApplyTargetVelocity(car, second.get_forward_vector() * 4.0),
        command.ApplyTargetAngularVelocity(car, none),
        command.SetSimulatePhysics(car, True),
        command.SetEnableGravity(car, True),
        command.SetAutopilot(car, False, tm_port),
        command.ApplyWalkerState(walker, first, 0.0),
        command.ApplyWalkerControl(walker, carla.WalkerControl(second.get_forward_vector(), 1.5)),
    ]
    if hasattr(command, "ApplyVehicleAckermannControl"):
        ackermann = carla.VehicleAckermannControl(speed=4.0)
        commands.append(command.ApplyVehicleAckermannControl(car, ackermann))
    responses = client.apply_batch_sync(commands)
    world.tick()
    found["errors"] = [response.error for response in responses if response.error]
    found["commands"] = len(commands)
    found["mass"] = car.get_physics_control().mass
    found["lights"] = int(car.get_light_state())
    found["car_moved_to"] = car.get_location().distance(second.location)
    found["car_speed"] = speed(car)
    found["walker_moved_to"] = walker.get_location().distance(first.location)
    found["walker_speed"] = walker.get_control().speed
    client.apply_batch_sync([command.DestroyActor(car), command.DestroyActor(walker)], True)
    world.tick()
    found["left"] = [a.id for a in world.get_actors() if a.id in (car.id, walker.id)]
    return found


def main() -> None:
    """Write what was found and leave: the wheel may abort in an orderly exit."""
    port, tm_port, path = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    Path(path).write_text(json.dumps(find_all(port, tm_port)), encoding="utf-8")
    os._exit(0)


if __name__ == "__main__":
    main()
