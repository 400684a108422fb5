"""The recorder, bones and attachments as the unmodified wheel uses them."""

from __future__ import annotations

import socket
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.ticking import WatchedClock
from carstage.collector.internals.traffic_manager_wakeup import started_threads

if TYPE_CHECKING:
    from running_simulator import RunningSimulator

pytestmark = pytest.mark.end_to_end

TICKS = 100
KEPT: list[Any] = []
"""Of the client process: the wheel may abort when its last object goes."""


def connect(port: int) -> tuple[Any, Any]:
    """A client and the world of a new synchronous episode."""
    import carla

    client = carla.Client("127.0.0.1", port)
    client.set_timeout(60.0)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = 0.05
    world.apply_settings(settings)
    KEPT.append(client.reload_world(False))
    return client, KEPT[-1]


def free_port() -> int:
    """A port that nothing listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def places(world: Any) -> dict[int, tuple[float, float, float, float]]:
    """Poses of all vehicles and walkers in the last snapshot."""
    found = {}
    for actor in world.get_actors():
        if actor.type_id.startswith(("vehicle.", "walker.")):
            pose = actor.get_transform()
            location = pose.location
            found[actor.id] = (location.x, location.y, location.z, pose.rotation.yaw)
    return found


def trial_of_a_recording(port: int, tm_port: int) -> dict[str, Any]:
    import carla

    client, world = connect(port)
    library = world.get_blueprint_library()
    points = world.get_map().get_spawn_points()
    with started_threads() as threads:
        manager = client.get_trafficmanager(tm_port)
    manager.set_synchronous_mode(True)
    manager.set_random_device_seed(3)
    world.tick()
    cars = [
        world.spawn_actor(library.find("vehicle.tesla.model3"), points[k]) for k in (0, 20, 40, 60)
    ]
    for car in cars:
        car.set_autopilot(True, manager.get_port())
    walkers, controllers = [], []
    for _ in range(3):
        place = carla.Transform(world.get_random_location_from_navigation())
        place.location.z += 1.0
        walker = world.try_spawn_actor(library.find("walker.pedestrian.0004"), place)
        if walker is not None:
            walkers.append(walker)
            controllers.append(
                world.spawn_actor(
                    library.find("controller.ai.walker"), carla.Transform(), attach_to=walker
                )
            )
    world.tick()
    for controller in controllers:
        controller.start()
        controller.go_to_location(world.get_random_location_from_navigation())
    path = str(Path(tempfile.mkdtemp()) / "traffic.log")
    answered = client.start_recorder(path, True)
    recorded = []
    with WatchedClock(world, tm_port, threads) as clock:
        for _ in range(TICKS):
            clock.tick()
            recorded.append(places(world))
    client.stop_recorder()
    texts = {
        "info": client.show_recorder_file_info(path, False),
        "collisions": client.show_recorder_collisions(path, "v", "a"),
        "blocked": client.show_recorder_actors_blocked(path, 1.0, 100.0),
        "missing": client.show_recorder_file_info("nothing-there.log", False),
    }
    try:
        client.start_recorder("../outside.log")
        texts["outside"] = "accepted"
    except RuntimeError as error:
        texts["outside"] = str(error)
    return {
        "answered": answered.endswith(f"/recordings{path}") and not Path(path).exists(),
        "path": answered,
        "recorded": recorded,
        "texts": texts,
        "ids": ([car.id for car in cars], [walker.id for walker in walkers]),
    }


def trial_of_a_replay(port: int, path: str, follow_id: int) -> dict[str, Any]:
    import carla

    client, world = connect(port)
    client.replay_file(path, 1.0, 2.0, 0)
    world.tick()
    brought = len(places(world))
    client.stop_replayer(False)
    world.tick()
    left = len(places(world))
    world = client.reload_world(False)
    KEPT.append(world)
    text = client.replay_file(path, 0.0, 0.0, follow_id)
    replayed = []
    for _ in range(TICKS - 1):
        world.tick()
        replayed.append(places(world))
    spectator = world.get_spectator().get_transform().location
    followed = spectator.distance(carla.Location(*replayed[-1][follow_id][:3]))
    return {
        "replayed": replayed, "text": text, "followed": followed, "stopped": (brought, left)
    }  # fmt: skip


def test_a_recording_of_traffic_replays_within_a_centimetre(simulator: RunningSimulator) -> None:
    found = run_trial(trial_of_a_recording, simulator.port, free_port(), timeout_s=240)
    cars, walkers = found["ids"]
    again = run_trial(trial_of_a_replay, simulator.port, found["path"], cars[0], timeout_s=240)
    assert found["answered"]
    for recorded, replayed in zip(found["recorded"][1:], again["replayed"], strict=True):
        assert replayed.keys() == recorded.keys()
        for actor_id, pose in recorded.items():
            assert replayed[actor_id][:3] == pytest.approx(pose[:3], abs=0.01)
            assert (replayed[actor_id][3] - pose[3] + 180.0) % 360.0 - 180.0 == pytest.approx(
                0.0, abs=0.05
            )
    first, last = found["recorded"][0], found["recorded"][-1]
    moved = [
        sum((a - b) ** 2 for a, b in zip(first[k][:2], last[k][:2], strict=True)) ** 0.5
        for k in [*cars, *walkers]
    ]
    assert sorted(moved)[1] > 1.0  # nearly all of them went somewhere
    texts = found["texts"]
    for actor_id in [*cars, *walkers]:
        assert f" Create {actor_id}: " in texts["info"]
    assert f"\nFrames: {TICKS}\n" in texts["info"]
    assert texts["collisions"].splitlines()[4].split()[:2] == ["Time", "Types"]
    assert texts["blocked"].splitlines()[4].split()[:2] == ["Time", "Id"]
    assert texts["missing"].endswith("nothing-there.log not found on server\n")
    assert "leads out of" in texts["outside"]
    assert "Replaying from 0 s - 4.95 s (4.95 s) at 1.0x\n" in again["text"]
    assert again["followed"] == pytest.approx((10.0**2 + 5.0**2) ** 0.5, abs=1.0)
    assert again["stopped"] == (len(cars) + len(walkers), 0)


def trial_of_bones(port: int) -> dict[str, Any]:
    import carla

    _, world = connect(port)
    library = world.get_blueprint_library()
    place = world.get_map().get_spawn_points()[0]
    walker = world.spawn_actor(library.find("walker.pedestrian.0001"), place)
    world.tick()
    before = {bone.name: bone for bone in walker.get_bones().bone_transforms}
    control = carla.WalkerBoneControlIn()
    raised = before["crl_arm__R"].relative
    raised.rotation.pitch += 90.0
    control.bone_transforms = [("crl_arm__R", raised)]
    walker.set_bones(control)
    walker.show_pose()
    world.tick()
    shown = {bone.name: bone for bone in walker.get_bones().bone_transforms}
    walker.hide_pose()
    world.tick()
    hidden = {bone.name: bone for bone in walker.get_bones().bone_transforms}
    camera = world.spawn_actor(
        library.find("sensor.camera.rgb"),
        carla.Transform(),
        attach_to=walker,
        attachment_type=carla.AttachmentType.Rigid,
        bone="crl_Head__C",
    )
    world.tick()
    head = hidden["crl_Head__C"].world.location
    car = world.spawn_actor(
        library.find("vehicle.tesla.model3"), world.get_map().get_spawn_points()[20]
    )
    behind = world.spawn_actor(
        library.find("sensor.camera.rgb"),
        carla.Transform(carla.Location(x=-5.5, z=2.5), carla.Rotation(pitch=8.0)),
        attach_to=car,
        attachment_type=carla.AttachmentType.SpringArmGhost,
    )
    world.tick()
    return {
        "names": [bone.name for bone in walker.get_bones().bone_transforms],
        "hand_moved": before["crl_hand__R"].world.location.distance(
            shown["crl_hand__R"].world.location
        ),
        "hand_back": before["crl_hand__R"].world.location.distance(
            hidden["crl_hand__R"].world.location
        ),
        "head_above": before["crl_Head__C"].world.location.z - before["crl_root"].world.location.z,
        "camera_at_head": camera.get_transform().location.distance(head),
        "car_bones": (car.get_bone_names(), len(car.get_bone_world_transforms())),
        "car_sockets": len(car.get_socket_relative_transforms()),
        "components": car.get_component_names(),
        "lamp": car.get_component_world_transform("front-blinker-r-1").location.distance(
            car.get_location()
        ),
        "behind_pitch": behind.get_transform().rotation.pitch,
    }


def test_bones_sockets_and_spring_arms_answer_the_client(simulator: RunningSimulator) -> None:
    found = run_trial(trial_of_bones, simulator.port, timeout_s=120)
    assert len(found["names"]) == 66
    assert found["names"][0] == "crl_root"
    assert found["hand_moved"] > 0.3
    assert found["hand_back"] < 0.001
    assert 1.3 < found["head_above"] < 1.8
    assert found["camera_at_head"] < 0.01
    names, count = found["car_bones"]
    assert names[0] == "Vehicle_Base"
    assert len(names) == count == found["car_sockets"] == 5
    assert "VehicleMesh" in found["components"]
    assert 1.5 < found["lamp"] < 3.0
    assert found["behind_pitch"] == pytest.approx(-24.4 + 8.0, abs=0.5)
