"""Hashes side by side are those of ``hashlib``."""

from __future__ import annotations

import hashlib
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from carstage.files import digests
from carstage.files.sha256_lanes import LANES
from carstage.files.sha256_lanes import digests as digests_of

#: Around the ends of blocks and of what fits beside the length in the last one.
_EDGES = [0, 1, 55, 56, 63, 64, 65, 119, 120, 127, 128, 129]


def _right(contents: list[bytes]) -> list[str]:
    return [hashlib.sha256(content).hexdigest() for content in contents]


@settings(deadline=None)  # the first call compiles
@given(
    lengths=st.lists(st.sampled_from(_EDGES) | st.integers(0, 5000), min_size=1, max_size=LANES),
    seed=st.integers(0, 1000),
)
def test_lanes_give_the_hashes_of_hashlib(lengths: list[int], seed: int) -> None:
    made = random.Random(seed)
    contents = [made.randbytes(length) for length in sorted(lengths, reverse=True)]
    assert [digest.hex() for digest in digests_of(contents)] == _right(contents)


def test_contents_of_any_number_size_and_order_are_hashed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(digests, "_lanes_pay", lambda: True)  # on this processor as on any other
    made = random.Random(1)
    for number in (0, 1, 3, 4, 16, 17, 40):
        contents = [made.randbytes(made.choice([10, 1 << 16, 70_001])) for _ in range(number)]
        assert digests.sha256_of_each(contents) == _right(contents)


def test_lanes_refuse_what_they_cannot_hash() -> None:
    with pytest.raises(ValueError, match="longest first"):
        digests_of([b"a", b"bb"])
    with pytest.raises(ValueError, match="at most sixteen"):
        digests_of([b"a"] * (LANES + 1))
