"""Random numbers of many episodes at once are those that numpy draws one by one."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from carstage.plan.draws import BLOCK, Draws, seed_words

SEEDS = st.integers(0, 2**63 - 1)
INDICES = st.integers(0, 200_000)
STREAMS = st.integers(0, 2**32 - 1)


def sequence(seed: int, index: int, stream: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed, spawn_key=(index, stream))


@given(SEEDS, INDICES, STREAMS)
def test_words_are_those_of_a_seed_sequence(seed: int, index: int, stream: int) -> None:
    assert Draws(seed).word(index, stream) == sequence(seed, index, stream).generate_state(1)[0]


@given(SEEDS, INDICES, STREAMS)
def test_uniform_numbers_are_those_of_the_default_generator(
    seed: int, index: int, stream: int
) -> None:
    expected = np.random.default_rng(sequence(seed, index, stream)).random(5)
    assert Draws(seed).uniform(index, stream, 5) == tuple(expected)


@given(SEEDS, INDICES, STREAMS)
def test_unit_is_in_the_half_open_unit_interval(seed: int, index: int, stream: int) -> None:
    low, high = (int(word) for word in sequence(seed, index, stream).generate_state(2))
    drawn = Draws(seed).unit(index, stream)
    assert drawn == ((high << 32 | low) >> 11) / 2**53
    assert 0.0 <= drawn < 1.0


def test_long_seeds_are_mixed_whole() -> None:
    seed = 2**200 + 12345
    words = seed_words(seed, np.arange(3, dtype=np.uint32), 7, 9)
    for index in range(3):
        assert words[:, index].tolist() == sequence(seed, index, 7).generate_state(9).tolist()


def test_blocks_that_were_dropped_come_back_the_same() -> None:
    draws = Draws(3)
    first = draws.word(5, 0)
    for block in range(100):
        draws.word(block * BLOCK, 0)
    assert draws.word(5, 0) == first
