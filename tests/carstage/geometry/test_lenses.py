"""Camera models against OpenCV's own functions, and outlines of boxes against dense points."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from carstage.errors import BadInputError
from carstage.geometry import (
    CORNER_SIGNS,
    OPTICAL_FROM_SENSOR,
    Lens,
    lens_mask,
    lens_of,
    lens_outline,
    pixel_rays,
    rotation_matrix,
)
from carstage.geometry.lens_sources import (
    FACE_AXES,
    FACE_ROTATIONS_DEG,
    face_rotation_deg,
    source_view,
)

BROWN = lens_of(
    "brown_conrady", (640, 400), (350.0, 360.0), (325.0, 195.0),
    (-0.25, 0.08, 0.001, -0.0007, -0.01),
)  # fmt: skip
PINHOLE = lens_of("pinhole", (640, 400), (350.0, 360.0), (300.0, 210.0))
FISHEYE = lens_of(
    "kannala_brandt", (500, 500), (145.0, 146.0), (251.0, 249.0),
    (0.03, -0.01, 0.004, -0.0011), 95.0,
)  # fmt: skip
SPHERE = lens_of("equirectangular", (720, 360), (360 / math.pi, 360 / math.pi), (360.0, 180.0))
LENSES = {"brown": BROWN, "pinhole": PINHOLE, "fisheye": FISHEYE, "sphere": SPHERE}


def opencv_matrix(lens: Lens) -> NDArray[np.float64]:
    """OpenCV counts from the first pixel's centre."""
    k = lens.k
    k[:2, 2] -= 0.5
    return k


def centres(lens: Lens) -> NDArray[np.float64]:
    u, v = np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5
    return np.stack(np.meshgrid(u, v), axis=-1)


@pytest.mark.parametrize("name", LENSES)
def test_a_ray_goes_back_to_its_pixel(name: str) -> None:
    lens = LENSES[name]
    rays = pixel_rays(lens)
    shown = lens_mask(lens)
    assert shown.mean() > 0.7
    np.testing.assert_allclose(lens.project(rays * 7.0)[shown], centres(lens)[shown], atol=1e-6)
    np.testing.assert_allclose(lens.depth(rays * 7.0)[shown], 7.0)


def test_brown_conrady_is_opencvs() -> None:
    points = pixel_rays(BROWN)[::20, ::20].reshape(-1, 3) * 4.0
    still = np.zeros(3)
    uv, _ = cv2.projectPoints(
        points, still, still, opencv_matrix(BROWN), np.array(BROWN.distortion)
    )
    np.testing.assert_allclose(BROWN.project(points), uv[:, 0] + 0.5, atol=1e-9)


def test_kannala_brandt_is_opencvs() -> None:
    rays = pixel_rays(FISHEYE)[::20, ::20].reshape(-1, 3)
    points = rays[rays[:, 2] > 0.05] * 4.0
    still = np.zeros(3)
    uv, _ = cv2.fisheye.projectPoints(
        points[None], still, still, opencv_matrix(FISHEYE), np.array(FISHEYE.distortion)
    )
    np.testing.assert_allclose(FISHEYE.project(points), uv[0] + 0.5, atol=1e-9)


def test_a_fisheye_shows_nothing_beyond_its_largest_angle() -> None:
    ahead, beside, behind = [0.0, 0.0, 5.0], [5.0, 0.0, -0.3], [0.1, 0.0, -5.0]
    uv = FISHEYE.project(np.array([ahead, beside, behind]))
    assert np.isfinite(uv[:2]).all()
    assert np.isnan(uv[2]).all()
    assert not lens_mask(FISHEYE)[0, 0]
    assert lens_mask(FISHEYE)[250, 250]


def test_a_lens_that_folds_back_is_followed_up_to_there_alone() -> None:
    folding = lens_of(
        "brown_conrady", (640, 400), (300.0, 300.0), (320.0, 200.0), (-0.4,) + (0.0,) * 4
    )
    fold = math.atan(math.sqrt(1.0 / 1.2))  # where 1 + 3 k1 r^2 = 0
    assert folding.max_angle_rad == pytest.approx(fold)
    assert not lens_mask(folding)[0, 0]


def surface(extent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points all over a box's faces."""
    t = np.linspace(-1.0, 1.0, 81)
    a, b = (one.ravel() for one in np.meshgrid(t, t))
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            points = np.empty((a.size, 3))
            points[:, axis] = side
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = a, b
            faces.append(points)
    return np.concatenate(faces) * extent


@pytest.mark.parametrize("name", LENSES)
def test_an_outline_bounds_what_the_lens_shows_of_a_box(name: str) -> None:
    lens, rng, compared = LENSES[name], np.random.default_rng(4), 0
    for _ in range(150):
        center = rng.normal(size=3)
        center *= rng.uniform(4.0, 30.0) / np.linalg.norm(center)
        turn = rotation_matrix(rng.uniform(-180.0, 180.0, 3))
        extent = rng.uniform(0.3, 1.8, 3)
        outline = lens_outline((CORNER_SIGNS * extent) @ turn.T + center, lens)
        uv = lens.project(surface(extent) @ turn.T + center)
        shown = (uv >= 0.0).all(axis=1) & (uv <= [lens.width, lens.height]).all(axis=1)
        if outline is None:
            assert not shown.any()
        elif shown.sum() > 200:
            compared += 1
            found = [*uv[shown].min(axis=0), *uv[shown].max(axis=0)]
            # Cut by the picture's edge, points stop short of it by their distance.
            tolerance = 0.1 if shown.all() else 3.0
            np.testing.assert_allclose(outline.bounds_inside, found, atol=tolerance)
            assert (outline.truncated == 0.0) == shown.all() or 0.0 < shown.mean() < 1.0
    assert compared > 15


@pytest.mark.parametrize("name", LENSES)
def test_an_outline_bounds_what_is_seen_of_a_box_that_the_camera_stands_beside(name: str) -> None:
    """Such as a bus in the next street lane: its centre may be behind the camera."""
    lens, rng, compared = LENSES[name], np.random.default_rng(7), 0
    for _ in range(40):
        extent = np.array([rng.uniform(2.0, 6.0), 1.3, 1.6])
        turn = rotation_matrix([0.0, rng.uniform(-180.0, 180.0), 0.0])
        swap = OPTICAL_FROM_SENSOR
        beside = rng.choice([-1.0, 1.0]) * rng.uniform(1.7, 3.5)
        center = turn @ [rng.uniform(-0.9, 0.9) * extent[0], beside, rng.uniform(-1.0, 1.0)]
        outline = lens_outline((CORNER_SIGNS * extent @ turn.T + center) @ swap.T, lens)
        uv = lens.project((surface(extent) @ turn.T + center) @ swap.T)
        shown = (uv >= 0.0).all(axis=1) & (uv <= [lens.width, lens.height]).all(axis=1)
        if outline is None:
            assert not shown.any()
        elif shown.sum() > 200:
            compared += 1
            found = np.array([*uv[shown].min(axis=0), *uv[shown].max(axis=0)])
            low, high = found - 1.0, found + 1.0  # points are apart: it may reach farther out
            low[:2], high[2:] = found[:2] - 25.0, found[2:] + 25.0
            assert (np.array(outline.bounds_inside) >= low).all()
            assert (np.array(outline.bounds_inside) <= high).all()
    assert compared > 15


def test_what_is_behind_a_lens_of_all_directions_is_not_all_of_the_picture() -> None:
    """Its outline goes around the picture."""
    everywhere = lens_of(
        "kannala_brandt", (640, 480), (180.0, 180.0), (320.0, 240.0), (0.0,) * 4, 180.0
    )
    car = CORNER_SIGNS * np.array([1.0, 0.75, 2.4])
    for away_m in (6.0, 12.0, 30.0):
        assert lens_outline(car + np.array([0.3, 0.2, -away_m]), everywhere) is None
    wall = CORNER_SIGNS * np.array([20.0, 10.0, 0.5])
    outline = lens_outline(wall + np.array([0.0, 0.0, -3.0]), everywhere)
    assert outline is not None
    assert outline.bounds_inside == (0.0, 0.0, 640.0, 480.0)
    assert 0.1 < outline.truncated < 0.9


def test_a_box_behind_a_fisheye_is_in_no_picture() -> None:
    extent = np.array([3.0, 3.0, 1.0])
    assert lens_outline(CORNER_SIGNS * extent + [0.0, 0.0, -4.0], FISHEYE) is None


def test_half_of_a_box_at_the_edge_of_the_picture_is_truncated() -> None:
    edge = SPHERE.rays(np.array([360.0, 180.0]))  # never at an edge: the middle
    assert edge[2] == pytest.approx(1.0)
    side = BROWN.rays(np.array([0.0, 195.0]))
    outline = lens_outline(CORNER_SIGNS * 0.5 + side * 12.0, BROWN)
    assert outline is not None
    assert outline.truncated == pytest.approx(0.5, abs=0.06)


def test_faces_of_the_cube_look_along_their_axes() -> None:
    swap = OPTICAL_FROM_SENSOR
    for (name, rotation), axes in zip(FACE_ROTATIONS_DEG.items(), FACE_AXES, strict=True):
        np.testing.assert_allclose(axes, swap @ rotation_matrix(rotation).T @ swap.T, atol=1e-12)
        for mounted in ((0.0, 0.0, 0.0), (5.0, 30.0, 0.0), (-10.0, 120.0, 7.0)):
            turned = rotation_matrix(face_rotation_deg(mounted, name))
            expected = rotation_matrix(mounted) @ rotation_matrix(rotation)
            np.testing.assert_allclose(turned, expected, atol=1e-7)


def test_the_source_resolves_as_much_as_the_lens() -> None:
    source = source_view(FISHEYE, cube=True)
    focal = source.width / (2.0 * math.tan(math.radians(source.fov_deg) / 2.0))
    row = pixel_rays(FISHEYE)[249]
    finest = np.nanmin(np.linalg.norm(np.diff(row, axis=0), axis=1))  # rad per px
    assert 1.0 / finest <= focal < 1.2 / finest
    assert source.faces == ("front", "right", "left", "up", "down")
    assert source_view(SPHERE, cube=True).faces[-1] == "back"
    assert source_view(SPHERE, cube=True, oversampling=2.0).width > 400


def test_a_field_of_view_that_no_pinhole_holds_is_refused() -> None:
    wide = lens_of("pinhole", (640, 400), (80.0, 80.0), (320.0, 200.0))
    with pytest.raises(BadInputError, match="than one pinhole picture can hold"):
        source_view(wide, cube=False)
    with pytest.raises(BadInputError, match="would have to be recorded"):
        source_view(BROWN, cube=False, oversampling=12.0)
