"""Tags, ids and bytes of pixels, whatever bands they are counted in."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel
from carstage_sim.render.cast import NOTHING, STATIC
from carstage_sim.render.crew import Shared, alone
from carstage_sim.render.motion import flow_of_motions, no_motion
from carstage_sim.render.pixel_kernels import InParts, in_one
from carstage_sim.sensors.cameras import (
    encode_depth,
    encode_instances,
    encode_normals,
    encode_tags,
)
from carstage_sim.sensors.view import View

TAGS = np.array([7, 1, 14, 22], np.uint8)
OBJECTS = np.array([0, 1, 9, 0x8001], np.uint32)
ACTORS = np.array([3, 70_000], np.uint32)


def in_threes(shared: Shared, data: tuple[Any, ...], count: int) -> None:
    """The parts in another order than that of the pixels."""
    for first in reversed(range(0, count, 3)):
        alone(shared, data, first, min(first + 3, count))


def a_view(in_parts: InParts) -> Any:
    frame = SimpleNamespace(
        static=SimpleNamespace(tag=TAGS, object_id=OBJECTS),
        actors=SimpleNamespace(tag=TAGS[::-1].copy()),
        actor_id=ACTORS,
    )
    return SimpleNamespace(frame=frame, in_parts=in_parts)


HITS: Any = SimpleNamespace(
    row=np.array([STATIC, STATIC, NOTHING, 0, 1, STATIC, STATIC], np.int32),
    triangle=np.array([0, 1, -1, 0, 3, 2, 3], np.int32),
)


@pytest.mark.parametrize("in_parts", [in_one, in_threes])
def test_tags_and_ids_are_those_of_the_triangle_and_the_actor(
    in_parts: InParts,
) -> None:
    view = a_view(in_parts)
    tags, ids = View.tags(view, HITS), View.instance_ids(view, HITS)
    assert tags.tolist() == [7, 1, int(CityObjectLabel.SKY), 22, 7, 14, 22]
    # Of level objects 0x8000 + index in 15 bits, of actors the low 16 bits.
    assert ids.tolist() == [0, 0x8000, 0, 3, 70_000 & 0xFFFF, 0x8008, 0x8000]
    pixels = encode_instances(tags, ids, in_parts)
    assert pixels.tolist() == [
        [number >> 8, number & 0xFF, tag, 255]
        for tag, number in zip(tags.tolist(), ids.tolist(), strict=True)
    ]


@pytest.mark.parametrize("in_parts", [in_one, in_threes])
def test_bytes_of_depths_are_numpys(
    in_parts: InParts,
) -> None:
    rng = np.random.default_rng(5)
    odd = [np.nan, np.inf, -np.inf, -0.0, -3.0, 1000.0, 1000.1, 999.99997]
    depth_m = np.concatenate([odd, rng.uniform(0.0, 1001.0, 4088)]).astype(np.float32)
    pixels = encode_depth(depth_m.reshape(64, 64), in_parts)
    steps = np.clip(np.fmin(depth_m.astype(np.float64), 1000.0), 0.0, None)
    code = np.rint(steps * ((2**24 - 1) / 1000.0)).astype(np.int64)
    wanted = np.stack([code >> 16, code >> 8 & 0xFF, code & 0xFF, np.full_like(code, 255)], axis=1)
    np.testing.assert_array_equal(pixels.reshape(-1, 4), wanted)
    assert pixels.shape == (64, 64, 4)


@pytest.mark.parametrize("in_parts", [in_one, in_threes])
def test_bytes_of_normals_are_numpys(
    in_parts: InParts,
) -> None:
    rng = np.random.default_rng(6)
    edges = [(1.0, -1.0, 0.0), (-0.0, 0.999999, -0.999999), (0.0, 0.0, 0.0)]
    normals = np.concatenate([edges, rng.uniform(-1.0, 1.0, (4093, 3))]).astype(np.float32)
    pixels = encode_normals(normals.reshape(64, 64, 3), in_parts)
    wanted = (normals * np.float32(127.5) + np.float32(128.0)).astype(np.uint8)
    np.testing.assert_array_equal(pixels.reshape(-1, 4)[:, 2::-1], wanted)
    assert pixels.shape == (64, 64, 4)
    assert (pixels[..., 3] == 255).all()


def test_a_semantic_picture_has_the_tag_in_red_and_nothing_else() -> None:
    tags = np.arange(35, dtype=np.uint8).reshape(5, 7)
    pixels = encode_tags(tags, in_threes)
    np.testing.assert_array_equal(pixels[..., 2], tags)
    assert not pixels[..., :2].any()
    assert (pixels[..., 3] == 255).all()


@pytest.mark.parametrize("in_parts", [in_one, in_threes])
def test_flow_is_from_the_earlier_places_within_bounds(in_parts: InParts) -> None:
    rng = np.random.default_rng(7)
    count = 40
    row = np.where(rng.random(count) < 0.2, NOTHING, STATIC).astype(np.int32)
    met = row, np.zeros(count, np.int32), np.zeros((count, 2), np.float32)
    depth = rng.uniform(0.1, 50.0, count).astype(np.float32)
    x, y = rng.uniform(-1, 1, count), rng.uniform(-1, 1, count)
    moved = no_motion(0)._replace(shift=np.array([[0.5, -0.2, 9.0]]))
    data = moved, *met, depth, x, y, 1.0, 0.6
    before, flow = np.empty((2, count)), np.empty((count, 2), np.float32)
    in_parts(flow_of_motions, (*data, before, flow), count)
    in_parts(flow_of_motions, (*data, np.empty((2, 0)), flow), count)
    near = np.where(row == NOTHING, 0.0, 1.0 / depth.astype(np.float64))
    ahead = 1.0 + 0.5 * near
    np.testing.assert_allclose(before[0], (x - 0.2 * near) / ahead)
    np.testing.assert_allclose(before[1], (y * -0.6 + 9.0 * near) / ahead / -0.6)
    wanted = np.stack([x - before[0], before[1] - y], axis=1).astype(np.float32)
    assert (wanted < -2.0).any()
    np.testing.assert_array_equal(flow, np.clip(wanted, -2.0, 2.0))
