"""``carla.Actor``: what holds for every actor."""

from __future__ import annotations

import carla

from client_api.entries import limited, works
from client_api.trial_scene import CAR_LABEL, TrialScene, expect


@works("Actor.id", "Actor.type_id", "Actor.parent", "Actor.semantic_tags", "Actor.attributes",
       "Actor.bounding_box", "Actor.get_world", "Actor.actor_state", "Actor.is_alive",
       "Actor.is_active", "Actor.destroy")  # fmt: skip
def _what_it_is(scene: TrialScene) -> None:
    """A car has its blueprint's box, tags and attributes; destroyed, it is gone for all."""
    car = scene.car()
    sensor = scene.spawn("sensor.other.gnss", carla.Transform(), car)
    expect(car.id > 0 and car.type_id == "vehicle.tesla.model3", "id and type")
    expect(sensor.parent.id == car.id and car.parent is None, "parent")
    expect(list(car.semantic_tags) == [int(CAR_LABEL)], "tags")
    expect(car.attributes["base_type"] == "car", "attributes")
    expect(abs(car.bounding_box.extent.x - 2.396) < 0.01, "box")
    expect(car.get_world().id == scene.world.id, "world")
    expect(car.actor_state == carla.ActorState.Active and car.is_active, "active")
    number = car.id
    expect(car.is_alive and car.destroy(), "destroy")
    scene.ticks(2)
    expect(not car.is_alive, "is_alive after destroy")
    expect(scene.world.get_actors().find(number) is None, "it is still found")
    try:
        car.set_location(carla.Location())
    except RuntimeError as error:
        expect("destroyed actor" in str(error), f"the error reads {error}")
    else:
        raise AssertionError("a destroyed car took a command")


@limited("Never true: no map here has tiles that send actors to sleep.", "Actor.is_dormant")
def _dormant(scene: TrialScene) -> None:
    expect(not scene.car().is_dormant, "a car sleeps")


@works("Actor.get_location", "Actor.get_transform", "Actor.set_location", "Actor.set_transform")
def _placing(scene: TrialScene) -> None:
    """A car is put elsewhere, turned, and stays there."""
    car = scene.car()
    car.set_simulate_physics(False)
    there = carla.Transform(scene.place().location, carla.Rotation(yaw=33.0))
    car.set_transform(there)
    scene.ticks()
    expect(car.get_transform().location.distance(there.location) < 1e-3, "place")
    expect(abs(car.get_transform().rotation.yaw - 33.0) < 1e-3, "heading")
    car.set_location(there.location + carla.Location(z=3.0))
    scene.ticks()
    expect(abs(car.get_location().z - there.location.z - 3.0) < 1e-3, "set_location")
    expect(abs(car.get_transform().rotation.yaw - 33.0) < 1e-3, "it keeps its heading")


@works("Actor.get_velocity", "Actor.get_angular_velocity", "Actor.get_acceleration",
       "Actor.set_target_velocity", "Actor.set_target_angular_velocity",
       "Actor.enable_constant_velocity", "Actor.disable_constant_velocity")  # fmt: skip
def _velocities(scene: TrialScene) -> None:
    """A car moves at the velocity that is set, spins, holds a constant velocity, and lets go."""
    car = scene.car()
    forward = car.get_transform().get_forward_vector()
    car.set_target_velocity(5.0 * forward)
    scene.ticks()
    expect(abs(car.get_velocity().length() - 5.0) < 1.0, f"{car.get_velocity().length()} m/s")
    car.set_target_angular_velocity(carla.Vector3D(0.0, 0.0, 40.0))
    scene.ticks()
    expect(car.get_angular_velocity().z > 1.0, f"spin {car.get_angular_velocity().z}")
    expect(car.get_acceleration().length() > 0.0, "no acceleration")
    car.apply_control(carla.VehicleControl(brake=1.0))
    car.enable_constant_velocity(carla.Vector3D(4.0, 0.0, 0.0))
    scene.ticks(20)
    held = car.get_velocity().length()
    car.disable_constant_velocity()
    scene.ticks(40)
    expect(abs(held - 4.0) < 0.3, f"held {held} m/s against the brake")
    expect(car.get_velocity().length() < 0.5, "the brake has no effect afterwards")


@works("Actor.add_impulse", "Actor.add_force")
def _pushes(scene: TrialScene) -> None:
    """An impulse changes the speed by impulse over mass, a force by force times time over mass."""
    car = scene.car()
    car.apply_control(carla.VehicleControl(gear=0, manual_gear_shift=True))
    mass = car.get_physics_control().mass
    forward = car.get_transform().get_forward_vector()
    scene.ticks(2)
    car.add_impulse(4.0 * mass * forward)
    scene.ticks()
    pushed = car.get_velocity().length()
    expect(abs(pushed - 4.0) < 1.0, f"an impulse for 4 m/s gave {pushed:.2f}")
    for _ in range(10):
        car.add_force(8.0 * mass * forward)
        scene.ticks()
    gained = car.get_velocity().length() - pushed
    expect(abs(gained - 8.0 * 0.5) < 1.5, f"a force for 4 m/s gave {gained:.2f}")


@works("Actor.add_angular_impulse", "Actor.add_torque")
def _turns(scene: TrialScene) -> None:
    """A push about the vertical axis turns a car."""
    car = scene.car()
    for push in (car.add_angular_impulse, car.add_torque):
        # Unreal counts in kg cm^2 degrees per second.
        push(carla.Vector3D(0.0, 0.0, 9.0e8))
        scene.ticks()
        spin = car.get_angular_velocity().z
        expect(spin > 2.0, f"{push.__name__} gave it {spin:.2f} deg/s")
        scene.ticks(20)


@works("Actor.set_simulate_physics", "Actor.set_enable_gravity")
def _physics_switch(scene: TrialScene) -> None:
    """Without physics a car hangs in the air; with it, it falls, unless gravity is off."""
    car = scene.car()
    high = car.get_transform()
    ground = high.location.z
    high.location.z += 3.0
    car.set_simulate_physics(False)
    car.set_transform(high)
    scene.ticks(10)
    expect(abs(car.get_location().z - high.location.z) < 0.01, "it fell without physics")
    car.set_enable_gravity(False)
    car.set_simulate_physics(True)
    scene.ticks(10)
    expect(car.get_location().z > ground + 2.0, "it fell without gravity")
    car.set_enable_gravity(True)
    scene.ticks(40)
    expect(abs(car.get_location().z - ground) < 0.3, "it did not fall to the road")


@works("Actor.set_collisions")
def _collisions_switch(scene: TrialScene) -> None:
    """Through a car without collisions another one drives."""
    car = scene.car()
    wall = scene.spawn("vehicle.carlamotors.carlacola", _ahead(car, 12.0))
    wall.set_simulate_physics(False)
    wall.set_collisions(False)
    car.enable_constant_velocity(carla.Vector3D(10.0, 0.0, 0.0))
    start = car.get_location()
    scene.ticks(40)
    way = car.get_location().distance(start)
    expect(way > 17.0, f"it came {way:.1f} m far")


def _ahead(car: carla.Vehicle, distance_m: float) -> carla.Transform:
    pose = car.get_transform()
    pose.location += distance_m * pose.get_forward_vector() + carla.Location(z=0.3)
    return pose


@works("Actor.get_component_names", "Actor.get_component_world_transform",
       "Actor.get_component_relative_transform", "Actor.get_bone_names",
       "Actor.get_bone_world_transforms", "Actor.get_bone_relative_transforms",
       "Actor.get_socket_names", "Actor.get_socket_world_transforms",
       "Actor.get_socket_relative_transforms")  # fmt: skip
def _parts(scene: TrialScene) -> None:
    """A walker's bones have names and poses near it; as many poses as names."""
    walker = scene.spawn("walker.pedestrian.0001", scene.place())
    here = walker.get_location()
    names = list(walker.get_bone_names())
    poses = list(walker.get_bone_world_transforms())
    expect(len(names) == len(poses) == len(list(walker.get_bone_relative_transforms())), "bones")
    expect(len(names) > 10, f"{len(names)} bones")
    expect(max(pose.location.distance(here) for pose in poses) < 3.0, "bones far from the walker")
    car = scene.car()
    components = list(car.get_component_names())
    expect(len(components) > 0, "a car has no components")
    pose = car.get_component_world_transform(components[0])
    expect(pose.location.distance(car.get_location()) < 5.0, "a component far from its car")
    car.get_component_relative_transform(components[0])
    sockets = list(car.get_socket_names())
    expect(len(sockets) == len(list(car.get_socket_world_transforms())), "sockets")
    expect(len(sockets) == len(list(car.get_socket_relative_transforms())), "sockets' own poses")
