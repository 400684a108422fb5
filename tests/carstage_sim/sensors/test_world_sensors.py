"""One capture per tick: shared casts, sensor_tick, memory between ticks, same bytes every time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.content.walking import WALK_PHASES
from carstage_sim.mesh import TriangleMesh
from carstage_sim.render.shared_kernels import share_shade_packets
from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.looping import Looping
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.world.town_changes import TownChanges
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

_KINDS = (
    "rgb",
    "depth",
    "semantic_segmentation",
    "instance_segmentation",
    "normals",
    "optical_flow",
)
_LIDAR = {"channels": 8, "points_per_second": 8000, "range": 60.0}


@pytest.fixture(scope="module")
def trees(tmp_path_factory):
    return tmp_path_factory.mktemp("trees")


@pytest.fixture
def sensors(trees):
    with WorldSensors(town(GROUND, WALL), threads=1, cache=trees) as built:
        yield built


def rig():
    cameras = [request(f"camera.{kind}", 10 + k) for k, kind in enumerate(_KINDS)]
    others = [
        request("lidar.ray_cast", 20, **_LIDAR),
        request("other.imu", 21),
        request("other.gnss", 22),
        request("lidar.ray_cast_semantic", 23, **_LIDAR),
        request("other.radar", 24),
        request("other.radar_rcs", 26),
        request("lidar.ray_cast_flash", 27),
        request("other.obstacle", 25, distance=30.0),
    ]
    return cameras + others


WORLD = {"vehicles": [(3, (6.0, 1.0, 0.0), 30.0), (4, (5.0, -4.0, 0.0), 90.0)]}


def moving(frame):
    """The vehicles of WORLD on their way."""
    return state(
        frame,
        vehicles=[
            (i, (x + 0.2 * frame, y, z), yaw + frame) for i, (x, y, z), yaw in WORLD["vehicles"]
        ],
    )


def test_a_scene_made_ahead_is_the_one_that_is_drawn_and_changes_nothing_before(sensors):
    now, coming = moving(1), moving(2)
    before = bytes_of(sensors.capture(now, rig()))
    sensors.prepare(coming)
    assert bytes_of(sensors.capture(now, rig())) == before
    sensors.prepare(coming)
    prepared = sensors._prepared[1]
    assert sensors.frame_of(coming) is prepared
    assert sensors.frame_of(coming) is not prepared


def test_a_scene_in_which_the_town_looks_otherwise_is_not_made_ahead(sensors):
    now = replace(moving(1), town_changes=TownChanges())
    sensors.frame_of(now)
    sensors.prepare(replace(moving(2), town_changes=TownChanges()))
    assert sensors._prepared is None
    sensors.prepare(replace(moving(2), town_changes=now.town_changes))
    assert sensors._prepared is not None


def bytes_of(frames):
    parts = []
    for sensor_id, frame in frames:
        for name in type(frame).__slots__:
            value = getattr(frame, name)
            parts.append((sensor_id, name, value.tobytes() if hasattr(value, "tobytes") else value))
    return parts


def test_all_kinds_are_answered_in_the_order_of_the_requests(sensors):
    frames = sensors.capture(state(1, **WORLD), rig())
    assert [sensor_id for sensor_id, _ in frames] == [r.sensor_id for r in rig()]
    assert SensorRegistry.known() == (
        "gbuffer.black",
        "sensor.camera.cosmos_visualization",
        "sensor.camera.depth",
        "sensor.camera.dvs",
        "sensor.camera.instance_segmentation",
        "sensor.camera.normals",
        "sensor.camera.optical_flow",
        "sensor.camera.rgb",
        "sensor.camera.semantic_segmentation",
        "sensor.lidar.ray_cast",
        "sensor.lidar.ray_cast_flash",
        "sensor.lidar.ray_cast_semantic",
        "sensor.lidar.ray_cast_sweeping",
        "sensor.other.collision",
        "sensor.other.gnss",
        "sensor.other.imu",
        "sensor.other.lane_invasion",
        "sensor.other.obstacle",
        "sensor.other.occupancy",
        "sensor.other.radar",
        "sensor.other.radar_rcs",
        "sensor.other.v2x",
        "sensor.other.v2x_custom",
    )


def test_cameras_of_one_pose_and_lens_share_a_cast(sensors):
    same = [request(f"camera.{kind}", k) for k, kind in enumerate(_KINDS)]
    sensors.capture(state(1, **WORLD), same)
    assert sensors.last_cast_count == 1
    other = [
        request("camera.depth", 10, fov=91.0),
        request("camera.depth", 11, location=(0.0, 0.1, 2.0)),
        request("camera.depth", 12, image_size_x=65),
    ]
    sensors.capture(state(2, **WORLD), same + other)
    assert sensors.last_cast_count == 4


def test_sensors_that_cast_nothing_cost_no_cast(sensors):
    sensors.capture(state(1), [request("other.imu")])
    assert sensors.last_cast_count == 0


def test_a_second_run_gives_the_same_bytes_with_any_number_of_threads(trees):
    runs = []
    for threads in (1, 2, 1):
        with WorldSensors(town(GROUND, WALL), threads=threads, cache=trees) as sensors:
            runs.append(
                [
                    bytes_of(sensors.capture(moving(k), [*rig(), request("camera.dvs", 30)]))
                    for k in range(1, 4)
                ]
            )
    assert runs[0] == runs[1] == runs[2]
    assert any(sensor_id == 30 for sensor_id, *_ in runs[0][1])


def test_a_frame_number_that_goes_back_forgets_the_sensors(sensors):
    sensor = request("lidar.ray_cast", 20, **_LIDAR, rotation_frequency=2.5)
    angles = [
        sensors.capture(state(k), [sensor])[0][1].horizontal_angle_rad for k in (1, 2, 3, 1, 2)
    ]
    assert angles[3:] == angles[:2]
    assert angles[2] != angles[0]


def test_a_lidar_turns_on_over_frames_that_are_left_out(sensors):
    sensor = request("lidar.ray_cast", 20, **_LIDAR, rotation_frequency=2.5)
    angles = {}
    for k in (1, 2, 3, 4):
        ((_, frame),) = sensors.capture(state(k), [sensor])
        angles[k] = frame.horizontal_angle_rad
    sensors.reset()
    sensors.miss(state(1), [sensor])  # nobody knows it yet: it begins with its first frame
    ((_, first),) = sensors.capture(state(2), [sensor])
    assert first.horizontal_angle_rad == angles[1]
    sensors.miss(state(3), [sensor])
    sensors.miss(state(4), [sensor])
    sensors.miss(state(4), [sensor])
    ((_, last),) = sensors.capture(state(5), [sensor])
    assert last.horizontal_angle_rad == pytest.approx(angles[4])


def test_sensors_that_look_at_nothing_measure_without_a_scene(trees):
    looking = {kind: SensorRegistry.looks(kind) for kind in SensorRegistry.known()}
    assert {kind for kind, looks in looking.items() if not looks} == {
        "gbuffer.black",
        "sensor.other.imu",
        "sensor.other.gnss",
        "sensor.other.collision",
        "sensor.other.lane_invasion",
    }
    kinds = [kind for kind in looking if not looking[kind]]
    requests = [
        replace(request("other.imu", 9 + place), type_id=kind) for place, kind in enumerate(kinds)
    ]
    with WorldSensors(town(GROUND), threads=1, cache=trees) as sensors:
        sensors.frame_of = None  # none may ask for it
        frames = list(sensors.instant.frames(state(1), requests))
    assert {type(frame).__name__ for _, frame in frames} == {"ImageFrame", "ImuFrame", "GnssFrame"}


def test_a_new_episode_starts_with_new_sensors(sensors):
    sensor = request("lidar.ray_cast", 20, **_LIDAR, rotation_frequency=2.5)
    first = sensors.capture(state(1), [sensor])[0][1].horizontal_angle_rad
    sensors.reset()
    assert sensors.capture(state(2), [sensor])[0][1].horizontal_angle_rad == first


def test_a_sensor_that_stops_listening_starts_anew(sensors):
    sensor = request("lidar.ray_cast", 20, **_LIDAR, rotation_frequency=2.5)
    first = sensors.capture(state(1), [sensor])[0][1].horizontal_angle_rad
    sensors.capture(state(2), [])
    assert sensors.capture(state(3), [sensor])[0][1].horizontal_angle_rad == first


def test_sensor_tick_is_kept_without_drift(sensors):
    sensor = request("other.gnss", sensor_tick=0.25)
    given = [k for k in range(1, 22) if sensors.capture(state(k), [sensor])]
    # 0.1 s per frame: due at 0.1, 0.35, 0.6, 0.85, 1.1 ... on the first frame not before.
    assert given == [1, 4, 6, 9, 11, 14, 16, 19, 21]


@pytest.mark.parametrize("fps", [7.0, 10.0, 29.97, 30.0])
@pytest.mark.parametrize("every", [2, 3, 40])
def test_sensor_tick_of_whole_steps_is_due_in_exactly_those(fps, every):
    """For as many steps as the collector relies on it; time is a sum of steps."""
    asked = request("other.gnss", sensor_tick=repr(every / fps))
    sensor = SensorRegistry.make(asked, town(GROUND))
    step_s, now_s = 1.0 / fps, 12.3
    for step in range(100_000):
        assert sensor.is_due(now_s) == (step % every == 0), step
        now_s += step_s


def test_an_unknown_sensor_is_named(sensors):
    with pytest.raises(KeyError, match=r"sensor\.other\.unknown"):
        sensors.capture(state(1), [request("other.unknown")])


def test_shading_is_compiled_for_the_hits_of_pictures(trees):
    with WorldSensors(town(GROUND, WALL), threads=1, cache=trees) as sensors:
        sensors.warm_up()
        compiled = list(share_shade_packets.signatures)
        sensors.capture(state(1, **WORLD), rig())
    assert share_shade_packets.signatures == compiled
    assert len(compiled) == 1


def test_warm_up_changes_nothing(trees):
    with WorldSensors(town(GROUND, WALL), threads=1, cache=trees) as sensors:
        sensors.warm_up()
        warm = bytes_of(sensors.capture(state(1, **WORLD), rig()))
    with WorldSensors(town(GROUND, WALL), threads=1, cache=trees) as sensors:
        assert bytes_of(sensors.capture(state(1, **WORLD), rig())) == warm


def test_actors_move_between_frames(sensors):
    camera = request("camera.depth")
    near = sensors.capture(state(1, vehicles=[(3, (6.0, 0.0, 0.0), 0.0)]), [camera])[0][1]
    far = sensors.capture(state(2, vehicles=[(3, (8.0, 0.0, 0.0), 0.0)]), [camera])[0][1]
    assert not np.array_equal(near.pixels, far.pixels)


def test_looping_sensors_render_a_few_frames_and_send_them_in_turn(trees):
    with WorldSensors(town(GROUND, WALL), threads=1, loop=Looping(3), cache=trees) as sensors:
        captures = [sensors.capture(moving(frame), rig()) for frame in range(1, 4)]
        rendered = [dict(capture) for capture in captures]
        assert not np.array_equal(rendered[0][10].pixels, rendered[1][10].pixels)
        for frame in range(4, 11):
            repeated = sensors.capture(moving(frame), rig())
            assert sensors.last_cast_count == 0
            earlier = captures[(frame - 1) % 3]
            assert [number for number, _ in repeated] == [number for number, _ in earlier]
            assert all(a is b for (_, a), (_, b) in zip(repeated, earlier, strict=True))


def test_noise_of_looping_sensors_is_on_colours_alone_and_the_same_again(trees):
    def captured(noise):
        with WorldSensors(
            town(GROUND, WALL), threads=1, loop=Looping(1, noise), cache=trees
        ) as sensors:
            cameras = [request("camera.rgb", 10), request("camera.depth", 11)]
            return {key: frame.pixels for key, frame in sensors.capture(moving(1), cameras)}

    clean, noisy, again = captured(0.0), captured(4.0), captured(4.0)
    assert np.array_equal(noisy[10], again[10])
    assert np.array_equal(noisy[11], clean[11])
    added = noisy[10].astype(float) - clean[10]
    assert not added[..., 3].any()
    inside = ((clean[10] > 20) & (clean[10] < 235))[..., :3]
    assert np.std(added[..., :3][inside]) == pytest.approx(4.0, abs=0.3)


def test_noise_is_on_the_colours_of_a_cameras_buffers_too(trees):
    """Ids of buffers are below 0."""
    with WorldSensors(town(GROUND, WALL), threads=1, loop=Looping(1, 4.0), cache=trees) as sensors:
        cameras = [request("camera.rgb", 10), request("camera.rgb", -7)]
        camera, buffer = (frame.pixels for _, frame in sensors.capture(moving(1), cameras))
    assert not np.array_equal(camera, buffer)
    assert np.abs(camera.astype(int) - buffer).max() < 60


def test_looping_sensors_keep_to_their_interval(trees):
    slow = request("camera.depth", 10, sensor_tick=0.2)
    with WorldSensors(town(GROUND, WALL), threads=1, loop=Looping(1), cache=trees) as sensors:
        sent = [bool(sensors.capture(moving(frame), [slow])) for frame in range(1, 9)]
    assert sent == [True, False] * 4


@pytest.mark.parametrize(
    ("kind", "attributes", "named"),
    [
        ("camera.rgb", {"image_size_x": 100_000}, "image_size_x"),
        ("camera.depth", {"image_size_y": 0}, "image_size_y"),
        ("camera.rgb", {"image_size_x": 8192, "image_size_y": 8192}, "image_size_x"),
        ("lidar.ray_cast", {"channels": 100_000}, "channels"),
        ("lidar.ray_cast", {"points_per_second": 10**12}, "points_per_second"),
        ("lidar.ray_cast_semantic", {"rotation_frequency": 1e9}, "rotation_frequency"),
        ("lidar.ray_cast", {"upper_fov": 1e6}, "upper_fov"),
        ("other.radar", {"points_per_second": 10**12}, "points_per_second"),
    ],
)
def test_sensor_beyond_what_can_be_computed_is_refused_by_its_attribute(kind, attributes, named):
    with pytest.raises(SensorAttributeError, match=named):
        SensorRegistry.make(request(kind, 10, **attributes), town(GROUND))


def test_long_tick_does_not_make_more_rays_than_fit():
    lidar = SensorRegistry.make(
        request("lidar.ray_cast", 10, channels=64, points_per_second=20_000_000), town(GROUND)
    )
    assert lidar.geometry.sweep(0.0, 60.0).per_channel * 64 <= 8_000_000


def test_shapes_that_are_expected_are_made_before_a_sensor_looks(trees):
    made: list[str] = []

    def mesh_of(key: str) -> TriangleMesh:
        made.append(key)
        return WALL

    with WorldSensors(town(GROUND), threads=1, cache=trees, meshes=mesh_of) as sensors:
        sensors.expect("vehicle.tesla.model3")
        of_car = list(made)
        assert len(set(of_car)) == 1 + 1 + 4, "all of it, its body and its wheels"
        near = state(1, sensors=[(10, (0.0, 0.0, 2.0), 0.0)], **WORLD)
        for world in (state(1, **WORLD), near):
            sensors.capture(world, [request("camera.depth", 10)])
        assert set(made) == set(of_car)
        sensors.expect("walker.pedestrian.0001")
        assert len(set(made)) == 6 + 1 + WALK_PHASES, "one that stands, and all of a walk"
        before = len(made)
        sensors.expect("sensor.other.imu")
        assert len(made) == before
