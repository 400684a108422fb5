"""Hashes side by side are those of ``hashlib``."""

from __future__ import annotations

import hashlib
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite import binding

from carstage.files import digests
from carstage.files.sha256.lanes import LANES, lane_digests
from carstage.files.sha256.pairs import pair_digests

#: Around the ends of blocks and of what fits beside the length in the last one.
_EDGES = [0, 1, 55, 56, 63, 64, 65, 119, 120, 127, 128, 129]
_LENGTHS = st.sampled_from(_EDGES) | st.integers(0, 5000)
_needs_sha = pytest.mark.skipif(
    not binding.get_host_cpu_features().get("sha"), reason="this processor has no SHA instructions"
)


def _right(contents: list[bytes]) -> list[str]:
    return [hashlib.sha256(content).hexdigest() for content in contents]


@settings(deadline=None)  # the first call compiles
@given(lengths=st.lists(_LENGTHS, min_size=1, max_size=LANES), seed=st.integers(0, 1000))
def test_lanes_give_the_hashes_of_hashlib(lengths: list[int], seed: int) -> None:
    made = random.Random(seed)
    contents = [made.randbytes(length) for length in sorted(lengths, reverse=True)]
    assert [digest.hex() for digest in lane_digests(contents)] == _right(contents)


@_needs_sha
@settings(deadline=None)  # the first call compiles
@given(first=_LENGTHS, second=_LENGTHS, seed=st.integers(0, 1000))
def test_pairs_give_the_hashes_of_hashlib(first: int, second: int, seed: int) -> None:
    made = random.Random(seed)
    contents = [made.randbytes(first), made.randbytes(second)]
    assert [digest.hex() for digest in pair_digests(*contents)] == _right(contents)


@pytest.mark.parametrize(
    "way", ["plain", "lanes", pytest.param("pairs", marks=_needs_sha)], ids=str
)
def test_contents_of_any_number_size_and_order_are_hashed(
    way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(digests, "_way", lambda: way)  # on this processor as on any other
    digests.load_digests()
    made = random.Random(1)
    for number in (0, 1, 2, 3, 4, 16, 17, 40):
        contents = [made.randbytes(made.choice([10, 1 << 16, 70_001])) for _ in range(number)]
        views = [memoryview(content) for content in contents]
        assert digests.sha256_of_each(contents) == _right(contents)
        assert digests.sha256_of_each(views) == _right(contents)


def test_lanes_refuse_what_they_cannot_hash() -> None:
    with pytest.raises(ValueError, match="longest first"):
        lane_digests([b"a", b"bb"])
    with pytest.raises(ValueError, match="at most sixteen"):
        lane_digests([b"a"] * (LANES + 1))
