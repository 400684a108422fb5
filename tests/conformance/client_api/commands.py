"""``carla.command``: batches of commands."""

from __future__ import annotations

from typing import Any

import carla

from client_api.entries import client_side, works
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect

_C = carla.command


def _send(scene: TrialScene, *commands: Any) -> list[Any]:
    """Responses of one batch; every command must have succeeded."""
    responses = scene.client.apply_batch_sync(list(commands), False)
    failed = [r.error for r in responses if r.has_error()]
    expect(not failed, f"refused: {failed}")
    scene.ticks()
    return list(responses)


@works("Client.apply_batch", "Client.apply_batch_sync", "command.SpawnActor.*",
       "command.SetAutopilot.*", "command.DestroyActor.*", "command.Response.*")  # fmt: skip
def _spawning(scene: TrialScene) -> None:
    """Cars are spawned, driven off by what follows, given riders, and destroyed in batches."""
    port = scene.traffic_manager.get_port()
    blueprint, place = scene.library.find("vehicle.audi.tt"), scene.place()
    spawn = _C.SpawnActor(blueprint, place).then(_C.SetAutopilot(_C.FutureActor, True, port))
    (response,) = _send(scene, spawn)
    car = scene.world.get_actor(response.actor_id)
    scene.keep(car)
    scene.until(lambda: car.get_velocity().length() > 2.0, "it drives")
    sensor = scene.library.find("sensor.other.gnss")
    rider = _C.SpawnActor(sensor, carla.Transform(), car)
    expect(rider.transform == carla.Transform(), "the rider's place")
    # The wheel has no converter for what parent_id returns.
    expect(hasattr(_C.SpawnActor, "parent_id"), "parent_id")
    if has("command.SpawnActor.socket_name"):
        expect(rider.socket_name == "", "socket_name")
    (child,) = _send(scene, rider)
    expect(scene.world.get_actor(child.actor_id).parent.id == car.id, "the rider's parent")
    _send(scene, _C.SetAutopilot(car, False, port))
    refused = scene.client.apply_batch_sync([_C.DestroyActor(999_999)], False)[0]
    expect(refused.has_error() and "not found" in refused.error, f"answer {refused.error}")
    orphan = scene.client.apply_batch_sync([_C.SpawnActor(sensor, carla.Transform(), 999_999)])[0]
    expect("parent actor" in orphan.error, f"answer {orphan.error}")
    number = car.id
    _send(scene, _C.DestroyActor(child.actor_id), _C.DestroyActor(number))
    expect(scene.world.get_actors().find(number) is None, "it was not destroyed")
    scene.client.apply_batch([_C.DestroyActor(999_999)])
    for command in (_C.SetAutopilot(5, True, 8000), _C.DestroyActor(5)):
        expect(command.actor_id == 5, "actor_id")
    expect(_C.SetAutopilot(5, True, 8001).tm_port == 8001, "tm_port")


@works("command.ApplyVehicleControl.*", "command.ApplyVehicleAckermannControl.*",
       "command.ApplyVehiclePhysicsControl.*", "command.SetVehicleLightState.*")  # fmt: skip
def _driving(scene: TrialScene) -> None:
    """Pedals, a target speed, a mass and lights reach the car."""
    car = scene.car()
    _send(scene, _C.ApplyVehicleControl(car, carla.VehicleControl(throttle=0.5)))
    expect(abs(car.get_control().throttle - 0.5) < 1e-5, "throttle")
    physics = car.get_physics_control()
    physics.mass = 2500.0
    _send(scene, _C.ApplyVehiclePhysicsControl(car, physics))
    expect(abs(car.get_physics_control().mass - 2500.0) < 1e-2, "mass")
    brake = carla.VehicleLightState.Brake
    # Given an actor instead of its id, the wheel takes the state for a flag and sends 1.
    _send(scene, _C.SetVehicleLightState(car.id, int(brake)))
    expect(car.get_light_state() == brake, "lights")
    if not has("command.ApplyVehicleAckermannControl.control"):
        return
    _send(scene, _C.ApplyVehicleAckermannControl(car, carla.VehicleAckermannControl(speed=4.0)))
    scene.until(lambda: car.get_velocity().length() > 3.0, "4 m/s")


@works("command.ApplyWalkerControl.*", "command.ApplyWalkerState.*")
def _walking(scene: TrialScene) -> None:
    """A walker walks, and is put where a navigation wants it."""
    walker = scene.spawn("walker.pedestrian.0005")
    start = walker.get_location()
    control = carla.WalkerControl(carla.Vector3D(0.0, 1.0, 0.0), 2.0)
    _send(scene, _C.ApplyWalkerControl(walker, control))
    scene.ticks(20)
    expect(walker.get_location().distance(start) > 1.0, "it does not walk")
    there = carla.Transform(start + carla.Location(x=3.0))
    _send(scene, _C.ApplyWalkerState(walker, there, 1.0))
    placed = walker.get_location()
    expect(abs(placed.x - start.x - 3.0) < 0.3, f"it is at {placed}")


@works("command.ApplyTransform.*", "command.ApplyTargetVelocity.*",
       "command.ApplyTargetAngularVelocity.*", "command.ApplyImpulse.*", "command.ApplyForce.*",
       "command.ApplyAngularImpulse.*", "command.ApplyTorque.*", "command.SetSimulatePhysics.*",
       "command.SetEnableGravity.*")  # fmt: skip
def _moving(scene: TrialScene) -> None:
    """Poses, velocities and pushes move a car as the calls of the same names do."""
    car = scene.car()
    pose = scene.place()
    _send(scene, _C.SetSimulatePhysics(car, False), _C.ApplyTransform(car, pose))
    expect(car.get_location().distance(pose.location) < 1e-3, "pose")
    _send(scene, _C.SetSimulatePhysics(car, True), _C.SetEnableGravity(car, True))
    scene.ticks(10)
    forward = car.get_transform().get_forward_vector()
    _send(scene, _C.ApplyTargetVelocity(car, 6.0 * forward))
    expect(car.get_velocity().length() > 4.0, "velocity")
    _send(scene, _C.ApplyTargetAngularVelocity(car, carla.Vector3D(z=40.0)))
    expect(car.get_angular_velocity().z > 1.0, "spin")
    other = scene.car()
    mass = other.get_physics_control().mass
    forward = other.get_transform().get_forward_vector()
    _send(scene, _C.ApplyImpulse(other, 3.0 * mass * forward))
    pushed = other.get_velocity().length()
    expect(pushed > 1.5, f"an impulse for 3 m/s gave {pushed:.2f}")
    for _ in range(5):
        _send(scene, _C.ApplyForce(other, 12.0 * mass * forward))
    expect(other.get_velocity().length() > pushed + 1.0, "force")
    high = other.get_transform()
    high.location.z += 2.0
    _send(scene, _C.SetEnableGravity(other, False), _C.ApplyTransform(other, high))
    spun = []
    for command in (_C.ApplyAngularImpulse, _C.ApplyTorque):
        _send(scene, _C.ApplyTargetAngularVelocity(other, carla.Vector3D()))
        before = other.get_angular_velocity().z
        _send(scene, command(other, carla.Vector3D(z=9.0e8)))
        spun.append(other.get_angular_velocity().z - before)
    expect(spun[0] > 2.0 and spun[1] > 0.05, f"turns about the vertical axis gave {spun} deg/s")


@client_side("command.ShowDebugTelemetry.*")
def _telemetry(_stage: TrialScene) -> None:
    """The 0.9.16 wheel makes one and cannot put it into a batch, with any server."""
    expect(_C.ShowDebugTelemetry(5, True).actor_id == 5, "actor_id")
