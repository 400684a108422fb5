"""``carla.World``: time, settings, weather, spectator, actors, snapshots."""

from __future__ import annotations

import math
import threading
from typing import Any

import carla

from client_api.entries import limited, works
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect, look_at

_PRESETS = tuple(
    name
    for name, value in vars(carla.WeatherParameters).items()
    if isinstance(value, carla.WeatherParameters)
)
_WEATHER = (
    "cloudiness", "precipitation", "precipitation_deposits", "wind_intensity",
    "sun_azimuth_angle", "sun_altitude_angle", "fog_density", "fog_distance", "fog_falloff",
    "wetness", "scattering_intensity", "mie_scattering_scale", "rayleigh_scattering_scale",
    *(("dust_storm",) if has("WeatherParameters.dust_storm") else ()),
)  # fmt: skip


@works("World.tick", "World.wait_for_tick", "World.on_tick", "World.remove_on_tick")
def _ticking(scene: TrialScene) -> None:
    """A tick is one frame; callbacks and waiting threads get it, removed callbacks do not."""
    frames: list[int] = []
    waited: list[int] = []
    number = scene.world.on_tick(lambda snapshot: frames.append(snapshot.frame))
    waiter = threading.Thread(
        target=lambda: waited.append(scene.world.wait_for_tick(20.0).frame), daemon=True
    )
    first = scene.ticks()
    waiter.start()
    # The thread may begin to wait a frame late, so frames go on until it has one.
    scene.until(lambda: bool(waited), "wait_for_tick returns")
    last = scene.ticks(2)
    scene.until(lambda: last in frames, "on_tick is called")
    scene.world.remove_on_tick(number)
    received = len(frames)
    after = scene.ticks(3)
    expect(after == last + 3, f"three ticks led from frame {last} to {after}")
    expect(first in frames, "the first frame was received")
    expect(len(frames) <= received + 1, "a removed callback is not called")


@works("World.get_snapshot", "WorldSnapshot.*", "ActorSnapshot.*", "Timestamp.*", "World.id")
def _snapshots(scene: TrialScene) -> None:
    """The snapshot of a frame has its time and the motion of every actor."""
    car = scene.car()
    car.set_target_velocity(3.0 * car.get_transform().get_forward_vector())
    frame = scene.ticks()
    snapshot = scene.world.get_snapshot()
    expect(snapshot.frame == snapshot.frame_count == frame, "frame number")
    expect(snapshot.id == scene.world.id, "episode")
    expect(abs(snapshot.delta_seconds - 0.05) < 1e-6, f"step {snapshot.delta_seconds}")
    stamp = snapshot.timestamp
    expect(stamp.frame == stamp.frame_count == frame, "frame of the timestamp")
    expect(stamp.elapsed_seconds == snapshot.elapsed_seconds > 0.0, "elapsed time")
    expect(stamp.delta_seconds == snapshot.delta_seconds, "step of the timestamp")
    expect(stamp.platform_timestamp == snapshot.platform_timestamp > 0.0, "wall clock")
    expect(snapshot.has_actor(car.id) and not snapshot.has_actor(999_999), "has_actor")
    own = snapshot.find(car.id)
    expect(own.id == car.id and own.get_velocity().length() > 1.0, "it moves")
    expect(own.get_transform().location.distance(car.get_location()) < 1e-3, "it is where it is")
    for vector in (own.get_angular_velocity(), own.get_acceleration()):
        expect(math.isfinite(vector.length()), "finite motion")


@works("World.get_settings", "World.apply_settings", "WorldSettings.synchronous_mode",
       "WorldSettings.fixed_delta_seconds", "WorldSettings.substepping",
       "WorldSettings.max_substep_delta_time", "WorldSettings.max_substeps")  # fmt: skip
def _settings(scene: TrialScene) -> None:
    """The next frames last as long as the settings say."""
    before = scene.world.get_settings()
    settings = scene.world.get_settings()
    settings.fixed_delta_seconds = 0.1
    settings.substepping, settings.max_substeps = True, 16
    settings.max_substep_delta_time = 0.02
    scene.apply_settings(settings)
    try:
        scene.ticks()
        expect(abs(scene.world.get_snapshot().delta_seconds - 0.1) < 1e-6, "the step is longer")
        read = scene.world.get_settings()
        expect(read.synchronous_mode and read.max_substeps == 16, "settings read back")
        expect(abs(read.max_substep_delta_time - 0.02) < 1e-9, "substep reads back")
    finally:
        scene.apply_settings(before)
    scene.ticks(2)
    expect(abs(scene.world.get_snapshot().delta_seconds - 0.05) < 1e-6, "the step is back")


@works("WorldSettings.no_rendering_mode")
def _no_rendering(scene: TrialScene) -> None:
    """Cameras are silent while rendering is off, and send pictures afterwards."""
    above = carla.Transform(carla.Location(z=20.0))
    size = {"image_size_x": "64", "image_size_y": "48"}
    camera = scene.spawn("sensor.camera.rgb", above, None, **size)
    before, settings = scene.world.get_settings(), scene.world.get_settings()
    settings.no_rendering_mode = True
    scene.apply_settings(settings)
    images: list[int] = []
    camera.listen(lambda image: images.append(image.frame))
    last_without = scene.ticks(3)
    scene.apply_settings(before)
    scene.until(lambda: bool(images), "a picture after rendering was turned on")
    expect(min(images) > last_without, "a picture was sent while rendering was off")


@limited("Kept and read back; there is no culling, no tiles that sleep, and no ragdolls.",
         "WorldSettings.max_culling_distance", "WorldSettings.deterministic_ragdolls",
         "WorldSettings.tile_stream_distance", "WorldSettings.actor_active_distance",
         "WorldSettings.spectator_as_ego")  # fmt: skip
def _kept_settings(scene: TrialScene) -> None:
    before, settings = scene.world.get_settings(), scene.world.get_settings()
    settings.max_culling_distance, settings.deterministic_ragdolls = 50.0, True
    settings.tile_stream_distance, settings.actor_active_distance = 1000.0, 500.0
    follows = has("WorldSettings.spectator_as_ego")
    if follows:
        settings.spectator_as_ego = False
    scene.apply_settings(settings)
    read = scene.world.get_settings()
    scene.apply_settings(before)
    expect(read.max_culling_distance == 50.0 and read.deterministic_ragdolls, "first two")
    expect(read.tile_stream_distance == 1000.0, "tile_stream_distance")
    expect(read.actor_active_distance == 500.0, "actor_active_distance")
    expect(not (follows and read.spectator_as_ego), "spectator_as_ego")


@works("World.get_weather", "World.set_weather", *(f"WeatherParameters.{n}" for n in _PRESETS))
def _weather(scene: TrialScene) -> None:
    """Every preset reads back; noon is brighter than night, fog takes contrast."""
    for name in _PRESETS:
        preset = getattr(carla.WeatherParameters, name)
        scene.world.set_weather(preset)
        expect(scene.world.get_weather() == preset, f"{name} reads back differently")
    view = look_at(scene.place().location, 45.0, pitch_deg=50)  # all of it far: fog needs depth
    scene.world.set_weather(carla.WeatherParameters.ClearNoon)
    noon = scene.picture(view)
    scene.world.set_weather(carla.WeatherParameters.ClearNight)
    night = scene.picture(view)
    fog = carla.WeatherParameters.ClearNoon
    thick = carla.WeatherParameters(
        sun_altitude_angle=fog.sun_altitude_angle, fog_density=100.0, fog_distance=0.0
    )
    scene.world.set_weather(thick)
    foggy = scene.picture(view)
    scene.world.set_weather(carla.WeatherParameters.Default)
    expect(noon.mean() > night.mean() + 10.0, "night is not darker than noon")
    told = f"fog takes no contrast: {noon.contrast():.1f} became {foggy.contrast():.1f}"
    expect(foggy.contrast() < 0.8 * noon.contrast(), told)


@works(*(f"WeatherParameters.{name}" for name in _WEATHER))
def _weather_values(scene: TrialScene) -> None:
    """All are kept and read back; what each does to a picture, the tests of rendering see."""
    weather = carla.WeatherParameters()
    for number, name in enumerate(_WEATHER, start=1):
        setattr(weather, name, float(number))
    scene.world.set_weather(weather)
    read = scene.world.get_weather()
    scene.world.set_weather(carla.WeatherParameters.Default)
    for number, name in enumerate(_WEATHER, start=1):
        expect(getattr(read, name) == float(number), f"{name} is {getattr(read, name)}")


@works("World.get_spectator")
def _spectator(scene: TrialScene) -> None:
    """The spectator goes where it is put, and is one of the actors."""
    spectator = scene.world.get_spectator()
    before = spectator.get_transform()
    there = carla.Transform(carla.Location(5.0, 6.0, 40.0), carla.Rotation(pitch=-30.0, yaw=20.0))
    spectator.set_transform(there)
    scene.ticks()
    now = spectator.get_transform()
    spectator.set_transform(before)
    expect(now.location.distance(there.location) < 1e-3, f"it stands at {now.location}")
    expect(abs(now.rotation.yaw - 20.0) < 1e-3, "it looks elsewhere")
    expect(scene.world.get_actor(spectator.id).type_id == "spectator", "it is an actor")


@works("World.get_actor", "World.get_actors", "ActorList.*", "World.spawn_actor",
       "World.try_spawn_actor")  # fmt: skip
def _actors(scene: TrialScene) -> None:
    """A spawned car is found by id and filter; a second one in its place is refused."""
    place = scene.place()
    car = scene.spawn("vehicle.audi.tt", place)
    actors = scene.world.get_actors()
    expect(actors.find(car.id).id == car.id, "find")
    expect(car.id in [a.id for a in actors.filter("vehicle.audi.*")], "filter")
    expect(len(actors) == len(list(actors)) > 1 and actors[0].id > 0, "length and index")
    some = scene.world.get_actors([car.id, 999_999])
    expect([a.id for a in some] == [car.id], "get_actors of ids")
    expect(scene.world.get_actor(999_999) is None, "an unknown id")
    blueprint = scene.library.find("vehicle.audi.tt")
    expect(scene.world.try_spawn_actor(blueprint, place) is None, "try_spawn_actor on the car")
    try:
        scene.world.spawn_actor(blueprint, place)
    except RuntimeError as error:
        text = "Spawn failed because of collision at spawn position"
        expect(text in str(error), f"the error reads {error}")
    else:
        raise AssertionError("two cars in one place")


@works("World.get_imui_sensor_gravity", "World.set_imui_sensor_gravity")
def _imu_gravity(scene: TrialScene) -> None:
    """An IMU at rest feels the gravity that was set."""
    car = scene.car()
    imu = scene.spawn("sensor.other.imu", carla.Transform(), car)
    before = scene.world.get_imui_sensor_gravity()
    expect(abs(before - 9.81) < 0.02, f"gravity is {before}")
    scene.world.set_imui_sensor_gravity(3.7)
    try:
        expect(abs(scene.world.get_imui_sensor_gravity() - 3.7) < 1e-5, "reads back")
        felt: list[Any] = []
        imu.listen(lambda data: felt.append(data.accelerometer.z))
        scene.until(lambda: len(felt) > 6, "the IMU measures")
        expect(abs(felt[-1] - 3.7) < 0.3, f"the IMU feels {felt[-1]}")
    finally:
        scene.world.set_imui_sensor_gravity(before)


@limited("Accepted; semantic and instance pictures always show the first surface, glass included.",
         "World.set_annotations_traverse_translucency")  # fmt: skip
def _translucency(scene: TrialScene) -> None:
    scene.world.set_annotations_traverse_translucency(True)
    scene.world.set_annotations_traverse_translucency(False)
    scene.ticks()


@works("World.get_vehicles_light_states")
def _light_states(scene: TrialScene) -> None:
    """The lights of all vehicles, by id."""
    car = scene.car()
    lights = carla.VehicleLightState.LowBeam | carla.VehicleLightState.Position
    car.set_light_state(carla.VehicleLightState(lights))
    scene.ticks()
    states = scene.world.get_vehicles_light_states()
    expect(int(states[car.id]) == int(lights), f"{states.get(car.id)}")


@works("World.get_random_location_from_navigation", "World.set_pedestrians_seed",
       "World.set_pedestrians_cross_factor")  # fmt: skip
def _navigation(scene: TrialScene) -> None:
    """Random places lie on sidewalks and crosswalks; a seed repeats them."""

    def draw() -> list[Any]:
        scene.world.set_pedestrians_seed(11)
        return [scene.world.get_random_location_from_navigation() for _ in range(5)]

    scene.world.set_pedestrians_cross_factor(0.2)
    first, second = draw(), draw()
    expect(all(place is not None for place in first), "a place")
    apart = [a.distance(b) for a, b in zip(first, second)]
    expect(max(apart) < 1e-3, "the seed does not repeat the places")
    for place in first:
        ground = scene.world.ground_projection(place + carla.Location(z=2.0), 10.0)
        walkable = (carla.CityObjectLabel.Sidewalks, carla.CityObjectLabel.RoadLines,
                    carla.CityObjectLabel.Roads, carla.CityObjectLabel.Terrain,
                    carla.CityObjectLabel.Ground)  # fmt: skip
        expect(ground is not None and ground.label in walkable, f"{place} lies on {ground}")
