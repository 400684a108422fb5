"""Cameras whose rows are exposed one after the other, on the move and before what moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.render.quality import Quality
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.attributes import SensorAttributeError
from carstage_sim.world.blueprints import catalogue
from sensor_worlds import GROUND, WALL, box, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

_WIDTH, _HEIGHT = 128, 96
_FOCAL = _WIDTH / 2.0
_POLE = box((9.95, -0.25, -20.0), (10.05, 0.25, 40.0), Material.METAL, CityObjectLabel.POLES, 7)
_KINDS = ("rgb", "depth", "semantic_segmentation", "instance_segmentation", "normals")
_SHUTTER_S = 0.1
_TIMES_S = (np.arange(_HEIGHT) / (_HEIGHT - 1) - 0.5) * _SHUTTER_S
_EYE = (0.0, 0.0, 1.5)
_FAR_CARRIER = (40, (0.0, 0.0, 60.0), 0.0)
"""A vehicle that carries the camera on a long stick, out of its sight."""


@pytest.fixture(scope="module")
def street():
    with WorldSensors(town(GROUND, WALL), threads=2) as made:
        yield made


@pytest.fixture(scope="module")
def pole():
    with WorldSensors(town(_POLE), threads=2) as made:
        yield made


def camera(kind, sensor_id=100, location=_EYE, rotation=(0.0, 0.0, 0.0), owner_id=0, **more):
    return request(
        f"camera.{kind}", sensor_id, location=location, rotation_deg=rotation, owner_id=owner_id,
        image_size_x=_WIDTH, image_size_y=_HEIGHT, fov=90, **more,
    )  # fmt: skip


def rolling(kind, sensor_id=100, **more):
    return camera(kind, sensor_id, rolling_shutter_s=_SHUTTER_S, **more)


def pixels(sensors, world, *requests):
    sensors.reset()
    return [frame.pixels for _, frame in sensors.capture(world, list(requests))]


def metres(picture):
    code = picture.astype(np.int64)
    return (code[..., 2] + 256 * code[..., 1] + 65536 * code[..., 0]) / (2**24 - 1) * 1000.0


def ids(picture):
    return picture[..., 1].astype(int) + 256 * picture[..., 0].astype(int)


def middle_columns(mask):
    """Middle of the marked columns of each row."""
    column = np.arange(mask.shape[1]) + 0.5
    assert mask.any(axis=1).all()
    return (mask * column).sum(axis=1) / mask.sum(axis=1)


@pytest.mark.parametrize("quality", list(Quality))
def test_where_nothing_moves_pictures_are_those_of_all_rows_at_once(quality):
    world = state(vehicles=[(40, (8.0, 1.0, 0.0), 30.0)], walkers=[(41, (6.0, -2.0, 0.9), 0.0)])
    with WorldSensors(town(GROUND, WALL), threads=2, quality=quality) as sensors:
        for kind in _KINDS:
            once, by_rows = pixels(sensors, world, camera(kind), rolling(kind, 101))
            assert np.array_equal(once, by_rows), kind


def test_a_pole_leans_as_a_turning_camera_sees_it(pole):
    rate_deg = 60.0
    world = state(vehicles=[_FAR_CARRIER], angular_velocity_deg=(0.0, 0.0, rate_deg))
    (seen,) = pixels(
        pole, world, rolling("semantic_segmentation", owner_id=40, location=(0.0, 0.0, 1.0))
    )
    # To the right turns the camera, to the left goes the pole.
    yaw = np.radians(rate_deg) * _TIMES_S
    column = middle_columns(seen[..., 2] == CityObjectLabel.POLES)
    assert np.abs(column - (_WIDTH / 2 - _FOCAL * np.tan(yaw))).max() < 0.8
    assert column[0] - column[-1] == pytest.approx(6.7, abs=0.8)


def test_a_camera_beside_the_middle_of_its_carrier_swings(pole):
    """It stands 5 m ahead of what turns, so it goes sideways, too."""
    carrier, rate_deg = (40, (-5.0, 0.0, 60.0), 0.0), 60.0
    world = state(vehicles=[carrier], angular_velocity_deg=(0.0, 0.0, rate_deg))
    (seen,) = pixels(pole, world, rolling("depth", owner_id=40))
    yaw = np.radians(rate_deg) * _TIMES_S
    ahead, right = 15.0 * np.cos(yaw) - 5.0, -15.0 * np.sin(yaw)
    column = middle_columns(metres(seen) < 20.0)
    assert np.abs(column - (_WIDTH / 2 + _FOCAL * right / ahead)).max() < 0.8
    assert np.ptp(column) > 8.0


def test_a_pole_leans_as_a_driving_camera_sees_it(pole):
    speed = 25.0
    world = state(vehicles=[_FAR_CARRIER], velocity=(0.0, speed, 0.0))
    (seen,) = pixels(pole, world, rolling("instance_segmentation", owner_id=40))
    column = middle_columns(ids(seen) > 0)
    assert np.abs(column - (_WIDTH / 2 - _FOCAL * speed * _TIMES_S / 9.95)).max() < 0.8
    assert column[0] - column[-1] == pytest.approx(16.1, abs=0.8)


def test_what_leans_is_blurred_where_it_is_seen(pole):
    """The pole is 0.5 m wide, 10 m away: 3.2 pixels; in 1/20 s it goes by 1 m, or 6.4 pixels."""
    world = state(vehicles=[_FAR_CARRIER], velocity=(0.0, 20.0, 0.0))
    attributes = {"owner_id": 40, "shutter_speed": 20, "bloom_intensity": 0}
    attributes["lens_flare_intensity"] = 0
    tags, sharp, blurred = pixels(
        pole,
        world,
        rolling("semantic_segmentation", owner_id=40),
        rolling("rgb", 101, **attributes),
        rolling("rgb", 102, shutter_blur="true", **attributes),
    )
    column = middle_columns(tags[..., 2] == CityObjectLabel.POLES)
    assert np.ptp(column) > 10.0
    changed = (sharp != blurred).any(axis=-1)
    away = np.abs(np.arange(_WIDTH) + 0.5 - column[:, None])
    assert not changed[away > 6.5].any()
    assert changed[(away > 2.5) & (away < 4.0)].mean() > 0.9


@pytest.mark.parametrize("owner_id", [0, 41])
def test_each_row_is_that_of_the_world_of_its_time(street, owner_id):
    """A car that crosses and turns, before a camera at rest or one that drives and turns alike."""
    velocity, rate_deg = np.array([2.0, 30.0, 0.0]), 40.0
    carrier = np.array([-3.0, 0.5, 30.0])
    car = np.array([9.0, -1.0, 0.0])
    eye, look = np.array(_EYE), (-5.0, 10.0, 3.0)
    cars = [(40, tuple(car), 30.0), (41, tuple(carrier), 0.0)]
    motion = {"velocity": tuple(velocity), "angular_velocity_deg": (0.0, 0.0, rate_deg)}
    requests = [
        rolling(kind, 100 + n, rotation=look, owner_id=owner_id) for n, kind in enumerate(_KINDS)
    ]
    seen = pixels(street, state(vehicles=cars, **motion), *requests)
    assert street.last_cast_count == 1
    for row in (0, 20, 45, 50, 56, 62, 70, 95):
        yaw, shift = rate_deg * _TIMES_S[row], velocity * _TIMES_S[row]
        then = [(40, tuple(car + shift), 30.0 + yaw), (41, tuple(carrier + shift), yaw)]
        place, turn = eye, look
        if owner_id:
            place = carrier + shift + rotation_matrix((0.0, yaw, 0.0)) @ (eye - carrier)
            turn = (look[0], look[1] + yaw, look[2])
        requests = [
            camera(kind, 200 + n, tuple(place), turn, owner_id=owner_id)
            for n, kind in enumerate(_KINDS)
        ]
        once = pixels(street, state(vehicles=then), *requests)
        colours, depth, tags, instances, _ = (picture[row] for picture in seen)
        assert (depth != once[1][row]).any(axis=-1).mean() < 0.02
        assert np.abs(metres(depth) - metres(once[1][row])).max() < 2e-3 * 60.0
        assert np.array_equal(tags, once[2][row])
        assert np.array_equal(instances, once[3][row])
        # Pixels on edges have rays through the rows beside them.
        apart = np.abs(colours.astype(int) - once[0][row].astype(int)).max(axis=-1)
        assert np.median(apart) <= 1
        assert apart.mean() < 3.0


def test_a_fast_car_is_seen_where_it_is_not_at_the_frames_time(street):
    """Rays find it outside of the box that it has then."""
    speed, eye = 60.0, (0.0, 0.0, 0.7)
    world = state(vehicles=[(40, (4.2, 0.0, 0.0), 90.0)], velocity=(0.0, speed, 0.0))
    (seen,) = pixels(street, world, rolling("instance_segmentation", location=eye))
    for row in (36, 42, 52, 56):
        then = state(vehicles=[(40, (4.2, speed * _TIMES_S[row], 0.0), 90.0)])
        (once,) = pixels(street, then, camera("instance_segmentation", location=eye))
        assert (ids(once)[row] == 40).sum() > 20
        assert np.array_equal(seen[row], once[row])


def test_the_kinds_of_one_camera_agree_on_a_crossing_car(street):
    world = state(vehicles=[(40, (6.0, 0.0, 0.0), 90.0)], velocity=(0.0, 20.0, 0.0))
    requests = [rolling(kind, 100 + n) for n, kind in enumerate(_KINDS)]
    colours, depth, tags, instances, _ = pixels(street, world, *requests)
    car = tags[..., 2] == CityObjectLabel.CAR
    assert car.sum() > 300
    assert np.array_equal(car, ids(instances) == 40)
    empty = [camera(kind, 200 + n) for n, kind in enumerate(_KINDS)]
    bare_colours, bare_depth, *_ = pixels(street, state(), *empty)
    assert np.array_equal(car, metres(depth) < metres(bare_depth) - 1e-3)
    changed = np.abs(colours.astype(int) - bare_colours.astype(int)).max(axis=-1) > 12
    assert changed[car].mean() > 0.95
    assert changed[car].mean() > 3 * changed[~car].mean()
    column = middle_columns(car[np.flatnonzero(car.any(axis=1))])
    rows = len(column)
    predicted = 20.0 * _SHUTTER_S * rows / _HEIGHT * _FOCAL / 6.0
    at_once = ids(pixels(street, world, camera("instance_segmentation"))[0]) == 40
    upright = middle_columns(at_once[np.flatnonzero(at_once.any(axis=1))])
    lean = np.polyfit(np.arange(rows), column, 1)[0] * rows
    lean -= np.polyfit(np.arange(len(upright)), upright, 1)[0] * rows
    assert lean == pytest.approx(predicted, rel=0.25)


def test_the_bonnet_of_the_own_car_stays_where_it_is(street):
    car = (40, (0.0, 0.0, 0.0), 0.0)
    motion = {"velocity": (15.0, 3.0, 0.0), "angular_velocity_deg": (0.0, 0.0, 50.0)}
    eye = {"location": (0.2, 0.0, 1.7), "rotation": (-20.0, 0.0, 0.0), "owner_id": 40}
    world = state(vehicles=[car], **motion)
    once, by_rows = pixels(
        street, world, camera("instance_segmentation", **eye),
        rolling("instance_segmentation", 101, **eye),
    )  # fmt: skip
    assert (ids(once) == 40).sum() > 500
    assert ((ids(once) == 40) != (ids(by_rows) == 40)).sum() <= 2


def test_bytes_do_not_depend_on_the_number_of_threads():
    world = state(vehicles=[(40, (9.0, 0.0, 0.0), 90.0)], velocity=(0.0, 20.0, 0.0))
    seen = []
    for threads in (1, 3):
        with WorldSensors(town(GROUND, WALL), threads=threads) as sensors:
            seen.append(pixels(sensors, world, rolling("rgb", owner_id=40)))
    assert np.array_equal(*seen)


def test_a_picture_of_one_row_is_of_the_frames_time(pole):
    world = state(vehicles=[_FAR_CARRIER], velocity=(0.0, 25.0, 0.0))
    one = rolling("depth", owner_id=40)
    one = replace(one, attributes={**one.attributes, "image_size_y": "1"})
    at_once = {name: text for name, text in one.attributes.items() if name != "rolling_shutter_s"}
    first, second = pixels(pole, world, one, replace(one, sensor_id=101, attributes=at_once))
    assert np.array_equal(first, second)


@pytest.mark.parametrize("duration", [-0.01, 0.11, "nan", "soon"])
def test_durations_that_cannot_be_are_refused(street, duration):
    with pytest.raises(SensorAttributeError, match="rolling_shutter_s"):
        pixels(street, state(), camera("rgb", rolling_shutter_s=duration))


def test_cameras_by_rays_have_the_attribute_and_no_others():
    have = {
        name.removeprefix("sensor.camera.")
        for name, blueprint in catalogue().items()
        if any(attribute.id == "rolling_shutter_s" for attribute in blueprint.attributes)
    }
    assert have == set(_KINDS)
