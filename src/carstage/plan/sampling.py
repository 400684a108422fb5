"""The values that an episode of a campaign gets, by its index alone.

A value follows from the configuration's seed, the episode's index, and the path of the setting. So
it is the same on every machine, and another sampled setting does not change it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Mapping
from hashlib import blake2b
from itertools import accumulate
from math import prod
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.config import Config
from carstage.config.dimensions import Dimension, Path, Variants, crossed, dimensions
from carstage.errors import ConfigError
from carstage.plan.draws import Draws, seed_words

_DIGITS = 6
"""Of a number, relative to what it is drawn from: others tell no difference, and rounded ones are
the same with every mathematical library."""
_NAMED_STREAM = 0x8000_0000
"""Streams from here on are hashes of names; those of seeds are small numbers."""
_MOST_BLOCKS = 64


class Sampling:
    """The sampled settings of a configuration, and their values by index.

    Args:
        config: a configuration; without a campaign every episode is as it says.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self.dimensions = dimensions(config)
        self._crossed = crossed(config)
        self._cells = prod(len(dimension.levels or ()) for dimension in self._crossed)
        self._draws = Draws(config.seed)
        self._streams = {one.path: stream_of(one.name) for one in self.dimensions}
        self._ranks: OrderedDict[tuple[int, int], NDArray[np.int64]] = OrderedDict()
        self._variants = Variants(config, [one.path for one in self.dimensions])

    def config(self, index: int) -> Config:
        """The configuration of one episode.

        Args:
            index: of the episode.

        Raises:
            ConfigError: its values do not go together, though each is right by itself.
        """
        if not self.dimensions:
            return self._config
        values = self.values(index)
        try:
            return self._variants.with_values(values)
        except ConfigError as error:
            drawn = ", ".join(
                f"{one.name} = {values[one.path]!r:.60}" for one in self.dimensions[:6]
            )
            raise ConfigError(
                f"{error.message} So it is in episode {index} of the campaign, with {drawn}.",
                error.hint,
                error.problems,
            ) from error

    def values(self, index: int) -> Mapping[Path, Any]:
        """The plain values of one episode by path.

        Args:
            index: of the episode.
        """
        found = dict(zip((one.path for one in self._crossed), self._cell(index), strict=True))
        for dimension in self.dimensions:
            if dimension.path not in found:
                found[dimension.path] = value_at(dimension, self._unit(dimension, index))
        return found

    def _cell(self, index: int) -> tuple[Any, ...]:
        """The combination of an index: all come once, then all once more, the last one fastest."""
        left = index % self._cells
        chosen = []
        for dimension in reversed(self._crossed):
            levels = dimension.levels or ()
            left, position = divmod(left, len(levels))
            chosen.append(levels[position])
        return tuple(reversed(chosen))

    def _unit(self, dimension: Dimension, index: int) -> float:
        """Where in its distribution a value is, in [0, 1)."""
        campaign = self._config.campaign
        stream = self._streams[dimension.path]
        drawn = self._draws.unit(index, stream)
        if campaign is None or campaign.method != "latin_hypercube":
            return drawn
        block, position = divmod(index, campaign.block)
        return (int(self._ranks_of(block, stream, campaign.block)[position]) + drawn) / (
            campaign.block
        )

    def _ranks_of(self, block: int, stream: int, size: int) -> NDArray[np.int64]:
        """``(size,)``: a permutation of the cells of a Latin hypercube, for a block of indices."""
        key = (block, stream)
        found = self._ranks.get(key)
        if found is None:
            indices = np.arange(block * size, (block + 1) * size, dtype=np.uint32)
            words = seed_words(self._config.seed, indices, stream ^ 1, 2).astype(np.uint64)
            order = np.argsort(words[0] << np.uint64(32) | words[1], kind="stable")
            found = np.empty(size, np.int64)
            found[order] = np.arange(size)
            self._ranks[key] = found
            if len(self._ranks) > _MOST_BLOCKS:
                self._ranks.popitem(last=False)
        return found


def stream_of(name: str) -> int:
    """The stream of random numbers of a sampled setting; the odd one beside it is its own, too."""
    digest = int.from_bytes(blake2b(name.encode(), digest_size=4).digest(), "little")
    return (digest | _NAMED_STREAM) & ~1


def value_at(dimension: Dimension, unit: float) -> Any:
    """The value at a place of a distribution.

    Args:
        dimension: the setting.
        unit: share of the distribution that is below, in [0, 1).
    """
    sampled = dimension.sampled
    if sampled.choice is not None:
        sums = list(accumulate(sampled.weights or (1.0,) * len(sampled.choice)))
        place = bisect_right(sums, unit * sums[-1])
        return sampled.choice[min(place, len(sums) - 1)]
    if sampled.range is not None:
        low, high = sampled.range
        if dimension.is_integer:
            return min(int(low) + int(unit * (int(high) - int(low) + 1)), int(high))
        return _within(low, high, low + unit * (high - low))
    assert sampled.normal is not None
    assert sampled.min is not None
    assert sampled.max is not None
    normal = NormalDist(*sampled.normal)
    below, above = normal.cdf(sampled.min), normal.cdf(sampled.max)
    share = below + unit * (above - below)
    ends = sampled.min if share <= 0.0 else sampled.max
    value = normal.inv_cdf(share) if 0.0 < share < 1.0 else ends
    if dimension.is_integer:
        return int(max(sampled.min, min(sampled.max, round(value))))
    return _within(sampled.min, sampled.max, value)


def _within(low: float, high: float, value: float) -> float:
    """A value that is rounded to what can be told in a range, and not outside of it."""
    exponent = int(f"{high - low:e}".partition("e")[2])
    return float(max(low, min(high, round(value, _DIGITS - 1 - exponent))))
