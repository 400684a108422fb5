"""Our deflate: every stream is one that zlib reads back, whatever the bytes are."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from carstage.codecs.png import ZlibOfRuns

BLOCK_BYTES = 1 << 17


def zlib_of_runs(data: NDArray[np.uint8]) -> bytes:
    return b"".join(ZlibOfRuns()(data))


def read_back(data: NDArray[np.uint8]) -> bytes:
    return zlib.decompress(zlib_of_runs(data))


@settings(max_examples=150, deadline=None)
@given(
    pieces=st.lists(
        st.tuples(st.binary(min_size=1, max_size=40), st.integers(1, 900)), min_size=1, max_size=8
    )
)
def test_any_bytes_come_back(pieces: list[tuple[bytes, int]]) -> None:
    data = np.frombuffer(b"".join(piece * times for piece, times in pieces), np.uint8)
    assert read_back(data) == data.tobytes()


@pytest.mark.parametrize("size", [1, 7, 8, 9, BLOCK_BYTES - 1, BLOCK_BYTES, 2 * BLOCK_BYTES + 5])
@pytest.mark.parametrize("fill", ["same", "noise", "all values alike"])
def test_ends_of_words_and_blocks(size: int, fill: str) -> None:
    random = np.random.default_rng(size)
    data = {
        "same": np.full(size, 3, np.uint8),
        "noise": np.clip(random.normal(0, 6, size), -128, 127).astype(np.int8).view(np.uint8),
        "all values alike": random.integers(0, 256, size).astype(np.uint8),
    }[fill]
    stream = zlib_of_runs(data)
    assert zlib.decompress(stream) == data.tobytes()
    assert stream == zlib_of_runs(data.copy())


def test_codes_that_would_be_too_long_are_shortened() -> None:
    """Counts like Fibonacci's give the deepest tree: 24 levels where 15 are allowed."""
    counts = [1, 1]
    while sum(counts) < BLOCK_BYTES - 50_000:
        counts.append(counts[-1] + counts[-2])
    data = np.repeat(np.arange(len(counts), dtype=np.uint8), counts)
    np.random.default_rng(0).shuffle(data)
    assert len(counts) > 20
    assert read_back(data) == data.tobytes()


def test_noise_takes_little_more_than_its_entropy() -> None:
    noise = np.rint(np.random.default_rng(1).normal(0, 5.7, 1 << 20)).astype(np.int8)
    shares = np.unique(noise, return_counts=True)[1] / noise.size
    entropy_bytes = -(shares * np.log2(shares)).sum() * noise.size / 8
    assert len(zlib_of_runs(noise.view(np.uint8))) < 1.02 * entropy_bytes


def test_flat_pictures_are_small() -> None:
    assert len(zlib_of_runs(np.zeros(3 << 20, np.uint8))) < 20_000
