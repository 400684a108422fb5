"""``carla.Vehicle``: driving, physics, lights, doors, wheels."""

from __future__ import annotations

import carla

from client_api.entries import limited, works
from client_api.picture import changed
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect, look_at


@works("Vehicle.apply_control", "Vehicle.get_control", "VehicleControl.*")
def _pedals(scene: TrialScene) -> None:
    """Throttle drives off, the brake stops, reverse backs up, steering turns; it reads back."""
    car = scene.car()
    forward = car.get_transform().get_forward_vector()
    car.apply_control(carla.VehicleControl(throttle=0.6))
    scene.ticks(40)
    speed = car.get_velocity()
    expect(speed.dot(forward) > 2.0, f"it drives at {speed.dot(forward):.2f} m/s")
    expect(abs(car.get_control().throttle - 0.6) < 1e-5, "throttle reads back")
    yaw = car.get_transform().rotation.yaw
    car.apply_control(carla.VehicleControl(throttle=0.4, steer=0.5))
    scene.ticks(20)
    turned = (car.get_transform().rotation.yaw - yaw + 180.0) % 360.0 - 180.0
    expect(turned > 2.0, f"steering right turned it by {turned:.1f} degrees")
    car.apply_control(carla.VehicleControl(brake=1.0, hand_brake=True))
    scene.ticks()  # who stands at a wall already needs no further one to stop
    scene.until(lambda: car.get_velocity().length() < 0.2, "the brake stops it")
    expect(car.get_control().hand_brake, "hand brake reads back")
    forward = car.get_transform().get_forward_vector()
    car.apply_control(carla.VehicleControl(throttle=0.6, reverse=True))
    scene.ticks(40)
    expect(car.get_velocity().dot(forward) < -0.5, "reverse backs up")
    expect(car.get_control().reverse, "reverse reads back")
    car.apply_control(carla.VehicleControl(manual_gear_shift=True, gear=2))
    scene.ticks()
    control = car.get_control()
    expect(control.manual_gear_shift and control.gear == 2, "gear reads back")


@works("Vehicle.apply_ackermann_control", "Vehicle.apply_ackermann_controller_settings",
       "Vehicle.get_ackermann_controller_settings")  # fmt: skip
def _ackermann(scene: TrialScene) -> None:
    """The car's own controller reaches the speed that is asked for; its gains read back."""
    car = scene.car()
    gains = car.get_ackermann_controller_settings()
    gains.speed_kp = 0.2
    car.apply_ackermann_controller_settings(gains)
    scene.ticks()
    read = car.get_ackermann_controller_settings()
    expect(abs(read.speed_kp - 0.2) < 1e-6, "gains read back")
    car.apply_ackermann_control(carla.VehicleAckermannControl(speed=5.0, acceleration=3.0))
    scene.until(lambda: abs(car.get_velocity().length() - 5.0) < 0.6, "5 m/s")


@limited("Mass, wheels, gears, torque and drag act; moments, damping, clutch and wheel sweep "
         "do not.",
         "Vehicle.get_physics_control", "Vehicle.apply_physics_control",
         "VehiclePhysicsControl.*")  # fmt: skip
def _physics_control(scene: TrialScene) -> None:
    car = scene.car()
    physics = car.get_physics_control()
    expect(physics.mass > 1000.0 and len(physics.wheels) == 4, "mass and wheels")
    expect(len(physics.forward_gears) > 0 and len(physics.torque_curve) > 1, "gears and torque")
    expect(len(physics.steering_curve) > 1, "steering curve")
    for name in vars(carla.VehiclePhysicsControl):
        if not name.startswith("__"):
            getattr(physics, name)
    physics.mass = 3000.0
    wheels = physics.wheels
    for wheel in wheels:
        wheel.tire_friction = 1.5
    physics.wheels = wheels
    car.apply_physics_control(physics)
    scene.ticks()
    read = car.get_physics_control()
    expect(abs(read.mass - 3000.0) < 1e-3, "mass reads back")
    expect(abs(read.wheels[0].tire_friction - 1.5) < 1e-5, "friction reads back")


@limited("Of a car on its way; wheels roll without slip and carry equal loads.",
         "Vehicle.get_telemetry_data", "VehicleTelemetryData.*")  # fmt: skip
def _telemetry(scene: TrialScene) -> None:
    """Speed, pedals and four wheels of a car on its way."""
    car = scene.car()
    car.apply_control(carla.VehicleControl(throttle=0.5))
    scene.ticks(30)
    data = car.get_telemetry_data()
    expect(abs(data.speed - car.get_velocity().length()) < 1.0, f"speed {data.speed}")
    expect(abs(data.throttle - 0.5) < 1e-3 and data.brake == data.steer == 0.0, "pedals")
    expect(data.engine_rpm > 0.0 and data.gear >= 1 and data.drag >= 0.0, "engine")
    expect(len(data.wheels) == 4 and data.wheels[0].omega > 0.0, "wheels")


@works("Vehicle.set_light_state", "Vehicle.get_light_state")
def _lights(scene: TrialScene) -> None:
    """Brake lights glow behind the car, headlights light the road by night."""
    car = scene.car()
    scene.world.set_weather(carla.WeatherParameters.ClearNight)
    state, yaw = carla.VehicleLightState, car.get_transform().rotation.yaw
    behind = look_at(car.get_location() + carla.Location(z=0.7), 6.0, yaw, 8.0)
    dark = scene.picture(behind)
    car.set_light_state(state.Brake)
    scene.ticks()
    expect(car.get_light_state() == state.Brake, "it reads back")
    glowing = scene.picture(behind)
    redder = sum(a - b > 40 for a, b in zip(glowing.red, dark.red))
    expect(redder >= 4, "no brake light is seen")
    car.set_light_state(state.NONE)
    unlit = scene.picture(behind).mean()
    car.set_light_state(carla.VehicleLightState(state.LowBeam | state.Position))
    lit = scene.picture(behind).mean()
    for light in (state.LeftBlinker, state.RightBlinker, state.Reverse, state.HighBeam):
        car.set_light_state(light)
        scene.ticks()
        expect(car.get_light_state() == light, f"{light} reads back")
    scene.world.set_weather(carla.WeatherParameters.Default)
    expect(lit > unlit + 0.5, f"the beam lights nothing: {unlit}, {lit}")


@limited("A leaf stands off the body on vehicles whose has_dynamic_doors is true; hood and trunk "
         "stay shut.", "Vehicle.open_door", "Vehicle.close_door")  # fmt: skip
def _doors(scene: TrialScene) -> None:
    car = scene.car("vehicle.lincoln.mkz_2020")
    yaw = car.get_transform().rotation.yaw
    beside = look_at(car.get_location() + carla.Location(z=0.8), 6.0, yaw + 90.0, 25.0)
    shut = scene.picture(beside, "depth")
    car.open_door(carla.VehicleDoor.All)
    scene.ticks()
    opened = scene.picture(beside, "depth")
    car.close_door(carla.VehicleDoor.All)
    scene.ticks()
    expect(changed(shut, opened) > 0.005, "no door is seen open")
    again = scene.picture(beside, "depth")
    expect(changed(shut, again) < changed(shut, opened) / 4, "the doors do not close")


@limited("Angles are kept and read back while the vehicle does not simulate physics, as in CARLA; "
         "they are not drawn.",
         "Vehicle.set_wheel_steer_direction", "Vehicle.get_wheel_steer_angle",
         "Vehicle.set_wheel_pitch_angle", "Vehicle.get_wheel_pitch_angle")  # fmt: skip
def _wheels(scene: TrialScene) -> None:
    car = scene.car()
    wheel = carla.VehicleWheelLocation.FL_Wheel
    car.apply_control(carla.VehicleControl(steer=0.5))
    scene.ticks(20)
    expect(car.get_wheel_steer_angle(wheel) > 5.0, "steering turns the front wheels")
    expect(car.get_wheel_steer_angle(carla.VehicleWheelLocation.BL_Wheel) == 0.0, "not the rear")
    car.set_simulate_physics(False)
    car.set_wheel_steer_direction(wheel, 12.0)
    scene.ticks()
    expect(abs(car.get_wheel_steer_angle(wheel) - 12.0) < 1e-3, "the posed angle reads back")
    if not has("Vehicle.set_wheel_pitch_angle"):
        return
    car.set_wheel_pitch_angle(wheel, 30.0)
    scene.ticks()
    expect(abs(car.get_wheel_pitch_angle(wheel) - 30.0) < 1e-3, "the posed pitch reads back")


@works("Vehicle.get_speed_limit", "Vehicle.get_traffic_light_state", "Vehicle.is_at_traffic_light",
       "Vehicle.get_traffic_light")  # fmt: skip
def _at_a_light(scene: TrialScene) -> None:
    """A car before a stop line knows its light and the light's state, and the lane's limit."""
    lights = scene.world.get_actors().filter("traffic.traffic_light")
    light = next(one for one in lights if one.get_stop_waypoints())
    stop = light.get_stop_waypoints()[0]
    before = (stop.previous(0.5) or [stop])[0].transform
    before.location.z += 0.3
    car = scene.spawn("vehicle.audi.tt", before)
    light.set_state(carla.TrafficLightState.Red)
    scene.ticks(2)
    expect(car.get_speed_limit() >= 20.0, f"limit {car.get_speed_limit()}")
    expect(car.is_at_traffic_light(), "it is not at the light")
    expect(car.get_traffic_light().id == light.id, "at another light")
    expect(car.get_traffic_light_state() == carla.TrafficLightState.Red, "its state")
    light.reset_group()


@works("Vehicle.set_autopilot")
def _autopilot(scene: TrialScene) -> None:
    """The client's Traffic Manager drives the car, and lets it go again."""
    car = scene.car()
    port = scene.traffic_manager.get_port()
    scene.traffic_manager.ignore_lights_percentage(car, 100.0)
    car.set_autopilot(True, port)
    scene.until(lambda: car.get_velocity().length() > 3.0, "it drives")
    car.set_autopilot(False, port)
    car.apply_control(carla.VehicleControl(brake=1.0))
    scene.until(lambda: car.get_velocity().length() < 0.2, "it is ours again")


@limited("Always NONE: nothing breaks here.", "Vehicle.get_failure_state")
def _failure(scene: TrialScene) -> None:
    expect(scene.car().get_failure_state() == carla.VehicleFailureState.NONE, "it failed")


@limited("Accepted: telemetry is drawn in a server's window, and this one has none.",
         "Vehicle.show_debug_telemetry")  # fmt: skip
def _debug_telemetry(scene: TrialScene) -> None:
    car = scene.car()
    car.show_debug_telemetry(True)
    car.show_debug_telemetry(False)
    scene.ticks()


@limited("As on a CARLA server that was built without CarSim and Chrono: the vehicle keeps its "
         "own physics.", "Vehicle.enable_carsim", "Vehicle.use_carsim_road",
         "Vehicle.enable_chrono_physics", "Vehicle.restore_physx_physics")  # fmt: skip
def _other_physics(scene: TrialScene) -> None:
    car = scene.car()
    car.enable_carsim("")
    car.use_carsim_road(False)
    car.enable_chrono_physics(5000, 0.002, "", "", "", "")
    if has("Vehicle.restore_physx_physics"):
        car.restore_physx_physics()
    car.apply_control(carla.VehicleControl(throttle=0.6))
    scene.ticks(30)
    expect(car.get_velocity().length() > 1.0, "it does not drive")


@works("Vehicle.get_vehicle_bone_world_transforms")
def _bones(scene: TrialScene) -> None:
    """Bones of a car lie within it."""
    car = scene.car()
    poses = list(car.get_vehicle_bone_world_transforms())
    expect(all(p.location.distance(car.get_location()) < 6.0 for p in poses), "far from the car")
