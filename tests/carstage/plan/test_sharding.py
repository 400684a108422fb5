"""Shares of a plan: together all of it, whatever their number."""

from __future__ import annotations

import pytest

from carstage.errors import BadInputError
from carstage.plan import Shard


@pytest.mark.parametrize("count", [1, 2, 3, 7, 20])
def test_shares_are_together_all_and_no_two_have_one(count: int) -> None:
    items = range(13)
    shares = [Shard(number, count).share(items) for number in range(1, count + 1)]
    assert sorted(item for share in shares for item in share) == list(items)
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


def test_more_episodes_stay_in_their_shares() -> None:
    for number in (1, 2, 3):
        few, many = (Shard(number, 3).share(range(count)) for count in (10, 50))
        assert many[: len(few)] == few


def test_a_share_is_written_as_it_is_read() -> None:
    assert str(Shard.parse(" 2/8 ")) == "2/8"
    assert Shard.parse("8/8") == Shard(8, 8)


@pytest.mark.parametrize(
    "text",
    ["", "2", "0/8", "9/8", "0/0", "1/0", "-1/2", "1/2/3", "a/b", "1.0/2", "1" * 5000, "٢/٨"],
)
def test_what_is_no_share_is_refused(text: str) -> None:
    with pytest.raises(BadInputError, match="shard: ") as caught:
        Shard.parse(text)
    assert len(str(caught.value)) < 200
