"""Golden tests V1-V6: own, front and background pixels; the slab test; tokens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from annotation_scenes import (
    CAR_EXTENT,
    CAR_TAG,
    ROAD_TAG,
    WALKER_TAG,
    PaintedImages,
    box_interval,
)
from carstage.annotation.decoding import decode_instance_bgra
from carstage.annotation.pixels import (
    BOX_MARGIN_M,
    BoxView,
    ImageEvidence,
    PixelVisibility,
    Reach,
    measure,
    occlusion_bin,
    visibility_token,
)
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    Z_NEAR_M,
    back_project,
    box_corners,
    clip_to_near_plane,
    convex_hull,
    intrinsics,
    optical_from_world,
    pose_matrix,
    project,
    rotation_matrix,
    transform_points,
)

WIDTH, HEIGHT = 640, 360
K = intrinsics(WIDTH, HEIGHT, 90.0)
CENTER = (20.0, 0.0, 0.0)
CAR_ID = 300
TAGS = np.isin(np.arange(256), [13, 14, 15, 16, 17, 18, 19])


def view(
    center: Sequence[float],
    rotation_deg: Sequence[float] = (0.0, 0.0, 0.0),
    extent: Sequence[float] = CAR_EXTENT,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> BoxView:
    """The box from a camera at the origin, with the whole image as region."""
    rotation = rotation_matrix(rotation_deg)
    return BoxView(
        origin_box=rotation.T @ -np.asarray(center, dtype=np.float64),
        box_from_optical=rotation.T @ OPTICAL_FROM_SENSOR.T,
        extent_m=np.asarray(extent, dtype=np.float64),
        ground_m=-extent[2],
        region=(0, 0, *size),
    )


def seen(
    stage: PaintedImages, *, method: str = "instance", with_tags: bool = True
) -> PixelVisibility:
    ids, tags = decode_instance_bgra(stage.bgra)
    evidence = ImageEvidence(
        stage.depth.astype(np.float32),
        ids if method == "instance" else None,
        tags if with_tags else None,
    )
    found = measure(view(CENTER), K, evidence, CAR_ID, TAGS)
    assert found.method == method
    return found


@pytest.mark.parametrize("method", ["instance", "depth"])
def test_a_lone_solid_box_is_not_occluded(method: str) -> None:
    stage = PaintedImages()
    stage.paint_box(CENTER, CAR_EXTENT, CAR_ID)
    found = seen(stage, method=method)
    assert found.visible_px > 300
    assert found.occlusion_ratio == 0.0
    assert found.amodal_px == found.visible_px
    # The inflated silhouette is a little larger than the box.
    assert 0.8 < found.visible_px / found.hull_px < 1.0


@pytest.mark.parametrize("method", ["instance", "depth"])
def test_a_lone_cylinder_in_the_box_is_not_occluded_though_it_fills_only_a_part(
    method: str,
) -> None:
    stage = PaintedImages()
    stage.paint_cylinder(CENTER, 0.6, 0.75, CAR_ID, CAR_TAG)
    found = seen(stage, method=method)
    assert found.visible_px / found.hull_px < 0.7
    assert found.occlusion_ratio == 0.0


@pytest.mark.parametrize("method", ["instance", "depth"])
def test_a_wall_before_the_left_half_hides_half(method: str) -> None:
    stage = PaintedImages()
    stage.paint_box(CENTER, CAR_EXTENT, CAR_ID)
    left = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    left[:, : WIDTH // 2] = True
    stage.paint(left, 5.0, 0, ROAD_TAG)
    found = seen(stage, method=method)
    assert found.mask is not None
    x0, _, x1, _ = found.mask.bounds()
    assert x0 == WIDTH / 2
    assert found.occlusion_ratio == pytest.approx(0.5, abs=1.0 / (2 * (x1 - x0)))


def test_a_hidden_object_is_fully_occluded_and_has_no_mask() -> None:
    stage = PaintedImages()
    stage.paint_box(CENTER, CAR_EXTENT, CAR_ID)
    stage.paint(np.ones((HEIGHT, WIDTH), dtype=np.bool_), 5.0, 0, ROAD_TAG)
    found = seen(stage)
    assert found.visible_px == 0
    assert found.occlusion_ratio == 1.0
    assert found.mask is None
    assert found.amodal_method == "hull_prior"
    assert found.amodal_px == 0.8 * found.hull_px


def test_the_occlusion_ratio_is_front_over_hull() -> None:
    rng = np.random.default_rng(8)
    checked = 0
    for _ in range(30):
        depth = rng.uniform(10.0, 30.0, (HEIGHT, WIDTH)).astype(np.float32)
        ids = rng.integers(CAR_ID - 1, CAR_ID + 1, (HEIGHT, WIDTH)).astype(np.uint16)
        tags = rng.integers(12, 16, (HEIGHT, WIDTH)).astype(np.uint8)
        found = measure(view(CENTER), K, ImageEvidence(depth, ids, tags), CAR_ID, TAGS)
        if found.visible_px:
            checked += 1
            assert found.front_px / found.hull_px == pytest.approx(
                1.0 - found.visible_px / found.amodal_px, abs=1e-12
            )
    assert checked > 20


def test_own_pixels_by_depth_are_the_points_in_the_inflated_box() -> None:
    rng = np.random.default_rng(9)
    rotation = (5.0, 35.0, -4.0)
    depth = rng.uniform(14.0, 26.0, (HEIGHT, WIDTH)).astype(np.float32)
    tags = np.full((HEIGHT, WIDTH), CAR_TAG, dtype=np.uint8)
    found = measure(view(CENTER, rotation), K, ImageEvidence(depth, None, tags), CAR_ID, TAGS)
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    optical = back_project(np.stack([u, v], axis=-1), depth, K).reshape(-1, 3)
    box_from_world = np.linalg.inv(pose_matrix(CENTER, rotation))
    local = transform_points(box_from_world, optical @ OPTICAL_FROM_SENSOR)
    inside = (np.abs(local) <= np.array(CAR_EXTENT) + BOX_MARGIN_M).all(axis=-1)
    assert found.mask is not None
    assert found.visible_px > 100
    x0, y0, x1, y1 = (int(bound) for bound in found.mask.bounds())
    whole = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    whole[y0:y1, x0:x1] = found.mask.crop
    np.testing.assert_array_equal(whole.ravel(), inside)


@given(
    center=st.tuples(st.floats(-3, 25), st.floats(-12, 12), st.floats(-5, 5)),
    rotation=st.tuples(st.floats(-30, 30), st.floats(-180, 180), st.floats(-30, 30)),
    by_id=st.booleans(),
    by_tag=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
@example(center=(20.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0), by_id=True, by_tag=True, seed=1)
@example(center=(0.5, 0.2, 0.1), rotation=(3.0, 20.0, 0.0), by_id=False, by_tag=False, seed=1)
@settings(max_examples=40, deadline=None)
def test_the_compiled_loop_finds_what_plain_numpy_finds(
    center: tuple[float, float, float],
    rotation: tuple[float, float, float],
    by_id: bool,
    by_tag: bool,
    seed: int,
) -> None:
    size = (96, 54)
    k, box = intrinsics(*size, 90.0), view(center, rotation, size=size)
    enter, leave = box_interval(box, k)
    hull = enter <= leave
    rng = np.random.default_rng(seed)
    reach = np.where(hull & np.isfinite(leave), leave, 30.0)
    depth = (enter + rng.uniform(-0.5, 1.5, hull.shape) * (reach - enter)).astype(np.float32)
    depth = np.maximum(depth, np.float32(Z_NEAR_M))  # no picture shows what is nearer
    ids = rng.integers(CAR_ID - 1, CAR_ID + 1, hull.shape).astype(np.uint16)
    tags = rng.integers(12, 16, hull.shape).astype(np.uint8)
    evidence = ImageEvidence(depth, ids if by_id else None, tags if by_tag else None)
    found = measure(box, k, evidence, CAR_ID, TAGS)

    slope = back_project(pixel_centres(size), np.ones_like(depth), k) @ box.box_from_optical[2]
    height = box.origin_box[2] + depth * slope
    at_road = (slope < 0.0) & (height < BOX_MARGIN_M - CAR_EXTENT[2])
    gate = BOX_MARGIN_M if by_id else 0.0
    own = hull & (depth >= enter - gate) & (depth <= leave + gate)
    own &= TAGS[tags] if by_tag else True
    own &= (ids == CAR_ID) if by_id else True
    own &= True if by_id or by_tag else ~at_road
    front = hull & ~own & (depth < enter) & ~at_road
    assert found.hull_px == hull.sum()
    assert (found.visible_px, found.front_px) == (own.sum(), front.sum())
    if found.mask is None:
        assert not own.any()
    else:
        rows, columns = np.nonzero(own)
        tight = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        assert found.mask.bounds() == tight
        x0, y0, x1, y1 = tight
        np.testing.assert_array_equal(found.mask.crop, own[y0:y1, x0:x1])


def pixel_centres(size: tuple[int, int]) -> NDArray[np.float64]:
    u, v = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    return np.stack([u, v], axis=-1)


@given(
    center=st.tuples(st.floats(-3, 25), st.floats(-12, 12), st.floats(-5, 5)),
    rotation=st.tuples(st.floats(-30, 30), st.floats(-180, 180), st.floats(-30, 30)),
)
@example(center=(-4.0, 1.0, 0.2), rotation=(0.0, 20.0, 0.0))
@example(center=(0.5, 0.2, 0.1), rotation=(3.0, 20.0, 0.0))
@settings(max_examples=40, deadline=None)
def test_rays_meet_the_box_exactly_inside_its_silhouette(
    center: tuple[float, float, float], rotation: tuple[float, float, float]
) -> None:
    size = (160, 90)
    k = intrinsics(*size, 90.0)
    enter, leave = box_interval(view(center, rotation, size=size), k)
    inflated = np.array(CAR_EXTENT) + BOX_MARGIN_M
    optical = transform_points(
        optical_from_world(np.eye(4)), box_corners(pose_matrix(center, rotation), inflated)
    )
    front = clip_to_near_plane(optical, 0.1)
    hull = convex_hull(project(front, k)) if len(front) >= 3 else []
    distance = inside_distance(hull, size)
    clear = np.abs(distance) > 1e-6
    np.testing.assert_array_equal((enter <= leave)[clear], (distance > 0.0)[clear])


def inside_distance(hull: list[tuple[float, float]], size: tuple[int, int]) -> NDArray[np.float64]:
    """Signed distance (px) of pixel centres to the nearest line of a counter-clockwise hull."""
    u, v = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    distance = np.full_like(u, np.inf if len(hull) >= 3 else -np.inf)
    for (ax, ay), (bx, by) in zip(hull, [*hull[1:], *hull[:1]], strict=True):
        cross = (bx - ax) * (v - ay) - (by - ay) * (u - ax)
        distance = np.minimum(distance, cross / np.hypot(bx - ax, by - ay))
    return distance


def test_an_untagged_occluder_with_the_objects_id_is_not_the_object() -> None:
    """The instance camera looks through untagged geometry; the depth camera does not."""
    stage = PaintedImages()
    stage.paint_box(CENTER, CAR_EXTENT, CAR_ID)
    stage.depth[:, : WIDTH // 2] = 8.0
    found = seen(stage)
    assert found.mask is not None
    assert found.mask.bounds()[0] == WIDTH / 2
    assert found.front_px > 0


def test_pixels_of_another_class_are_not_own() -> None:
    stage = PaintedImages()
    stage.paint_box(CENTER, CAR_EXTENT, CAR_ID, tag=ROAD_TAG)
    assert seen(stage).visible_px == 0
    assert seen(stage, method="depth").visible_px == 0


def test_without_tags_the_road_under_the_car_is_not_the_car() -> None:
    stage = PaintedImages()
    paint_road(stage, -0.76)
    assert seen(stage, method="depth", with_tags=False).visible_px == 0
    stage.paint_box(CENTER, CAR_EXTENT, CAR_ID)
    assert seen(stage, method="depth", with_tags=False).visible_px > 300


def paint_road(stage: PaintedImages, height_m: float) -> None:
    down = stage.rays[..., 2] < 0.0
    with np.errstate(divide="ignore"):
        road = np.where(down, height_m / stage.rays[..., 2], 1e9)
    stage.paint(down, road, 0, ROAD_TAG)


@pytest.mark.parametrize("method", ["instance", "depth"])
def test_the_road_before_a_car_does_not_occlude_it(method: str) -> None:
    """The inflated box reaches 5 cm into the road, where its rays never get."""
    stage = PaintedImages()
    stage.paint_box((20.0, 0.0, -1.0), CAR_EXTENT, CAR_ID)
    paint_road(stage, -1.75)
    ids, tags = decode_instance_bgra(stage.bgra)
    evidence = ImageEvidence(
        stage.depth.astype(np.float32), ids if method == "instance" else None, tags
    )
    found = measure(view((20.0, 0.0, -1.0)), K, evidence, CAR_ID, TAGS)
    assert found.occlusion_ratio == 0.0
    assert found.visible_px > 300


def test_a_crest_before_a_car_does_occlude_it() -> None:
    stage = PaintedImages()
    stage.paint_box((20.0, 0.0, -1.0), CAR_EXTENT, CAR_ID)
    paint_road(stage, -1.75)
    below_the_roof = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    below_the_roof[194:] = True
    stage.paint(below_the_roof, 9.0, 0, ROAD_TAG)
    ids, tags = decode_instance_bgra(stage.bgra)
    evidence = ImageEvidence(stage.depth.astype(np.float32), ids, tags)
    found = measure(view((20.0, 0.0, -1.0)), K, evidence, CAR_ID, TAGS)
    assert found.occlusion_ratio > 0.3


@pytest.mark.parametrize(
    ("visibility", "token"),
    [(0.0, 1), (0.39, 1), (0.4, 2), (0.6, 3), (0.8, 4), (1.0, 4)],
)
def test_visibility_tokens_are_nuscenes_bins(visibility: float, token: int) -> None:
    assert visibility_token(visibility) == token


@pytest.mark.parametrize(("ratio", "level"), [(0.10, 0), (0.11, 1), (0.50, 1), (0.51, 2)])
def test_occlusion_bins(ratio: float, level: int) -> None:
    assert occlusion_bin(ratio) == level


WALKER_ID = 301
CAPSULE = (0.19, 0.19, 0.93)
OPEN_REACH = (0.69, 0.69, 1.13)


def walker_with_arms(arm_depth_m: float = 10.0, arm_id: int = WALKER_ID) -> PaintedImages:
    """A capsule 10 m ahead, and an arm beside it: 0.10 to 0.35 m outside the box."""
    stage = PaintedImages()
    stage.paint_box((10.0, 0.0, 0.0), CAPSULE, WALKER_ID, WALKER_TAG)
    stage.paint(arm_pixels(), arm_depth_m, arm_id, WALKER_TAG)
    return stage


def arm_pixels() -> NDArray[np.bool_]:
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    mask[170:180, round(320 + 0.29 * 32) : round(320 + 0.54 * 32)] = True
    return mask


def seen_walker(stage: PaintedImages, reach: bool = True) -> PixelVisibility:
    ids, tags = decode_instance_bgra(stage.bgra)
    evidence = ImageEvidence(stage.depth.astype(np.float32), ids, tags)
    box = view((10.0, 0.0, 0.0), extent=CAPSULE)
    whole = Reach(np.array(OPEN_REACH), (0, 0, WIDTH, HEIGHT))
    walker = np.arange(256) == WALKER_TAG
    return measure(replace(box, reach=whole if reach else None), K, evidence, WALKER_ID, walker)


def test_an_arm_outside_the_capsule_is_the_walkers() -> None:
    without = seen_walker(walker_with_arms(), reach=False)
    found = seen_walker(walker_with_arms())
    arm = arm_pixels()
    assert found.outside_px == arm.sum() > 50
    assert found.visible_px == without.visible_px + arm.sum()
    assert (found.hull_px, found.front_px) == (without.hull_px, without.front_px)
    assert found.mask is not None
    full = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    height, width = found.mask.crop.shape
    full[found.mask.y0 :, found.mask.x0 :][:height, :width] = found.mask.crop
    assert full[arm].all()
    assert found.mask.bounds()[2] == np.nonzero(arm.any(axis=0))[0].max() + 1
    assert found.amodal_px == found.visible_px
    assert found.occlusion_ratio == 0.0


@pytest.mark.parametrize("stage", [walker_with_arms(arm_id=302), walker_with_arms(12.0)])
def test_what_is_not_the_walkers_or_out_of_reach_does_not_count(stage: PaintedImages) -> None:
    assert seen_walker(stage).outside_px == 0


def test_an_arm_before_the_capsule_hides_nothing_of_its_walker() -> None:
    stage = walker_with_arms()
    middle = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    middle[170:190, 316:324] = True
    stage.paint(middle, 9.4, WALKER_ID, WALKER_TAG)
    assert seen_walker(stage, reach=False).front_px >= middle.sum()
    assert seen_walker(stage).front_px == 0


def test_a_hidden_capsule_with_an_arm_in_view_keeps_a_finite_estimate() -> None:
    stage = walker_with_arms()
    cover = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    cover[:, 310:329] = True
    stage.paint(cover, 5.0, 0, ROAD_TAG)
    found = seen_walker(stage)
    assert found.visible_px == found.outside_px > 50
    assert found.front_px == found.hull_px
    assert found.amodal_px == found.visible_px + 0.8 * found.hull_px
    assert found.occlusion_ratio == 1.0 - found.visible_px / found.amodal_px
