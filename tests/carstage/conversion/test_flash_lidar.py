"""Echoes of a flash LiDAR, made of depth pictures of surfaces whose ranges are known."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from carstage.config import parse_config
from carstage.conversion.flash_lidar import flash_payload, flash_points, frame_seed
from carstage.conversion.tag_numbers import dataset_payload
from carstage.geometry import focal_length_px, rotate
from carstage.geometry.flash_beams import beam_angles, beam_directions
from carstage.geometry.lens_sources import FACE_AXES
from carstage.plan.rig import plan_sensors
from carstage.spec import SensorSpec
from carstage.spec.lenses import FACES

Points = NDArray[np.float64]
Surface = Callable[[Points], Points]
"""Ranges ``(...)`` along unit rays ``(..., 3)`` in optical axes; infinity: nothing."""


def flash_sensor(kind: str = "flash_lidar", **attributes: Any) -> SensorSpec:
    given = ", ".join(f"{name}: {value}" for name, value in attributes.items())
    text = f"rig: {{sensors: [{{id: FLASH, kind: {kind}, attributes: {{{given}}}}}]}}"
    return next(s for s in plan_sensors(parse_config(text)) if s.id == "FLASH")


def pictures(sensor: SensorSpec, surface: Surface) -> NDArray[np.uint8]:
    """Depth pictures of all faces, as CARLA codes them."""
    width, height = (int(sensor.attributes[f"image_size_{axis}"]) for axis in "xy")
    focal = focal_length_px(width, float(sensor.attributes["fov"]))
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    flat = np.stack([(u - width / 2) / focal, (v - height / 2) / focal, np.ones_like(u)], axis=-1)
    found = []
    numbers = [0, *([f[0] for f in FACES].index(name[-1]) for name in sensor.faces or ())]
    for number in numbers:
        stretch = np.linalg.norm(flat, axis=-1)
        rays = rotate(FACE_AXES[number].T, flat / stretch[..., None])
        z = np.minimum(surface(rays) / stretch, 1000.0)
        code = np.rint(z / 1000.0 * (2**24 - 1)).astype(np.int64)
        parts = [code >> 16, (code >> 8) & 255, code & 255, np.full_like(code, 255)]
        found.append(np.stack(parts, axis=-1).astype(np.uint8))
    return np.stack(found)


def measured(sensor: SensorSpec, surface: Surface, seed: int = 1) -> NDArray[np.float32]:
    return flash_points(sensor, pictures(sensor, surface), seed)


def plane(normal: list[float], distance_m: float) -> Surface:
    """Seen from the front: ``normal . P = distance`` in optical axes."""

    def ranges(rays: Points) -> Points:
        along = rays @ np.array(normal)
        with np.errstate(divide="ignore"):
            return np.where(along > 1e-9, distance_m / np.maximum(along, 1e-9), np.inf)

    return ranges


def ranges_of(points: NDArray[np.float32]) -> Points:
    return np.asarray(np.linalg.norm(points[:, :3].astype(np.float64), axis=1))


WALL = plane([0.0, 0.0, 1.0], 20.0)
GROUND = plane([0.0, 1.0, 0.0], 1.6)
SLANTED = plane([math.sin(0.6), 0.1, math.sqrt(0.99 - math.sin(0.6) ** 2)], 12.0)


@pytest.mark.parametrize("surface", [WALL, SLANTED], ids=["wall", "slanted"])
def test_every_beam_ends_where_its_line_meets_a_plane(surface: Surface) -> None:
    sensor = flash_sensor(horizontal_divergence_deg=0, vertical_divergence_deg=0, samples=1)
    points = measured(sensor, surface)
    assert points.shape == (128 * 32, 4)
    directions = beam_directions(sensor.flash)  # type: ignore[arg-type]
    optical = np.stack([directions[:, 1], -directions[:, 2], directions[:, 0]], axis=-1)
    wanted = surface(optical)
    np.testing.assert_allclose(points[:, :3], directions * wanted[:, None], atol=1e-3)


def test_beams_lie_in_the_middles_of_equal_parts_of_the_field_of_view() -> None:
    sensor = flash_sensor(columns=4, rows=2, horizontal_fov_deg=80, vertical_fov_deg=20)
    assert sensor.flash is not None
    azimuth, elevation = beam_angles(sensor.flash)
    np.testing.assert_allclose(np.degrees(azimuth), [-30, -10, 10, 30])
    np.testing.assert_allclose(np.degrees(elevation), [5, -5])
    x, y, z = beam_directions(sensor.flash)[0]
    assert x > 0 > y  # the first beam looks ahead, to the left and up
    assert z > 0


def test_a_divergence_is_the_distance_to_the_next_beam_unless_it_is_given() -> None:
    auto = flash_sensor(columns=60, rows=30, vertical_divergence_deg=0.25).flash
    assert auto is not None
    assert (auto.horizontal_divergence_deg, auto.vertical_divergence_deg) == (1.0, 0.25)


def test_intensity_falls_with_range_incidence_and_air() -> None:
    given = {
        "reflectivity": 0.4, "attenuation_per_m": 0.01, "full_scale_range_m": 15, "samples": 1,
    }  # fmt: skip
    points = measured(flash_sensor(**given), SLANTED)
    ranges = ranges_of(points)
    toward = points[:, :3].astype(np.float64) / ranges[:, None]
    normal = np.array([math.sqrt(0.99 - math.sin(0.6) ** 2), math.sin(0.6), -0.1])
    cosine = toward @ normal
    wanted = 0.4 * cosine * np.exp(-0.02 * ranges) * (15.0 / ranges) ** 2
    np.testing.assert_allclose(points[:, 3], np.minimum(wanted, 1.0), rtol=0.01)
    flat = measured(flash_sensor(**{**given, "full_scale_range_m": 0}), SLANTED)
    np.testing.assert_allclose(flat[:, 3], 0.4 * cosine * np.exp(-0.02 * ranges), rtol=0.01)


def edge_at(azimuth_rad: float, near_m: float = 10.0, far_m: float = 30.0) -> Surface:
    """A near wall to the left of an angle, a far one to the right."""

    def ranges(rays: Points) -> Points:
        left = np.arctan2(rays[..., 0], rays[..., 2]) < azimuth_rad
        return np.where(left, near_m, far_m) / rays[..., 2]

    return ranges


@pytest.mark.parametrize(
    ("returns", "wanted_m"),
    [
        ("first", [10.0]), ("strongest", [10.0]), ("last", [30.0]), ("dual", [10.0, 30.0]),
        ("all", [10.0, 30.0]),
    ],
)  # fmt: skip
def test_a_beam_on_an_edge_has_two_echoes(returns: str, wanted_m: list[float]) -> None:
    # One beam of two degrees, and two thirds of its footprint on the far wall.
    sensor = flash_sensor(
        columns=1, rows=1, horizontal_fov_deg=2, vertical_fov_deg=2, samples=3, returns=returns,
        oversampling=8,
    )  # fmt: skip
    points = measured(sensor, edge_at(math.radians(-1 / 3)))
    np.testing.assert_allclose(ranges_of(points), wanted_m, rtol=1e-3)
    power = points[:, 3] / 0.5
    if len(power) == 2:  # a third at 10 m against two thirds at 30 m, full scale at 10 m
        np.testing.assert_allclose(power, [1 / 3, 2 / 3 / 9], rtol=1e-2)


def test_dual_returns_are_two_where_the_strongest_is_the_last() -> None:
    given = {"columns": 1, "rows": 1, "horizontal_fov_deg": 2, "vertical_fov_deg": 2}
    sensor = flash_sensor(**given, returns="dual", oversampling=8)
    near = measured(sensor, edge_at(math.radians(-1 / 3), 10.0, 11.0))
    np.testing.assert_allclose(ranges_of(near), [10.0, 11.0], rtol=1e-3)
    one = measured(flash_sensor(**given, returns="strongest", oversampling=8),
        edge_at(math.radians(-1 / 3), 10.0, 11.0))  # fmt: skip
    np.testing.assert_allclose(ranges_of(one), [11.0], rtol=1e-3)


def test_surfaces_nearer_than_the_separation_are_one_echo() -> None:
    given = {"columns": 1, "rows": 1, "horizontal_fov_deg": 2, "vertical_fov_deg": 2}
    edge = edge_at(math.radians(-1 / 3), 10.0, 10.4)
    apart = measured(flash_sensor(**given, returns="all", echo_separation_m=0.2), edge)
    assert len(apart) == 2
    (joined,) = ranges_of(measured(flash_sensor(**given, returns="all"), edge))
    assert 10.0 < joined < 10.4


def test_a_slope_is_one_echo_however_far_its_footprint_reaches() -> None:
    sensor = flash_sensor(
        columns=8, rows=40, vertical_fov_deg=20, horizontal_fov_deg=10, returns="all", range_m=80
    )
    points = measured(sensor, GROUND)
    ranges = ranges_of(points)
    assert ranges.max() > 60.0
    depression = np.degrees(np.arcsin(-points[:, 2] / ranges))
    rows = np.rint((10.0 - 0.25 + depression) / 0.5).astype(int)
    assert np.bincount(rows).max() == 8  # one point for each beam


@pytest.mark.parametrize(("wide_deg", "seen"), [(0.0, False), (1.6, True)])
def test_a_beam_sees_what_its_footprint_reaches(wide_deg: float, seen: bool) -> None:
    sensor = flash_sensor(
        columns=1, rows=1, horizontal_fov_deg=2, vertical_fov_deg=2, samples=5, returns="first",
        oversampling=8,
        horizontal_divergence_deg=wide_deg, vertical_divergence_deg=0,
    )  # fmt: skip

    def pole(rays: Points) -> Points:
        azimuth = np.degrees(np.arctan2(rays[..., 0], rays[..., 2]))
        return np.where((azimuth > 0.4) & (azimuth < 1.0), 5.0, 25.0) / rays[..., 2]

    (range_m,) = ranges_of(measured(sensor, pole))
    assert range_m == pytest.approx(5.0 if seen else 25.0, rel=1e-3)


def test_nothing_nearer_or_farther_than_the_limits_is_measured() -> None:
    near = measured(flash_sensor(min_range_m=21, samples=1), WALL)
    far = measured(flash_sensor(range_m=21, samples=1), WALL)
    assert ranges_of(near).min() >= 21.0
    assert ranges_of(far).max() <= 21.0
    assert len(near) + len(far) == 128 * 32
    assert len(measured(flash_sensor(), lambda rays: np.full(rays.shape[:-1], np.inf))) == 0


def test_a_dark_surface_is_seen_up_to_the_range_of_the_data_sheet() -> None:
    given = {"range_m": 50, "range_reflectivity": 0.1, "attenuation_per_m": 0.005, "samples": 1}
    narrow = {"columns": 20, "rows": 20, "horizontal_fov_deg": 0.5, "vertical_fov_deg": 0.5}
    for distance_m, seen in ((49.5, 400), (50.5, 0)):
        sensor = flash_sensor(**given, **narrow, reflectivity=0.1)
        assert len(measured(sensor, plane([0, 0, 1.0], distance_m))) == seen
    black = flash_sensor(**given, **narrow, reflectivity=0.05)
    assert len(measured(black, plane([0, 0, 1.0], 37.0))) == 400  # by the inverse square, and air
    assert len(measured(black, plane([0, 0, 1.0], 38.5))) == 0
    # With ambient light, half of what is just strong enough is seen.
    bright = flash_sensor(**given, **narrow, reflectivity=0.1, ambient_noise=0.1)
    assert len(measured(bright, plane([0, 0, 1.0], 49.99))) == pytest.approx(200, abs=40)


def test_noise_has_the_spread_that_was_asked_for() -> None:
    sensor = flash_sensor(noise_stddev_m=0.05, samples=1)
    errors = ranges_of(measured(sensor, WALL)) - ranges_of(measured(flash_sensor(samples=1), WALL))
    assert errors.std() == pytest.approx(0.05, rel=0.05)
    assert abs(errors.mean()) < 0.003


def test_echoes_are_lost_and_false_ones_come_at_the_rates_that_were_asked_for() -> None:
    assert len(measured(flash_sensor(dropoff_rate=0.25), WALL)) == pytest.approx(3072, rel=0.03)
    sensor = flash_sensor(
        false_return_rate=0.1, range_reflectivity=0.1, range_m=60, reflectivity=1.0, returns="all"
    )
    ranges = ranges_of(measured(sensor, WALL))
    false = ranges[np.abs(ranges - 20.0) > 3.5]
    assert len(ranges) - 128 * 32 == pytest.approx(410, abs=60)
    assert false.min() < 5.0
    assert false.max() > 55.0


def test_equal_seeds_give_equal_points_and_frames_differ() -> None:
    sensor = flash_sensor(noise_stddev_m=0.05, dropoff_rate=0.1)
    first, again = measured(sensor, WALL, 7), measured(sensor, WALL, 7)
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != measured(sensor, WALL, 8).tobytes()
    seeds = {frame_seed(3, name, tick) for name in ("A", "B") for tick in range(100)}
    assert len(seeds) == 200
    assert all(0 <= seed < 2**64 for seed in seeds)


def test_a_field_of_view_all_around_is_made_of_a_cube() -> None:
    def room(rays: Points) -> Points:
        with np.errstate(divide="ignore"):
            return (np.array([6.0, 3.0, 9.0]) / np.abs(rays)).min(axis=-1)

    sensor = flash_sensor(
        columns=256, rows=24, horizontal_fov_deg=360, vertical_fov_deg=120, samples=1,
        oversampling=4,
    )  # fmt: skip
    assert sensor.faces == ("FLASH.r", "FLASH.l", "FLASH.u", "FLASH.d", "FLASH.b")
    points = measured(sensor, room).astype(np.float64)
    assert len(points) == 256 * 24
    sides = np.abs(points[:, :3]) / np.array([9.0, 6.0, 3.0])
    error = np.abs(sides.max(axis=1) - 1.0)
    assert np.quantile(error, 0.99) < 1e-3  # the rest are in the room's own edges
    assert error.max() < 0.05


def instance_picture(depth: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Left of the middle object 513 with tag 14, right of it 7 with tag 1."""
    found = np.full_like(depth, 255)
    middle = depth.shape[2] // 2
    found[:, :, :middle, :3] = (513 >> 8, 513 & 255, 14)
    found[:, :, middle:, :3] = (0, 7, 1)
    return found


def test_a_point_has_the_tag_of_the_sample_with_the_most_power() -> None:
    # One beam of two degrees: six of nine samples right of the edge, on the far wall.
    sensor = flash_sensor(
        "semantic_flash_lidar", columns=1, rows=1, horizontal_fov_deg=2, vertical_fov_deg=2,
        samples=3, returns="all", oversampling=8,
    )  # fmt: skip
    assert sensor.streams == ("FLASH", "FLASH.instance")
    depth = pictures(sensor, edge_at(math.radians(-1 / 3)))
    points = flash_points(sensor, np.concatenate([depth, instance_picture(depth)]), 1)
    assert points[0, 4:].tolist() == [513.0, 14.0]
    assert points[1, 4] in (7.0, 513.0)
    near = pictures(sensor, edge_at(0.0, 10.0, 10.0))
    tagged = flash_points(sensor, np.concatenate([near, instance_picture(near)]), 1)
    assert tagged.shape == (1, 6)
    plain_sensor = flash_sensor(
        columns=1, rows=1, horizontal_fov_deg=2, vertical_fov_deg=2, samples=3, returns="all",
        oversampling=8,
    )  # fmt: skip
    assert flash_points(plain_sensor, near, 1).tobytes() == tagged[:, :4].tobytes()


def test_false_echoes_have_no_tag() -> None:
    sensor = flash_sensor(
        "semantic_flash_lidar", false_return_rate=0.2, range_reflectivity=0.1, range_m=60,
        reflectivity=1.0, returns="all",
    )  # fmt: skip
    depth = pictures(sensor, WALL)
    points = flash_points(sensor, np.concatenate([depth, instance_picture(depth)]), 1)
    false = np.abs(ranges_of(points) - 20.0) > 3.5
    assert false.sum() > 300
    assert (points[false, 4:] == 0).all()
    right = points[~false, 1] > 0.2
    assert (points[~false, 5][right] == 1).mean() > 0.95  # a false one may be near the wall


def test_the_faces_of_a_cube_have_tags_too() -> None:
    sensor = flash_sensor("semantic_flash_lidar", horizontal_fov_deg=360, columns=64, samples=1)
    faces = [f"FLASH.{face}" for face in "rlb"]
    assert sensor.streams == (
        "FLASH", *faces, "FLASH.instance", *(f"FLASH.instance.{face}" for face in "rlb"),
    )  # fmt: skip
    depth = pictures(sensor, WALL) * 0 + np.array([100, 100, 1, 255], np.uint8)
    instance = depth.copy()
    for number in range(4):
        instance[number, ..., 2] = 20 + number
    points = flash_points(sensor, np.concatenate([depth, instance]), 1)
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    for middle, tag in ((0, 20), (90, 21), (-90, 22)):
        assert (points[np.abs(azimuth - middle) < 40, 5] == tag).all()
    assert (points[np.abs(azimuth) > 140, 5] == 23).all()


def test_old_servers_tags_get_the_numbers_of_datasets() -> None:
    points = np.zeros((2, 6), np.float32)
    points[:, 4:] = [[9, 10], [0, 7]]
    payload = points.reshape(-1).view(np.uint8).data
    for kind in ("semantic_flash_lidar", "semantic_ray_flash_lidar"):
        renumbered = np.frombuffer(dataset_payload(kind, "0.9.13", payload), "<f4").reshape(-1, 6)
        assert renumbered[:, 5].tolist() == [14.0, 1.0]
        assert renumbered[:, 4].tolist() == [9.0, 0.0]
        assert dataset_payload(kind, "0.9.16", payload) is payload


def test_a_tick_that_lacks_a_face_has_no_points() -> None:
    sensor = flash_sensor(horizontal_fov_deg=200, columns=32)
    assert flash_payload(sensor, [None] * len(sensor.streams), 1) is None


def test_what_is_planned_is_read_back() -> None:
    from carstage.spec import Fields
    from carstage.spec.plain import plain

    sensor = flash_sensor()
    assert SensorSpec.read(Fields(plain(sensor), "sensor"), None) == sensor
    assert replace(sensor, flash=None) != sensor
