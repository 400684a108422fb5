"""CARLA's pixel formats, exact to the byte, and what the cameras see."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel
from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.cameras import encode_depth, encode_instances, encode_normals, encode_tags
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL), threads=1, cache=tmp_path_factory.mktemp("trees")
    ) as built:
        yield built


def depth_of(pixels):
    """Ground truth section 8: metres of a BGRA picture."""
    b, g, r = (pixels[..., k].astype(np.float64) for k in range(3))
    return (r + 256 * g + 65536 * b) * 1000 / (2**24 - 1)


def one(sensors, frame_request, world=None):
    """The only frame of a fresh episode."""
    ((_, frame),) = sensors.capture(world or state(1), [frame_request])
    return frame


@pytest.mark.parametrize(
    ("metres", "bgra"),
    [
        (0.0, (0, 0, 0, 255)),
        (1000.0, (255, 255, 255, 255)),
        (3000.0, (255, 255, 255, 255)),
        (np.inf, (255, 255, 255, 255)),
    ],
)
def test_depth_code_at_its_ends(metres, bgra):
    assert tuple(encode_depth(np.array([metres]))[0].tolist()) == bgra


def test_depth_code_counts_low_byte_in_red():
    # D1, as BGRA: n = R + 256 G + 65536 B of 1000 m in 2^24 - 1 steps.
    assert encode_depth(np.array([3.906250233]))[0].tolist() == [1, 0, 0, 255]
    assert encode_depth(np.array([9.999991059]))[0].tolist() == [2, 143, 92, 255]
    metres = np.random.default_rng(0).uniform(0, 1000, 10_000)
    assert np.abs(depth_of(encode_depth(metres)) - metres).max() <= 0.5 * 1000 / (2**24 - 1) + 1e-9


def test_instance_code_splits_the_id():
    # D3: (R, G, B) = (10, 66, 81) is tag 10, id 20802; (14, 49, 159) is id 40753.
    pixels = encode_instances(np.array([10, 14], np.uint8), np.array([20802, 40753], np.uint16))
    assert pixels.tolist() == [[81, 66, 10, 255], [159, 49, 14, 255]]
    assert encode_tags(np.array([7], np.uint8)).tolist() == [[0, 0, 7, 255]]


def test_a_facing_wall_has_one_depth(sensors):
    # D2: depth is along the optical axis, not along the ray.
    depth = depth_of(one(sensors, request("camera.depth", location=(0.0, 0.0, 30.0))).pixels)
    assert depth.shape == (48, 64)
    assert np.abs(depth - 10.0).max() < 1e-3


def test_the_ground_lies_where_the_pinhole_says(sensors):
    depth = depth_of(one(sensors, request("camera.depth", rotation_deg=(0.0, 180.0, 0.0))).pixels)
    focal = 32.0
    row = 40
    assert depth[row, 10] == pytest.approx(2.0 * focal / (row + 0.5 - 24.0), rel=1e-5)
    assert np.all(depth[:20] == 1000.0)


def test_tags_of_wall_road_and_sky(sensors):
    tags = one(sensors, request("camera.semantic_segmentation", location=(-100.0, 0.0, 2.0))).pixels
    assert tags[2, 32].tolist() == [0, 0, CityObjectLabel.SKY, 255]
    assert tags[20, 32].tolist() == [0, 0, CityObjectLabel.BUILDINGS, 255]
    assert tags[46, 32].tolist() == [0, 0, CityObjectLabel.ROADS, 255]


def test_ids_of_actors_and_of_level_objects_do_not_meet(sensors):
    world = state(1, vehicles=[(70_003, (6.0, 0.0, 0.0), 90.0)])
    pixels = one(
        sensors, request("camera.instance_segmentation", location=(0, 0, 1.0)), world
    ).pixels
    ids = pixels[..., 1] + 256 * pixels[..., 0].astype(int)
    tags = pixels[..., 2]
    assert set(ids[tags == CityObjectLabel.CAR].tolist()) == {70_003 & 0xFFFF}
    assert set(ids[tags == CityObjectLabel.BUILDINGS].tolist()) == {0x8000 + 4}
    assert set(ids[tags == CityObjectLabel.ROADS].tolist()) == {0}


def test_glass_is_solid_in_depth_and_instance(sensors):
    world = state(1, vehicles=[(3, (6.0, 0.0, 0.0), 90.0)])
    pixels = one(
        sensors, request("camera.instance_segmentation", location=(0, 0, 1.2)), world
    ).pixels
    assert pixels[25, 32, 2] == CityObjectLabel.CAR


def test_a_camera_inside_its_carrier_does_not_see_it_but_others_do(sensors):
    world = state(1, vehicles=[(3, (0.0, 0.0, 0.0), 0.0)])
    inside = request("camera.semantic_segmentation", 1, location=(0, 0, 1.0), owner_id=3)
    foreign = request("camera.semantic_segmentation", 2, location=(0, 0, 1.0))
    frames = dict(sensors.capture(world, [inside, foreign]))
    assert not (frames[1].pixels[..., 2] == CityObjectLabel.CAR).any()
    assert (frames[2].pixels[..., 2] == CityObjectLabel.CAR).any()


def test_a_picture_has_the_asked_size_and_opaque_alpha(sensors):
    frame = one(sensors, request("camera.rgb", image_size_x=50, image_size_y=20, fov=70.5))
    assert frame.pixels.shape == (20, 50, 4)
    assert frame.fov_deg == 70.5
    assert np.all(frame.pixels[..., 3] == 255)


def test_normals_run_from_0_to_255_with_x_in_red():
    # Pull request 8810 of CARLA: [-1, 1] is mapped to [0, 1], world axes.
    codes = encode_normals(np.array([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 0.0)]))
    assert codes.tolist() == [[128, 128, 255, 255], [128, 0, 128, 255], [128, 128, 128, 255]]


def test_normals_are_the_worlds_whatever_way_the_camera_looks(sensors):
    for rotation in ((0.0, 0.0, 0.0), (-10.0, 25.0, 40.0)):
        camera = request("camera.normals", location=(-20.0, 0.0, 5.0), rotation_deg=rotation)
        tags = request("camera.semantic_segmentation", 101, location=(-20.0, 0.0, 5.0),
                       rotation_deg=rotation)  # fmt: skip
        frames = dict(sensors.capture(state(1), [camera, tags]))
        tag, normal = frames[101].pixels[..., 2], frames[100].pixels
        for label, bgra in (
            (CityObjectLabel.BUILDINGS, (128, 128, 0, 255)),
            (CityObjectLabel.ROADS, (255, 128, 128, 255)),
        ):
            seen = normal[tag == label]
            assert len(seen) > 100
            assert (seen == bgra).all(axis=1).mean() > 0.97  # but for rays on an edge


def test_a_turned_actor_turns_its_normals(sensors):
    world = state(1, vehicles=[(3, (6.0, 0.0, 0.0), 90.0)])
    camera = request("camera.normals", location=(0.0, 0.0, 0.9))
    pixels = one(sensors, camera, world).pixels
    side = pixels[24, 32].astype(float) / 127.5 - 1.0  # B, G, R: the flank of a car across
    assert side[2] < -0.8


@pytest.mark.parametrize(
    ("name", "value"),
    [("fov", "180"), ("fov", "wide"), ("image_size_x", "0"), ("image_size_y", "1.5")],
)
def test_an_impossible_camera_is_refused_by_the_attributes_name(sensors, name, value):
    with pytest.raises(SensorAttributeError, match=name):
        sensors.capture(state(1), [request("camera.depth", **{name: value})])
