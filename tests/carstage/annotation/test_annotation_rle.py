"""Masks as COCO run lengths, read back by a plain decoder of the published format."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from carstage.annotation.pixels import ModalMask
from carstage.annotation.rle import encode_mask


def decode(text: str, width: int, height: int) -> NDArray[np.bool_]:
    """``rleFrString`` and ``rleDecode`` of COCO's maskApi, step by step."""
    counts: list[int] = []
    position = 0
    while position < len(text):
        value, group, more = 0, 0, True
        while more:
            bits = ord(text[position]) - 48
            value |= (bits & 0x1F) << 5 * group
            more = bool(bits & 0x20)
            position += 1
            group += 1
            if not more and bits & 0x10:
                value |= -1 << 5 * group
        if len(counts) > 2:
            value += counts[-2]
        counts.append(value)
    pixels = np.zeros(width * height, dtype=np.bool_)
    at = 0
    for i, count in enumerate(counts):
        pixels[at : at + count] = bool(i % 2)
        at += count
    assert at == width * height
    return pixels.reshape(width, height).T


def whole(crop: NDArray[np.bool_], x0: int, y0: int, width: int, height: int) -> NDArray[np.bool_]:
    mask = np.zeros((height, width), dtype=np.bool_)
    mask[y0 : y0 + crop.shape[0], x0 : x0 + crop.shape[1]] = crop
    return mask


@given(
    size=st.tuples(st.integers(1, 70), st.integers(1, 60)),
    seed=st.integers(0, 2**32 - 1),
    share=st.sampled_from([0.0, 0.02, 0.5, 0.98, 1.0]),
    data=st.data(),
)
@settings(max_examples=100, deadline=None)
def test_masks_survive_encoding(
    size: tuple[int, int], seed: int, share: float, data: st.DataObject
) -> None:
    w, h = size
    crop = np.random.default_rng(seed).random((h, w)) < share
    x0, y0 = data.draw(st.integers(0, 30)), data.draw(st.integers(0, 400))
    width = w + x0 + data.draw(st.integers(0, 30))
    height = h + y0 + data.draw(st.integers(0, 400))
    text = encode_mask(crop, x0, y0, width, height)
    np.testing.assert_array_equal(decode(text, width, height), whole(crop, x0, y0, width, height))


def test_runs_count_columns_from_the_top_left_and_the_fourth_is_a_difference() -> None:
    """Small counts are one character from '0' on."""
    crop = np.array([[True, False], [True, True]])
    assert encode_mask(crop, 1, 0, 3, 2) == "221O"  # 2, 2, 1, 1
    assert encode_mask(crop, 0, 0, 2, 2) == "021O"  # 0, 2, 1, 1
    assert encode_mask(np.zeros((2, 2), dtype=np.bool_), 0, 0, 3, 2) == "6"


def test_a_mask_that_is_wholly_set_is_one_run_after_no_zeros() -> None:
    assert encode_mask(np.ones((360, 640), dtype=np.bool_), 0, 0, 640, 360) == "0PPQ7"


@pytest.mark.parametrize(("i", "j"), [(0, 0), (17, 5), (63, 35)])
def test_the_box_of_a_single_pixel_is_one_by_one(i: int, j: int) -> None:
    x0, y0, x1, y1 = ModalMask(np.ones((1, 1), dtype=np.bool_), i, j).bounds()
    assert (x0, y0, x1 - x0, y1 - y0) == (i, j, 1.0, 1.0)
