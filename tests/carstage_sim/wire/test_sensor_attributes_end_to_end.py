"""Odd attributes of sensors by the real client: what is refused, and what CARLA takes as it is.

CARLA checks none of them: what it cannot work with ends it (a ``check`` in the engine) or gives
nonsense. That is refused here. What it can work with does here what it does there.
"""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING, Any

import pytest

from benchmarks.simulator.client_process import run_trial

if TYPE_CHECKING:
    from running_simulator import RunningSimulator

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("sensor attributes")]

KEPT: list[Any] = []
"""Of the client process: the wheel may abort when its last object goes while a stream closes."""

CAMERA, DVS = "sensor.camera.depth", "sensor.camera.dvs"
LIDAR, SEMANTIC = "sensor.lidar.ray_cast", "sensor.lidar.ray_cast_semantic"
RADAR, OBSTACLE = "sensor.other.radar", "sensor.other.obstacle"
IMU, GNSS = "sensor.other.imu", "sensor.other.gnss"

Case = tuple[str, str, str]
"""A sensor, an attribute, its value."""

REFUSED: dict[Case, str] = {
    **{(CAMERA, side, value): side for side in ("image_size_x", "image_size_y")
       for value in ("0", "-1", "100000", "2147483647")},
    **{(CAMERA, "fov", value): "fov" for value in ("0", "-90", "180", "360", "1e30")},
    **{(kind, "channels", value): "channels" for kind in (LIDAR, SEMANTIC)
       for value in ("0", "-3", "100000")},
    **{(kind, "range", "-5"): "range" for kind in (LIDAR, SEMANTIC, RADAR)},
    **{(kind, "points_per_second", value): "points_per_second" for kind in (LIDAR, RADAR)
       for value in ("-1", "2147483647")},
    (LIDAR, "rotation_frequency", "1e9"): "rotation_frequency",
    (LIDAR, "horizontal_fov", "0"): "horizontal_fov",
    (LIDAR, "horizontal_fov", "-90"): "horizontal_fov",
    (LIDAR, "upper_fov", "200"): "upper_fov",
    (LIDAR, "noise_stddev", "-1"): "noise_stddev",
    (RADAR, "horizontal_fov", "180"): "horizontal_fov",
    (RADAR, "vertical_fov", "-1"): "vertical_fov",
    (OBSTACLE, "distance", "-1"): "distance",
    (OBSTACLE, "hit_radius", "-1"): "hit_radius",
    (DVS, "positive_threshold", "0"): "positive_threshold",
    (DVS, "negative_threshold", "1e-30"): "negative_threshold",
    (DVS, "log_eps", "0"): "log_eps",
    (IMU, "noise_gyro_stddev_x", "-1"): "standard deviations",
    (GNSS, "noise_alt_stddev", "-1"): "standard deviations",
    **{(kind, "sensor_tick", value): "sensor_tick" for kind in (CAMERA, LIDAR, IMU)
       for value in ("nan", "inf", "-inf")},
    **{(LIDAR, name, "nan"): name for name in ("range", "upper_fov", "rotation_frequency")},
    (CAMERA, "fov", "nan"): "fov",
    (GNSS, "noise_lat_bias", "inf"): "noise_lat_bias",
}  # fmt: skip
"""And the word of the refusal that names the attribute."""

TAKEN: list[Case] = [
    *((kind, "sensor_tick", value) for kind in (CAMERA, LIDAR, IMU, GNSS, RADAR)
      for value in ("-1", "0", "1e-30", "1e-9")),
    *((LIDAR, "rotation_frequency", value) for value in ("0", "-10")),
    *((kind, "points_per_second", "0") for kind in (LIDAR, SEMANTIC, RADAR)),
    *((kind, "range", value) for kind in (LIDAR, SEMANTIC, RADAR) for value in ("0", "1e30")),
    (LIDAR, "channels", "1"),
    (LIDAR, "noise_stddev", "1e30"),
    (CAMERA, "image_size_x", "1"),
    (CAMERA, "fov", "179.99"),
    (CAMERA, "fov", "0.001"),
    (CAMERA, "lens_k", "1e30"),
    (RADAR, "horizontal_fov", "0"),
    (IMU, "noise_accel_stddev_x", "1e30"),
    (GNSS, "noise_lat_bias", "1e30"),
]  # fmt: skip
"""A frame comes in every tick."""

WITHOUT_POINTS = {("range", "0"), ("points_per_second", "0")}


def trial_of_all(port: int) -> tuple[dict[Case, str], dict[Case, list[int]], bool]:
    """Refusals by case, measurements of each of two ticks by case, and whether the world lives.

    A picture has its pixels, what has no length counts as 1.
    """
    import carla

    client = carla.Client("127.0.0.1", port)
    client.set_timeout(30.0)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.1
    world.apply_settings(settings)
    world = client.reload_world(False)
    KEPT.extend((client, world))
    library = world.get_blueprint_library()
    pose = carla.Transform(carla.Location(x=0.0, y=0.0, z=2.0))
    spawned: dict[Case, Any] = {}
    refusals: dict[Case, str] = {}
    for case in [*REFUSED, *TAKEN, (OBSTACLE, "distance", "0"), (OBSTACLE, "hit_radius", "1e30")]:
        type_id, name, value = case
        blueprint = library.find(type_id)
        try:
            blueprint.set_attribute(name, value)
            if type_id == CAMERA and name != "image_size_x":
                blueprint.set_attribute("image_size_x", "32")
            spawned[case] = world.spawn_actor(blueprint, pose)
        except (RuntimeError, ValueError) as error:  # the server, or the client itself
            refusals[case] = str(error)
    arrived: dict[Case, queue.Queue[Any]] = {case: queue.Queue() for case in spawned}
    for case, sensor in spawned.items():
        sensor.listen(arrived[case].put)
    sizes: dict[Case, list[int]] = {case: [] for case in spawned}
    for _ in range(2):
        frame = world.tick()
        for case in spawned.keys() & set(TAKEN):
            measurement = arrived[case].get(timeout=30.0)
            assert measurement.frame == frame, case
            sizes[case].append(len(measurement) if hasattr(measurement, "__len__") else 1)
    for sensor in spawned.values():
        sensor.stop()
        sensor.destroy()
    return refusals, sizes, world.tick() > frame


@pytest.fixture(scope="module")
def outcome(simulator: RunningSimulator) -> Any:
    return run_trial(trial_of_all, simulator.port, timeout_s=300.0)


def test_what_no_sensor_can_work_with_is_refused_by_its_name(outcome: Any) -> None:
    refusals, sizes, _ = outcome
    assert set(REFUSED) <= set(refusals), sorted(set(REFUSED) - set(refusals))
    unnamed = {case: refusals[case] for case, word in REFUSED.items() if word not in refusals[case]}
    assert not unnamed
    assert set(sizes) >= set(TAKEN), {case: refusals[case] for case in set(TAKEN) & set(refusals)}


def test_what_carla_takes_gives_a_frame_in_every_tick(outcome: Any) -> None:
    _, sizes, lives = outcome
    assert {case: len(sizes[case]) for case in TAKEN} == dict.fromkeys(TAKEN, 2)
    assert lives


def test_without_range_or_points_there_are_frames_without_points(outcome: Any) -> None:
    _, sizes, _ = outcome
    for case in TAKEN:
        if case[1:] in WITHOUT_POINTS:
            assert sizes[case] == [0, 0], case
        elif case[0] == LIDAR:
            assert min(sizes[case]) > 0, case
