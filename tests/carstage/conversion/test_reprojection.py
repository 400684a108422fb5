"""Pictures of camera models from synthetic pinhole pictures, judged by OpenCV's own functions."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from carstage.annotation.decoding import DEPTH_STEP_M, decode_depth_bgra
from carstage.annotation.rig import camera_geometry, planned_lens
from carstage.codecs import codec_for
from carstage.codecs.codec import image_bgra
from carstage.config import Config
from carstage.conversion.reprojection import record_picture
from carstage.conversion.reprojection_kernel import sample_depths
from carstage.geometry import Lens, intrinsics, lens_mask, pixel_rays
from carstage.geometry.lens_sources import FACE_AXES
from carstage.plan.rig import plan_sensors
from carstage.rawlog.format import KIND_DATA
from carstage.rawlog.reader import Record
from carstage.spec import SensorSpec
from carstage.spec.lenses import FACES

Array = NDArray[np.float64]

BROWN = {
    "model": "brown_conrady", "fx": 350.0, "fy": 360.0, "cx": 325.0, "cy": 195.0,
    "k1": -0.25, "k2": 0.08, "p1": 0.001, "p2": -0.0007, "k3": -0.01,
}  # fmt: skip
FISHEYE = {
    "model": "kannala_brandt", "fx": 145.0, "fy": 146.0, "cx": 251.0, "cy": 199.0,
    "k1": 0.03, "k2": -0.01, "k3": 0.004, "k4": -0.0011, "max_angle_deg": 95.0,
}  # fmt: skip
SPHERE = {"model": "equirectangular"}
SIZE = {"brown_conrady": [640, 400], "kannala_brandt": [500, 400], "equirectangular": [480, 240]}
LENSES: dict[str, dict[str, Any]] = {"brown": BROWN, "fisheye": FISHEYE, "sphere": SPHERE}
EDGE_PX = 0.3
"""By how much a straight line may bend."""


def planned(lens: dict[str, Any], kind: str = "rgb") -> SensorSpec:
    sensor = {
        "id": "CAM", "kind": kind, "lens": lens,
        "attributes": {"image_size": SIZE[lens["model"]]},
    }  # fmt: skip
    config = Config.model_validate(
        {"rig": {"sensors": [sensor]}, "labels": {"cameras": []}}, strict=False
    )
    return plan_sensors(config)[0]


def model(sensor: SensorSpec) -> Lens:
    assert sensor.lens is not None
    return planned_lens(sensor.lens)


@cache
def source_rays(width: int, height: int, fov_deg: float) -> Array:
    """``(h, w, 3)`` rays of a pinhole's pixels, z = 1."""
    k = intrinsics(width, height, fov_deg)
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], axis=-1)


def faces_of(sensor: SensorSpec) -> list[Array]:
    """Rays of the recorded pictures in the sensor's own optical axes; times z-depth: points."""
    names = ["f", *(name[-1] for name in sensor.faces or ())]
    rays = source_rays(*camera_geometry(sensor.attributes))
    return [rays @ FACE_AXES[[face[0] for face in FACES].index(name)] for name in names]


def recorded(sensor: SensorSpec, draw: Callable[[Array], NDArray[Any]]) -> list[Record]:
    """What a server would have recorded of a scene that is drawn from rays."""
    width, height, fov_deg = camera_geometry(sensor.attributes)
    meta = {"width": width, "height": height, "fov_deg": fov_deg}
    return [
        Record(KIND_DATA, 0, 1, 0.0, 0, meta, memoryview(draw(rays).tobytes()))
        for rays in faces_of(sensor)
    ]


def picture(sensor: SensorSpec, draw: Callable[[Array], NDArray[Any]]) -> NDArray[np.uint8]:
    found = record_picture(sensor, recorded(sensor, draw))
    assert found is not None
    return image_bgra(*found)


def grey(value: Array) -> NDArray[np.uint8]:
    level = np.rint(value).astype(np.uint8)
    return np.stack([level, level, level, np.full_like(level, 255)], axis=-1)


def unit(rays: Array) -> Array:
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def undistorted(lens: Lens, uv: Array) -> Array:
    """Points of the plane z = 1 by OpenCV."""
    k = lens.k
    k[:2, 2] -= 0.5  # OpenCV counts from the first pixel's centre
    points = (uv - 0.5)[None]
    if lens.model == "kannala_brandt":
        return np.asarray(cv2.fisheye.undistortPoints(points, k, np.array(lens.distortion)))[0]
    return np.asarray(cv2.undistortPoints(points, k, np.array(lens.distortion)))[:, 0]


@pytest.mark.parametrize("name", ["brown", "fisheye"])
@pytest.mark.parametrize("line", [(1.0, 0.35, -0.3), (0.2, 1.0, 0.4), (0.8, -0.6, 0.9)])
def test_straight_lines_stay_straight_after_opencvs_undistortion(
    name: str, line: tuple[float, float, float]
) -> None:
    """An edge on a wall before the camera, as it lies in the re-projected picture."""
    sensor = planned(LENSES[name])
    lens, (a, b, c) = model(sensor), np.array(line) / np.hypot(*line[:2])

    def wall(rays: Array) -> NDArray[np.uint8]:
        across = np.where(rays[..., 2] > 0.0, rays @ np.array([a, b, -c]), -9.0)
        # As wide as a pixel or two, wherever it is: the angle to the plane of eye and edge.
        return grey(128.0 + 120.0 * np.tanh(across / np.linalg.norm(rays, axis=-1) * 120.0))

    level = picture(sensor, wall)[..., 0].astype(np.float64)
    points = []
    for axis in (0, 1):  # crossings along rows, then along columns
        along = level if axis == 0 else level.T
        row, column = np.nonzero(np.diff(np.sign(along - 128.0), axis=1))
        low, high = along[row, column], along[row, column + 1]
        steep = np.abs(high - low) > 10.0
        at = column + 0.5 + (128.0 - low) / np.where(high == low, 1.0, high - low)
        uv = np.column_stack([at, row + 0.5])[steep]
        points.append(uv if axis == 0 else uv[:, ::-1])
    uv = np.concatenate(points)
    rays = lens.rays(uv)
    uv = uv[np.degrees(np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])) < 75.0]
    assert len(uv) > 150
    flat = undistorted(lens, uv)
    off = (flat @ np.array([a, b]) - c) * lens.fx
    # Undistortion magnifies: in px of the picture, where they were found.
    stretch = np.linalg.norm(np.column_stack([flat, np.ones(len(flat))]), axis=1) ** 2
    assert np.abs(off / stretch).max() < EDGE_PX
    assert np.abs(off[stretch < 2.0]).max() < EDGE_PX


@pytest.mark.parametrize("name", LENSES)
def test_colours_have_no_seams_between_faces(name: str) -> None:
    sensor = planned(LENSES[name])

    def scene(rays: Array) -> Array:
        x, y, z = np.moveaxis(unit(rays), -1, 0)
        waves = np.sin(9.0 * x + 4.0 * y) + np.sin(7.0 * y - 5.0 * z) + np.sin(8.0 * z + 3.0 * x)
        return np.asarray(127.0 + 40.0 * waves)

    found = picture(sensor, lambda rays: grey(scene(rays)))[..., 0].astype(np.float64)
    shown = lens_mask(model(sensor))
    expected = scene(np.nan_to_num(pixel_rays(model(sensor)), nan=1.0))
    assert np.abs(found - expected)[shown].max() < 1.6  # two roundings to whole levels
    assert not found[~shown].any()


@pytest.mark.parametrize("name", LENSES)
def test_depths_of_planes_are_exact_and_edges_are_never_mixed(name: str) -> None:
    """A street, a wall with a near post before it, and the sky."""
    sensor = planned(LENSES[name], "depth")
    lens = model(sensor)

    def z_depth(rays: Array) -> Array:
        """Times the ray: the point."""
        with np.errstate(divide="ignore"):
            street = np.where(rays[..., 1] > 0.0, 1.6 / rays[..., 1], np.inf)
            wall = np.where(rays[..., 2] > 0.0, 12.0 / rays[..., 2], np.inf)
        post = np.abs(rays[..., 0] * 4.0 - rays[..., 2]) < 0.2 * rays[..., 2]
        near = np.where(post & (rays[..., 2] > 0.0), 4.0 / rays[..., 2], np.inf)
        return np.minimum(np.minimum(street, wall), np.minimum(near, 1000.0))

    def code(rays: Array) -> NDArray[np.uint8]:
        steps = np.minimum(np.rint(z_depth(rays) / DEPTH_STEP_M), 2**24 - 1).astype(np.uint32)
        bytes_ = [steps >> 16, steps >> 8 & 255, steps & 255, np.full_like(steps, 255)]
        return np.stack(bytes_, axis=-1).astype(np.uint8)

    found = decode_depth_bgra(picture(sensor, code)).astype(np.float64)
    rays = np.nan_to_num(pixel_rays(lens), nan=1.0)
    shown = lens_mask(lens)
    expected = z_depth(rays)
    far = expected > 990.0
    off = np.abs(found - expected) / expected
    assert np.quantile(off[shown & ~far], 0.96) < 1e-3
    # Where it is off, at an edge, it is the depth of a surface nearby.
    around = [
        np.roll(expected, (i, j), (0, 1)) for i in (-2, -1, 0, 1, 2) for j in (-2, -1, 0, 1, 2)
    ]
    nearest = np.min([np.abs(found - one) / one for one in around], axis=0)
    at_edge = shown & (expected < 30.0) & (off > 0.02)
    assert at_edge.sum() < 0.03 * shown.sum()
    assert np.quantile(nearest[at_edge], 0.9) < 0.06
    assert found[~shown].min(initial=1000.0) > 999.0


@pytest.mark.parametrize("wide", [1, 2, 5])
@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("beyond_m", [40.0, 400.0])
def test_what_is_a_few_pixels_wide_has_its_own_depth(
    wide: int, down: bool, beyond_m: float
) -> None:
    """Between something near and something far, as a car seen between a rider and a bus."""
    depth_m = np.full((9, 12), beyond_m)
    depth_m[:, :4] = 4.0
    depth_m[:, 4 : 4 + wide] = 17.0
    depth_m[:, 4 + wide] = 40.0
    code = np.rint(depth_m / DEPTH_STEP_M).astype("<u4")
    source = code.view(np.uint8).reshape(9, 12, 4)[..., [2, 1, 0, 3]]
    at = np.stack(np.meshgrid(np.arange(12) + 0.9, np.arange(9) + 0.9), axis=2)
    if down:
        source = source.transpose(1, 0, 2)
        at = np.stack(np.meshgrid(np.arange(9) + 0.9, np.arange(12) + 0.9), axis=2)
    size = at.shape[:2]
    out = np.zeros((*size, 4), np.uint8)
    sources = np.ascontiguousarray(source)[None]
    sample_depths(sources, np.zeros(size, np.uint8), at, np.ones(size), out)
    found = decode_depth_bgra(out)
    np.testing.assert_allclose(found.T if down else found, depth_m, atol=0.01)


@pytest.mark.parametrize("name", LENSES)
def test_flow_is_that_of_the_lenss_own_pixels(name: str) -> None:
    """The camera went forward and turned: how a sphere of points around it moved."""
    sensor = planned(LENSES[name], "flow")
    lens = model(sensor)
    turn = cv2.Rodrigues(np.array([0.01, -0.03, 0.005]))[0]
    moved = np.array([0.1, 0.0, 0.4])

    def before(rays: Array) -> Array:
        return unit(rays) * 9.0 @ turn.T + moved

    def shares(rays: Array) -> NDArray[np.float32]:
        width, height, fov_deg = camera_geometry(sensor.attributes)
        k = intrinsics(width, height, fov_deg)
        axes = next(
            axes
            for axes in FACE_AXES
            if np.allclose(unit(rays)[height // 2, width // 2] @ axes.T, [0, 0, 1], atol=0.02)
        )
        then = before(rays) @ axes.T
        uv = then[..., :2] / then[..., 2:] * k[0, 0] + [width / 2.0, height / 2.0]
        u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        flow = np.stack([u, v], axis=-1) - uv
        return (flow / [width / 2.0, -height / 2.0]).astype("<f4")

    found = record_picture(sensor, recorded(sensor, shares))
    assert found is not None
    flow = codec_for("flow")[1].raw_array(*found)
    shown = lens_mask(lens)
    u, v = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5)
    expected = np.stack([u, v], axis=-1) - lens.project(
        before(np.nan_to_num(pixel_rays(lens), nan=1.0))
    )
    if lens.wraps:
        expected[..., 0] -= lens.width * np.round(expected[..., 0] / lens.width)
        shown = shown & (np.abs(v - 120.0) < 100.0)  # columns crowd at the poles
    known = shown & ~np.isnan(flow[..., 0]) & ~np.isnan(expected[..., 0])
    assert known.sum() > 0.9 * shown.sum()
    error = np.linalg.norm(flow - expected, axis=-1)[known]
    assert np.quantile(error, 0.99) < 0.2
    assert np.isnan(flow[~lens_mask(lens)]).all()


def test_classes_are_those_of_the_nearest_pixel_and_zero_outside_the_lens() -> None:
    sensor = planned(FISHEYE, "semantic")

    def checks(rays: Array) -> NDArray[np.uint8]:
        x, y, _ = np.moveaxis(np.floor(unit(rays) * 6.0).astype(int), -1, 0)
        return grey(np.where((x + y) % 2, 7.0, 14.0))

    tags = picture(sensor, checks)[..., 2]
    shown = lens_mask(model(sensor))
    assert set(np.unique(tags[shown])) == {7, 14}
    assert not tags[~shown].any()
    assert (~shown).sum() > 1000


def test_a_tick_that_lacks_a_face_has_no_picture() -> None:
    sensor = planned(FISHEYE)
    records: list[Record | None] = [*recorded(sensor, lambda rays: grey(rays[..., 0] * 0.0))]
    records[2] = None
    assert record_picture(sensor, records) is None
