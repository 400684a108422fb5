"""Golden tests D1-D6, D9: depth, instance ids, tag tables, LiDAR and radar records."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from carstage.annotation.decoding import (
    DEPTH_STEP_M,
    decode_depth_bgra,
    decode_instance_bgra,
)
from carstage.annotation.pixels import shared_low_ids
from carstage.annotation.point_sensors import (
    radar_points,
    record_dtype,
)
from carstage.errors import AnnotationError
from carstage.geometry import range_per_depth
from carstage.tags import (
    TAGS_0_9_13,
    TAGS_0_9_14,
    new_tag,
    server_release,
    tag_table,
    vehicle_tags,
    walker_tags,
)


def pixel(*bgra: int) -> np.ndarray:
    return np.array([[bgra]], dtype=np.uint8)


@pytest.mark.parametrize(
    ("bgra", "depth_m"),
    [
        ((0, 0, 0, 255), 0.0),
        ((255, 255, 255, 255), 1000.0),
        ((1, 0, 0, 7), 3.906250233),
        ((2, 143, 92, 255), 9.999991059),
    ],
)
def test_depth_pixels_have_the_golden_distance(
    bgra: tuple[int, int, int, int], depth_m: float
) -> None:
    assert decode_depth_bgra(pixel(*bgra))[0, 0] == np.float32(depth_m)


def test_depth_equals_the_channel_formula_on_any_image() -> None:
    image = np.random.default_rng(2).integers(0, 256, (60, 80, 4), dtype=np.uint8)
    blue, green, red = (image[..., i].astype(np.float64) for i in range(3))
    formula = (red + 256 * green + 65536 * blue) * DEPTH_STEP_M
    np.testing.assert_array_equal(decode_depth_bgra(image), formula.astype(np.float32))
    np.testing.assert_array_equal(
        decode_depth_bgra(image[::2, 1::3]), formula[::2, 1::3].astype("f4")
    )


def test_depth_is_along_the_optical_axis_not_the_ray() -> None:
    code = round(10.0 / DEPTH_STEP_M)
    bgra = (code >> 16, code >> 8 & 255, code & 255, 255)
    depth = decode_depth_bgra(np.tile(pixel(*bgra), (72, 128, 1)))
    assert np.ptp(depth) == 0.0
    ranges = depth * range_per_depth(128, 72, 90.0)
    x, y = 63.5 / 64, 35.5 / 64
    assert ranges[0, 0] == pytest.approx(10.0 * np.sqrt(1 + x * x + y * y), abs=1e-4)


@pytest.mark.parametrize(
    ("red_green_blue", "tag", "low_id"), [((10, 66, 81), 10, 20802), ((14, 49, 159), 14, 40753)]
)
def test_instance_pixels_hold_tag_and_low_id(
    red_green_blue: tuple[int, int, int], tag: int, low_id: int
) -> None:
    ids, tags = decode_instance_bgra(pixel(*red_green_blue[::-1], 255))
    assert (int(ids[0, 0]), int(tags[0, 0])) == (low_id, tag)


@pytest.mark.parametrize("shape", [(4, 4, 3), (4, 4)])
def test_images_that_are_not_bgra_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(AnnotationError, match="BGRA"):
        decode_depth_bgra(np.zeros(shape, dtype=np.uint8))
    with pytest.raises(AnnotationError, match="BGRA"):
        decode_instance_bgra(np.zeros((4, 4, 4), dtype=np.uint16))  # type: ignore[arg-type]


def test_a_low_id_is_ambiguous_only_with_another_live_actor() -> None:
    assert shared_low_ids(np.array([1, 2, 65537], dtype=np.uint32)) == {1}
    assert shared_low_ids(np.array([2, 65537], dtype=np.uint32)) == frozenset()


def test_tag_tables_are_complete() -> None:
    assert list(TAGS_0_9_13) == list(range(23))
    assert list(TAGS_0_9_14) == list(range(29))
    assert TAGS_0_9_14[14].rgb == (0, 0, 142)
    assert TAGS_0_9_14[24].name == "RoadLine"


def test_old_tags_map_to_new_tags_of_the_same_name() -> None:
    renamed = {"Road": "Roads", "SideWalk": "SideWalks", "Vehicles": "Car"}
    for old, tag in TAGS_0_9_13.items():
        assert TAGS_0_9_14[new_tag(old)].name == renamed.get(tag.name, tag.name)
    assert new_tag(3) == 22


@pytest.mark.parametrize("tag", [-1, 23, 255])
def test_unknown_old_tags_are_refused(tag: int) -> None:
    with pytest.raises(AnnotationError, match=str(tag)):
        new_tag(tag)


def test_tags_follow_the_server_version() -> None:
    assert tag_table("0.9.13") is TAGS_0_9_13
    assert tag_table("0.9.14") is TAGS_0_9_14
    assert vehicle_tags("0.9.13") == {10, 4}
    assert vehicle_tags("0.9.16-dirty") == {13, 14, 15, 16, 17, 18, 19}
    assert (walker_tags("0.9.13"), walker_tags("0.9.15")) == ({4}, {12})
    assert server_release("0.9.16-12-gabc") == (0, 9, 16)


def test_servers_newer_than_all_known_ones_get_the_newest_table() -> None:
    assert tag_table("0.9.17") is TAGS_0_9_14
    assert tag_table("0.10.0") is TAGS_0_9_14


def test_text_that_is_no_version_is_refused() -> None:
    with pytest.raises(AnnotationError, match="unknown"):
        tag_table("unknown")


def test_semantic_lidar_ids_survive_above_24_bits() -> None:
    assert record_dtype("semantic_lidar").itemsize == 24
    raw = np.zeros(1, record_dtype("semantic_lidar"))
    raw["object_idx"] = 2**24 + 1
    again = np.frombuffer(raw.tobytes(), record_dtype("semantic_lidar"))
    assert int(again["object_idx"][0]) == 2**24 + 1
    assert float(np.float32(2**24 + 1)) != 2**24 + 1


def test_radar_detections_become_points() -> None:
    raw = np.array([-5.0, 0.1, 0.05, 30.0], dtype="<f4").tobytes()
    detection = np.frombuffer(raw, "<f4").reshape(-1, 4)
    np.testing.assert_allclose(
        radar_points(detection), [[29.812820, 2.991260, 1.499375]], atol=2e-6
    )


@given(st.integers(0, 0xFFFF), st.integers(0, 255))
def test_instance_pixels_round_trip(low_id: int, tag: int) -> None:
    ids, tags = decode_instance_bgra(pixel(low_id >> 8, low_id & 255, tag, 0))
    assert (int(ids[0, 0]), int(tags[0, 0])) == (low_id, tag)
