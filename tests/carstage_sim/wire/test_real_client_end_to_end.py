"""The unmodified carla wheel against the server, each trial in a client process of its own."""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING, Any

import pytest

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.ticking import WatchedClock
from carstage.collector.internals.traffic_manager_wakeup import started_threads

if TYPE_CHECKING:
    from running_simulator import RunningSimulator

pytestmark = pytest.mark.end_to_end

SENSORS = {
    "sensor.camera.rgb": "Image",
    "sensor.camera.depth": "Image",
    "sensor.camera.semantic_segmentation": "Image",
    "sensor.camera.instance_segmentation": "Image",
    "sensor.camera.normals": "Image",
    "sensor.camera.optical_flow": "OpticalFlowImage",
    "sensor.camera.dvs": "DVSEventArray",
    "sensor.lidar.ray_cast": "LidarMeasurement",
    "sensor.lidar.ray_cast_semantic": "SemanticLidarMeasurement",
    "sensor.lidar.ray_cast_sweeping": "SemanticLidarMeasurement",
    "sensor.lidar.ray_cast_flash": "SemanticLidarMeasurement",
    "sensor.other.radar": "RadarMeasurement",
    "sensor.other.imu": "IMUMeasurement",
    "sensor.other.gnss": "GnssMeasurement",
    "sensor.other.occupancy": "SemanticLidarMeasurement",
    "sensor.other.radar_rcs": "SemanticLidarMeasurement",
    "sensor.other.obstacle": "ObstacleDetectionEvent",
}
"""All that send something in every tick while they move, and the client's class of it."""

KEPT: list[Any] = []
"""Of the client process: the wheel may abort when its last object goes while a stream closes."""


def connect(port: int, *, synchronous: bool = True) -> tuple[Any, Any]:
    """A client and the world of a new episode."""
    import carla

    client = carla.Client("127.0.0.1", port)
    client.set_timeout(20.0)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode = synchronous
    settings.fixed_delta_seconds = 0.05 if synchronous else None
    world.apply_settings(settings)
    KEPT.append(client.reload_world(False))
    return client, KEPT[-1]


def trial_of_100_ticks(port: int) -> dict[str, Any]:
    client, world = connect(port)
    library = world.get_blueprint_library()
    place = world.get_map().get_spawn_points()[0]
    vehicle = world.spawn_actor(library.find("vehicle.tesla.model3"), place)
    frames = [world.tick() for _ in range(100)]
    snapshot = world.get_snapshot()
    return {
        "versions": (client.get_client_version(), client.get_server_version()),
        "map": world.get_map().name,
        "frames": frames,
        "snapshot": (snapshot.frame, round(snapshot.timestamp.elapsed_seconds, 6)),
        "ids": sorted(actor.id for actor in world.get_actors()),
        "lights": len(world.get_actors().filter("traffic.traffic_light")),
        "vehicle": (vehicle.id, vehicle.get_transform().location.distance(place.location)),
        "speed_limit": vehicle.get_speed_limit(),
    }


def test_client_opens_the_world_and_ticks_it(simulator: RunningSimulator) -> None:
    found = run_trial(trial_of_100_ticks, simulator.port, timeout_s=120)
    assert found["versions"] == ("0.9.16", "0.9.16")
    assert found["map"] == "Carla/Maps/Stage01"
    assert found["frames"] == list(range(found["frames"][0], found["frames"][0] + 100))
    assert found["snapshot"][0] == found["frames"][-1]
    vehicle_id, moved_m = found["vehicle"]
    assert found["ids"] == list(range(1, vehicle_id + 1))
    assert vehicle_id == found["lights"] + 2  # the lights, the spectator, then the vehicle
    assert moved_m < 0.7  # it fell to the road and stayed
    assert found["speed_limit"] > 0.0


def trial_of_sensors(port: int) -> dict[str, Any]:
    import carla

    _, world = connect(port)
    library = world.get_blueprint_library()
    vehicle = world.spawn_actor(
        library.find("vehicle.tesla.model3"), world.get_map().get_spawn_points()[0]
    )
    # Without movement the event camera, and without the road in its ball the obstacle detector,
    # would rightly stay silent.
    vehicle.apply_control(carla.VehicleControl(throttle=1.0))
    attributes = {"image_size_x": "96", "image_size_y": "64", "hit_radius": "2.5"}
    queues: dict[str, queue.Queue[Any]] = {}
    sensors = []
    for type_id in SENSORS:
        blueprint = library.find(type_id)
        for name, value in attributes.items():
            if blueprint.has_attribute(name):
                blueprint.set_attribute(name, value)
        sensor = world.spawn_actor(
            blueprint, carla.Transform(carla.Location(x=0.5, z=1.8)), attach_to=vehicle
        )
        queues[type_id] = queue.Queue()
        sensor.listen(queues[type_id].put)
        sensors.append(sensor)
    for _ in range(10):
        world.tick()
    mismatches, kinds, poses, sizes = [], {}, {}, {}
    for _ in range(5):
        frame = world.tick()
        for type_id, arrived in queues.items():
            data = arrived.get(timeout=20.0)
            while data.frame < frame:
                data = arrived.get(timeout=20.0)
            kinds[type_id] = type(data).__name__
            poses[type_id] = data.transform.location.distance(vehicle.get_location())
            if data.frame != frame:
                mismatches.append((type_id, data.frame, frame))
            if hasattr(data, "raw_data"):
                sizes[type_id] = (len(data), len(bytes(data.raw_data)))
            elif type_id == "sensor.other.obstacle":
                seen = (data.actor.id == sensors[-1].id, data.other_actor.type_id, data.distance)
    for sensor in sensors:
        sensor.stop()
    return {
        "mismatches": mismatches, "kinds": kinds, "poses": poses, "sizes": sizes, "obstacle": seen
    }  # fmt: skip


def test_every_sensor_delivers_the_frame_of_its_tick(simulator: RunningSimulator) -> None:
    found = run_trial(trial_of_sensors, simulator.port, timeout_s=120)
    assert found["mismatches"] == []
    assert found["kinds"] == SENSORS
    expected_m = (0.5**2 + 1.8**2) ** 0.5
    assert all(abs(distance - expected_m) < 1e-3 for distance in found["poses"].values())
    item_bytes = {"Image": 4, "OpticalFlowImage": 8, "DVSEventArray": 13, "LidarMeasurement": 16,
                  "SemanticLidarMeasurement": 24, "RadarMeasurement": 16}  # fmt: skip
    for type_id, (count, size) in found["sizes"].items():
        assert count > 0, type_id
        assert size == count * item_bytes[SENSORS[type_id]], type_id
    assert found["obstacle"] == (True, "static.road", 0.0)


def trial_of_mounts(port: int) -> dict[str, Any]:
    import carla

    _, world = connect(port)
    library = world.get_blueprint_library()
    place = world.get_map().get_spawn_points()[0]
    beside = carla.Transform(place.location + place.get_right_vector() * 6.0, place.rotation)
    beyond = carla.Transform(place.location + place.get_right_vector() * 9.0, place.rotation)
    mount = carla.Transform(carla.Location(x=0.3, y=-0.2, z=1.0), carla.Rotation(yaw=30.0))

    def spawn(type_id: str, at: Any, parent: Any = None) -> Any:
        return world.spawn_actor(library.find(type_id), at, attach_to=parent)

    parents = {
        "nothing": None,
        "walker": spawn("walker.pedestrian.0001", beside),
        "prop": spawn("static.prop.streetbarrier", beyond),
        "light": world.get_actors().filter("traffic.traffic_light")[0],
        "spectator": world.get_spectator(),
        "sensor": spawn("sensor.other.gnss", place),
    }
    arrived: dict[str, queue.Queue[Any]] = {name: queue.Queue() for name in parents}
    sensors = {name: spawn("sensor.other.radar", mount, parent) for name, parent in parents.items()}
    for name, sensor in sensors.items():
        sensor.listen(arrived[name].put)
    frame = world.tick()
    apart = {}
    for name, parent in parents.items():
        data = arrived[name].get(timeout=20.0)
        expected = carla.Location(mount.location)
        if parent is not None:
            parent.get_transform().transform(expected)
        apart[name] = (data.frame - frame, data.transform.location.distance(expected))
    for sensor in sensors.values():
        sensor.stop()
    return apart


def test_sensors_ride_on_anything_and_on_nothing(simulator: RunningSimulator) -> None:
    apart = run_trial(trial_of_mounts, simulator.port, timeout_s=60)
    assert len(apart) == 6
    assert all(late == 0 and off_m < 1e-3 for late, off_m in apart.values()), apart


def trial_of_two_listeners(port: int) -> tuple[list[int], list[int], list[int]]:
    import carla

    _, world = connect(port)
    place = world.get_map().get_spawn_points()[0]
    sensor = world.spawn_actor(world.get_blueprint_library().find("sensor.other.gnss"), place)
    world.tick()
    second = carla.Client("127.0.0.1", port)
    second.set_timeout(20.0)
    KEPT.append(second)
    same = second.get_world().get_actor(sensor.id)
    queues: list[queue.Queue[Any]] = [queue.Queue(), queue.Queue()]
    sensor.listen(queues[0].put)
    same.listen(queues[1].put)
    frames = [world.tick() for _ in range(4)]
    seen = [[each.get(timeout=20.0).frame for _ in frames] for each in queues]
    sensor.stop()
    same.stop()
    return frames, seen[0], seen[1]


def test_a_sensor_has_as_many_listeners_as_ask(simulator: RunningSimulator) -> None:
    frames, first, second = run_trial(trial_of_two_listeners, simulator.port, timeout_s=60)
    assert first == frames
    assert second == frames


def trial_of_destroying_a_listening_sensor(port: int) -> tuple[int, int]:
    _, world = connect(port)
    sensor = world.spawn_actor(
        world.get_blueprint_library().find("sensor.other.gnss"),
        world.get_map().get_spawn_points()[0],
    )
    received: queue.Queue[Any] = queue.Queue()
    sensor.listen(received.put)
    while received.empty():
        world.tick()
    sensor.destroy()
    return world.tick(), world.tick()


def test_destroying_a_listening_sensor_leaves_client_and_server_well(
    simulator: RunningSimulator,
) -> None:
    first, second = run_trial(trial_of_destroying_a_listening_sensor, simulator.port, timeout_s=60)
    assert second == first + 1


def trial_of_the_free_run(port: int) -> tuple[list[int], bool]:
    _, world = connect(port, synchronous=False)
    vehicle = world.spawn_actor(
        world.get_blueprint_library().find("vehicle.tesla.model3"),
        world.get_map().get_spawn_points()[0],
    )
    frames = [world.wait_for_tick(20.0).frame for _ in range(5)]
    return frames, vehicle.id in {actor.id for actor in world.get_actors()}


def test_free_run_makes_frames_without_being_asked(simulator: RunningSimulator) -> None:
    frames, alive = run_trial(trial_of_the_free_run, simulator.port, timeout_s=60)
    assert frames == sorted(set(frames))
    assert alive


def trial_of_a_batch(port: int) -> dict[str, Any]:
    import carla
    from carla import command

    client, world = connect(port)
    library = world.get_blueprint_library()
    place = world.get_map().get_spawn_points()[0]
    drive = command.ApplyVehicleControl(command.FutureActor, carla.VehicleControl(throttle=1.0))
    spawn = command.SpawnActor(library.find("vehicle.tesla.model3"), place).then(drive)
    responses = client.apply_batch_sync([spawn, spawn], False)
    for _ in range(40):
        world.tick()
    vehicle = world.get_actor(responses[0].actor_id)
    speed = vehicle.get_velocity().length()
    client.apply_batch_sync([command.DestroyActor(vehicle)], False)
    world.tick()
    return {
        "errors": [response.error for response in responses],
        "speed": speed,
        "left": len(world.get_actors().filter("vehicle.*")),
    }


def test_batch_spawns_drives_refuses_and_destroys(simulator: RunningSimulator) -> None:
    found = run_trial(trial_of_a_batch, simulator.port, timeout_s=60)
    assert found["errors"] == ["", "Spawn failed because of collision at spawn position"]
    assert found["speed"] > 2.0
    assert found["left"] == 0


def trial_of_walkers(port: int) -> list[tuple[float, float, float, str]]:
    client, world = connect(port)
    from carla import Transform, command

    world.set_pedestrians_seed(3)
    library = world.get_blueprint_library()
    walkers = []
    while len(walkers) < 3:
        place = Transform(world.get_random_location_from_navigation())
        kind = library.find("walker.pedestrian.0001")
        kind.set_attribute("use_wheelchair", "false" if walkers else "true")
        walker = world.try_spawn_actor(kind, place)
        if walker is not None:
            walkers.append(walker)
    world.tick()
    blueprint = library.find("controller.ai.walker")
    spawned = client.apply_batch_sync(
        [command.SpawnActor(blueprint, Transform(), walker) for walker in walkers], False
    )
    world.tick()
    for response in spawned:
        controller = world.get_actor(response.actor_id)
        controller.start()
        controller.go_to_location(world.get_random_location_from_navigation())
        controller.set_max_speed(1.4)
    for _ in range(60):
        world.tick()
    return [
        (
            walker.get_velocity().length(),
            walker.get_location().z,
            walker.bounding_box.extent.z,
            walker.attributes["use_wheelchair"],
        )
        for walker in walkers
    ]


def test_walkers_under_the_clients_navigation_walk_and_roll_on_the_ground(
    simulator: RunningSimulator,
) -> None:
    walkers = run_trial(trial_of_walkers, simulator.port, timeout_s=60)
    speeds, middles, half_heights, wheelchairs = zip(*walkers, strict=True)
    assert wheelchairs == ("true", "false", "false")
    assert half_heights == pytest.approx((0.73, 0.93, 0.93), abs=1e-3)
    assert max(speeds) > 1.0
    assert max(speeds) < 1.6
    feet = [middle - half for middle, half in zip(middles, half_heights, strict=True)]
    assert all(-0.05 < height < 0.3 for height in feet), feet


def trial_of_loading_with_a_live_traffic_manager(port: int) -> list[float]:
    import socket

    client, world = connect(port, synchronous=False)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        tm_port = probe.getsockname()[1]
    client.get_trafficmanager(tm_port)
    speeds: list[float] = []
    for _ in range(3):
        vehicle = world.spawn_actor(
            world.get_blueprint_library().find("vehicle.tesla.model3"),
            world.get_map().get_spawn_points()[0],
        )
        vehicle.set_autopilot(True, tm_port)
        waited = 0
        while vehicle.get_velocity().length() < 0.5 and waited < 300:
            world.wait_for_tick(20.0)
            waited += 1
        speeds.append(vehicle.get_velocity().length())
        world = client.load_world("Stage01")
    return speeds


def test_map_can_be_loaded_while_a_traffic_manager_runs_freely(
    simulator: RunningSimulator,
) -> None:
    # The client used to crash here, in most tries: see the server's handling of load_new_episode.
    speeds = run_trial(trial_of_loading_with_a_live_traffic_manager, simulator.port, timeout_s=120)
    assert min(speeds) > 0.4


def trial_of_traffic(port: int) -> list[tuple[Any, ...]]:
    import socket

    client, world = connect(port)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        tm_port = probe.getsockname()[1]
    with started_threads() as threads:
        manager = client.get_trafficmanager(tm_port)
    manager.set_synchronous_mode(True)
    manager.set_random_device_seed(5)
    library = world.get_blueprint_library()
    places = world.get_map().get_spawn_points()
    vehicles = [
        world.spawn_actor(library.find("vehicle.tesla.model3"), places[index])
        for index in range(0, 60, 20)
    ]
    for vehicle in vehicles:
        vehicle.set_autopilot(True, tm_port)
    with WatchedClock(world, tm_port, threads) as clock:
        frames = [clock.tick() for _ in range(100)]
    snapshot = world.get_snapshot()
    moved = [
        (round(item.get_transform().location.x, 9), round(item.get_velocity().length(), 9))
        for item in map(snapshot.find, [vehicle.id for vehicle in vehicles])
    ]
    manager.set_synchronous_mode(False)
    return [(frames[-1],), *moved]


def test_traffic_of_the_clients_own_manager_is_the_same_in_a_second_episode(
    simulator: RunningSimulator,
) -> None:
    first = run_trial(trial_of_traffic, simulator.port, timeout_s=90)
    second = run_trial(trial_of_traffic, simulator.port, timeout_s=90)
    assert any(speed > 1.0 for _, speed in first[1:])
    assert first == second
