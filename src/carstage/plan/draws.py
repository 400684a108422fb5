"""Random numbers of episodes, many at once, the same as numpy draws one by one.

Each consumer of an episode has a seed sequence of its own: entropy is the configuration's seed,
the key is the episode's index and the consumer's stream. ``numpy.random.SeedSequence`` takes ten
microseconds for one. Its mixing, and PCG64's first steps, are done here for a block of episodes.

Sources: ``SeedSequence`` of numpy (O'Neill, "Developing a seed_seq alternative", 2015) and
O'Neill, "PCG" (HMC-CS-2014-0905, 2014), 128 bits, XSL-RR. numpy promises that the former stays.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Words: TypeAlias = NDArray[np.uint32]

BLOCK = 1024
"""Episodes whose numbers are computed together."""
_MOST_BLOCKS = 64
"""Blocks that are kept, of all streams together."""

_POOL = 4
_SHIFT = np.uint32(16)
_INIT_A, _MULT_A = 0x43B0D7E5, 0x931E8875
_INIT_B, _MULT_B = 0x8B51F9DD, 0x58F38DED
_MIX_L, _MIX_R = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)
_WORD = 0xFFFF_FFFF

_PCG_MULTIPLIER = (2549297995355413924 << 64) + 4865540595714422341
_MASK_128 = (1 << 128) - 1
_MASK_64 = (1 << 64) - 1
_UNIT = 1.0 / (1 << 53)


class Draws:
    """The numbers of the episodes of one seed; blocks of them are kept.

    Args:
        seed: of the configuration, 0 or more.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._blocks: OrderedDict[tuple[int, int, int], NDArray[np.uint32]] = OrderedDict()

    def word(self, index: int, stream: int) -> int:
        """An integer of 32 bits: the first word of the state of a seed sequence.

        Args:
            index: of the episode.
            stream: of the consumer.
        """
        return int(self._block(index // BLOCK, stream, 1)[0, index % BLOCK])

    def unit(self, index: int, stream: int) -> float:
        """A number in [0, 1) with 53 random bits: of the first two words of the state.

        Args:
            index: of the episode.
            stream: of the consumer.
        """
        words = self._block(index // BLOCK, stream, 2)[:, index % BLOCK]
        return (((int(words[1]) << 32) | int(words[0])) >> 11) * _UNIT

    def uniform(self, index: int, stream: int, count: int) -> tuple[float, ...]:
        """What ``numpy.random.default_rng(sequence).random(count)`` gives.

        Args:
            index: of the episode.
            stream: of the consumer.
            count: how many numbers.
        """
        words: list[int] = self._block(index // BLOCK, stream, 8)[:, index % BLOCK].tolist()
        return pcg64_doubles([words[i] | words[i + 1] << 32 for i in range(0, 8, 2)], count)

    def _block(self, block: int, stream: int, words: int) -> Words:
        key = (block, stream, words)
        found = self._blocks.get(key)
        if found is None:
            indices = np.arange(block * BLOCK, (block + 1) * BLOCK, dtype=np.uint32)
            found = self._blocks[key] = seed_words(self._seed, indices, stream, words)
            if len(self._blocks) > _MOST_BLOCKS:
                self._blocks.popitem(last=False)
        else:
            self._blocks.move_to_end(key)
        return found


def seed_words(seed: int, indices: Words, stream: int, count: int) -> Words:
    """``SeedSequence(seed, spawn_key=(index, stream)).generate_state(count)`` of many indices.

    Args:
        seed: 0 or more.
        indices: ``(N,)`` of episodes.
        stream: below 2³².
        count: words of the state.

    Returns:
        ``(count, N)``.
    """
    pool = _mixed(seed, indices, stream)
    state = np.empty((count, len(indices)), np.uint32)
    constant = _INIT_B
    for position in range(count):
        value = pool[position % _POOL] ^ np.uint32(constant)
        constant = constant * _MULT_B & _WORD
        value = value * np.uint32(constant)
        state[position] = value ^ (value >> _SHIFT)
    return state


def pcg64_doubles(state: Sequence[int], count: int) -> tuple[float, ...]:
    """The first numbers in [0, 1) of a PCG64.

    Args:
        state: four words of 64 bits: start and increment, high words first.
        count: how many numbers.
    """
    start, increment = state[0] << 64 | state[1], state[2] << 64 | state[3]
    increment = (increment << 1 | 1) & _MASK_128
    now = ((increment + start) * _PCG_MULTIPLIER + increment) & _MASK_128
    numbers = []
    for _ in range(count):
        now = (now * _PCG_MULTIPLIER + increment) & _MASK_128
        folded, turn = (now >> 64) ^ (now & _MASK_64), now >> 122
        turned = (folded >> turn | folded << (64 - turn)) & _MASK_64
        numbers.append((turned >> 11) * _UNIT)
    return tuple(numbers)


def _mixed(seed: int, indices: Words, stream: int) -> list[Words]:
    """The pool of entropy after mixing: four words of each index."""
    entropy: list[Words] = [np.full(len(indices), word, np.uint32) for word in _words(seed)]
    entropy += [indices, np.full(len(indices), stream, np.uint32)]
    hashing = _Hash()
    pool = [hashing(entropy[i]) for i in range(_POOL)]
    for source in range(_POOL):
        for target in range(_POOL):
            if source != target:
                pool[target] = _mix(pool[target], hashing(pool[source]))
    for extra in entropy[_POOL:]:
        for target in range(_POOL):
            pool[target] = _mix(pool[target], hashing(extra))
    return pool


def _words(seed: int) -> list[int]:
    """A seed's words, low ones first, at least as many as the pool has."""
    words = []
    while seed:
        words.append(seed & _WORD)
        seed >>= 32
    return words + [0] * (_POOL - len(words))


class _Hash:
    """Hashes words; the constant changes with every call."""

    def __init__(self) -> None:
        self._constant = _INIT_A

    def __call__(self, value: Words) -> Words:
        value = value ^ np.uint32(self._constant)
        self._constant = self._constant * _MULT_A & _WORD
        value = value * np.uint32(self._constant)
        return value ^ (value >> _SHIFT)


def _mix(one: Words, other: Words) -> Words:
    mixed: Words = _MIX_L * one - _MIX_R * other
    return mixed ^ (mixed >> _SHIFT)
