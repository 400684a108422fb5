"""The GPU back end sees what the CPU sees; here on a driver that computes on the CPU."""

from __future__ import annotations

import numpy as np
import pytest

import sensor_worlds
from benchmarks.simulator.conformance import MOST_COLOURS, Tally, compare_rays, random_frame
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.render.cast import NOTHING, STATIC
from carstage_sim.render.gpu.caster import GpuCaster
from carstage_sim.render.scene import SceneStore
from carstage_sim.sensors.world_sensors import WorldSensors
from carstage_sim.world.state import Weather
from carstage_sim.world.town_changes import TownChanges

pytestmark = pytest.mark.xdist_group("gpu")


@pytest.fixture(scope="module")
def suites(software_gpu):
    post = sensor_worlds.box(
        (4, 3, 0), (6, 5, 4), Material.METAL, CityObjectLabel.STATIC, object_id=7
    )
    town = sensor_worlds.town(sensor_worlds.GROUND, sensor_worlds.WALL, post)
    with (
        WorldSensors(town, threads=2) as cpu,
        WorldSensors(town, threads=2, gpu=software_gpu) as gpu,
    ):
        yield cpu, gpu


def test_ids_and_ranges_of_random_scenes_agree(software_gpu):
    tally = Tally()
    compare_rays(software_gpu, tally, seeds=(1, 2), rays=4000)
    assert all(figure.ok for figure in tally.figures()), tally


def test_a_scene_without_its_town_leaves_the_towns_copy_alone(software_gpu):
    frame = random_frame(3, triangles=300, instances=4)
    caster = GpuCaster(software_gpu, 1)
    rays = np.random.default_rng(3).normal(size=(500, 3)).astype(np.float32)
    before = caster.cast(frame.scene, np.zeros(3), rays, low=1e-3, high=100.0)
    alone = caster.cast(frame.only(np.arange(4) == 1), np.zeros(3), rays, low=1e-3, high=100.0)
    after = caster.cast(frame.scene, np.zeros(3), rays, low=1e-3, high=100.0)
    assert set(alone.row.tolist()) <= {-2, 1}
    assert (before.row == STATIC).any()
    assert before.triangle.tobytes() == after.triangle.tobytes()


def test_a_card_is_told_what_is_hidden_and_shown_again(software_gpu):
    store = SceneStore(sensor_worlds.WALL, lambda _key: sensor_worlds.WALL, cache=None)
    caster = GpuCaster(software_gpu, 1)
    ahead = np.array([[1.0, 0.1, 0.0], [1.0, -0.2, 0.1]], np.float32)

    def met(hidden):
        scene = store.frame([], TownChanges(hidden=frozenset(hidden))).scene
        return caster.cast(
            scene, np.array([0.0, 0.0, 2.0]), ahead, low=1e-3, high=100.0
        ).row.tolist()

    assert [met(()), met({5}), met(())] == [[STATIC] * 2, [NOTHING] * 2, [STATIC] * 2]


def test_pictures_of_all_kinds_agree(suites):
    kinds = ("rgb", "depth", "instance_segmentation", "normals", "optical_flow")
    requests = [
        sensor_worlds.request(f"camera.{kind}", 100 + k, image_size_x=320, image_size_y=192)
        for k, kind in enumerate(kinds)
    ]
    found = []
    for sensors in suites:
        for number in (1, 2):
            moved = (8.0, 1.0 + number * 0.2, 0.0)
            walked = (4.0, -1.2 + number * 0.25, 1.0)
            state = sensor_worlds.state(
                number,
                vehicles=[(7, moved, 40.0 + number)],
                walkers=[(8, walked, 90.0)],
                velocity=(0.0, 2.5, 0.0),
                sensors=[(100, (0.0, 0.0, 2.0), 0.0)],
                steer_deg=25.0,
                rolled_m=number * 0.3,
            )
            assert len(sensors.frame_of(state).actor_id) == 1 + 4 + 1, "wheels are instances"
            frames = dict(zip(kinds, sensors.capture(state, requests), strict=True))
        found.append({kind: frame for kind, (_, frame) in frames.items()})
    cpu, gpu = found
    tally = Tally()
    tally.pictures(*({k: one[k].pixels for k in kinds[:4]} for one in found))
    assert all(figure.ok for figure in tally.figures()[3:]), tally
    assert tally.colours < MOST_COLOURS * tally.pixels
    walker = cpu["instance_segmentation"].pixels[..., 1] == 8
    assert walker.sum() > 500
    assert np.ptp(cpu["optical_flow"].flow[walker], axis=0).min() > 0.02
    assert np.allclose(cpu["optical_flow"].flow, gpu["optical_flow"].flow, atol=1e-5)


def test_flow_is_since_each_cameras_own_last_picture(suites):
    """One camera of a pose looks at each tick, another at every second one."""
    flows = []
    for sensors in suites:
        sensors.reset()
        for tick in (1, 2, 3):
            turned = (0.0, float(tick), 0.0)
            cameras = [
                sensor_worlds.request("camera.optical_flow", 700, rotation_deg=turned),
                sensor_worlds.request(
                    "camera.optical_flow", 701, rotation_deg=turned, sensor_tick=0.2
                ),
            ]
            frames = sensors.capture(sensor_worlds.state(tick), cameras)
        flows.append([frame.flow for _, frame in frames])
    (each, second), card = flows
    assert np.median(second[..., 0] / each[..., 0]) == pytest.approx(2.0, abs=0.01)
    assert np.allclose(card, [each, second], atol=1e-5)


def test_a_wet_road_mirrors_the_same(suites):
    """Puddles and a film between stones, which bend what is mirrored."""
    wet = Weather(sun_altitude_angle=20.0, wetness=70.0, precipitation_deposits=40.0)
    request = sensor_worlds.request("camera.rgb", 600, image_size_x=320, image_size_y=192)
    pictures = []
    for sensors in suites:
        sensors.reset()
        state = sensor_worlds.state(1, vehicles=[(7, (8.0, 1.0, 0.0), 40.0)], weather=wet)
        ((_, frame),) = sensors.capture(state, [request])
        pictures.append(frame.pixels[..., :3].astype(int))
    cpu, card = pictures
    apart = abs(cpu - card).max(axis=-1)
    assert cpu[120:].std() > 5.0, "the road mirrors"
    assert (apart > 2).sum() < MOST_COLOURS * apart.size


def test_extra_rays_take_the_colours_that_they_take_on_the_cpu(software_gpu):
    """Right before a wall the ground is darker than a pixel away: lent colours show there."""
    road = sensor_worlds.box(
        (-60, -60, -0.01), (60, 60, 0.01), Material.ASPHALT, CityObjectLabel.ROADS, object_id=9
    )
    town = sensor_worlds.town(road, sensor_worlds.WALL)
    request = sensor_worlds.request("camera.rgb", 500, image_size_x=640, image_size_y=360)
    pixels = []
    for gpu in (None, software_gpu):
        with WorldSensors(town, threads=2, gpu=gpu) as sensors:
            ((_, frame),) = sensors.capture(sensor_worlds.state(1), [request])
            pixels.append(frame.pixels.astype(np.int16))
    cpu, card = pixels
    assert len(np.unique(cpu.reshape(-1, 4), axis=0)) > 200
    assert (np.abs(cpu - card).max(axis=-1) > 2).mean() < 2e-4


def test_surfaces_in_one_plane_win_the_same_pixels(software_gpu):
    """Which of the two is seen is decided by the last bit of the distance."""
    carpet = sensor_worlds.box(
        (3.07, -4.13, 0.0), (17.9, 5.3, 0.0), Material.METAL, CityObjectLabel.STATIC, object_id=9
    )
    town = sensor_worlds.town(sensor_worlds.GROUND, carpet)
    request = sensor_worlds.request(
        "camera.instance_segmentation",
        400,
        rotation_deg=(-7.3, 3.1, 1.7),
        image_size_x=320,
        image_size_y=192,
    )
    pixels = []
    for gpu in (None, software_gpu):
        with WorldSensors(town, threads=2, gpu=gpu) as sensors:
            ((_, frame),) = sensors.capture(sensor_worlds.state(1), [request])
            pixels.append(frame.pixels)
    cpu, card = pixels
    seen = {tuple(pixel) for pixel in cpu.reshape(-1, 4).tolist()}
    assert len(seen) >= 3, "sky, ground and carpet"
    assert np.array_equal(cpu, card)


def test_semantic_lidars_agree_and_frames_repeat_to_the_byte(suites):
    request = sensor_worlds.request("lidar.ray_cast_semantic", 300, range=80)
    state = sensor_worlds.state(1, vehicles=[(7, (8.0, 1.0, 0.0), 40.0)])
    points = []
    for sensors in (*suites, suites[1]):
        sensors.reset()
        ((_, frame),) = sensors.capture(state, [request])
        points.append(frame.points)
    cpu, gpu, again = points
    assert gpu.tobytes() == again.tobytes()
    assert (cpu["object_idx"] == gpu["object_idx"]).mean() > 0.9999
    assert np.allclose(cpu["x"], gpu["x"], atol=1e-3)


def test_effects_of_lens_and_sensor_are_those_of_the_cpu(suites):
    effects = {"shutter_blur": "true", "shutter_speed": 30, "sensor_noise": "true"}
    bright = {"exposure_mode": "manual", "exposure_compensation": 4.0}
    size = {"image_size_x": 320, "image_size_y": 192}
    state = sensor_worlds.state(1, vehicles=[(7, (8.0, 1.0, 0.0), 40.0)], velocity=(0.0, 6.0, 0.0))
    pictures = []
    for sensors in suites:
        sensors.reset()
        asked = [
            sensor_worlds.request("camera.rgb", 500, **size, **bright, bloom_intensity=0),
            sensor_worlds.request("camera.rgb", 501, **size, **bright, **effects),
        ]
        pictures.append([frame.pixels for _, frame in sensors.capture(state, asked)])
    (plain, cpu), (_, card) = pictures
    assert (plain[..., :3] >= 240).any(), "something is brighter than white"
    assert (cpu != plain).any(axis=-1).mean() > 0.5
    apart = abs(cpu.astype(int) - card).max(axis=-1)
    assert (apart > 2).sum() < MOST_COLOURS * apart.size
