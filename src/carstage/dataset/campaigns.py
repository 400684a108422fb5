"""What of a campaign is recorded: episodes by sampled value, combinations, quotas."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from carstage.config import Config
from carstage.config.dimensions import Dimension, Path, crossed
from carstage.dataset.collection import Dataset
from carstage.dataset.quotas import QuotaCounts
from carstage.plan import PlanMatcher

_BINS = 10


@dataclass(frozen=True, slots=True)
class Bin:
    """Values of a setting, and the episodes that have one of them.

    Attributes:
        label: the value, or the low and the high end.
        planned: episodes of the whole campaign.
        episodes: those that are committed.
    """

    label: str
    planned: int
    episodes: int


@dataclass(frozen=True, slots=True)
class QuotaState:
    """How far a quota is."""

    name: str
    wanted: int
    frames: int

    @property
    def met(self) -> bool:
        """Whether there are enough."""
        return self.frames >= self.wanted


@dataclass(frozen=True, slots=True)
class CampaignState:
    """How far a campaign is.

    Attributes:
        name: of the configuration.
        method: how values are sampled; empty without a campaign.
        planned: episodes of the configuration.
        committed: those of them that the dataset holds.
        others: episodes of the dataset that are of other configurations.
        dimensions: bins by the path of each sampled setting.
        combinations: of a grid or of strata, how many there are; 0 otherwise.
        covered: combinations with a committed episode.
        quotas: in the order of the configuration.
    """

    name: str
    method: str
    planned: int
    committed: int
    others: int
    dimensions: Mapping[str, tuple[Bin, ...]]
    combinations: int
    covered: int
    quotas: tuple[QuotaState, ...]

    def to_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return {
            **asdict(self),
            "quotas": [{**asdict(quota), "met": quota.met} for quota in self.quotas],
        }


def campaign_state(config: Config, dataset: Dataset) -> CampaignState:
    """How far a campaign is in a dataset.

    Args:
        config: the configuration.
        dataset: where it is recorded.

    Raises:
        DatasetError: a document or a label table of the dataset is damaged.
    """
    matcher = PlanMatcher(config)
    sampling = matcher.sampling
    counts = QuotaCounts(() if config.campaign is None else config.campaign.quotas)
    numbers = set()
    for episode in dataset.episodes:
        number = matcher.number_of(episode.spec)
        if number is not None:
            numbers.add(number)
            counts.add(episode)
    of_one = config.planned_episodes // config.episodes
    planned = [sampling.values(number // of_one) for number in range(config.planned_episodes)]
    recorded = [planned[number] for number in sorted(numbers)]
    cells = [one.path for one in crossed(config)]
    return CampaignState(
        name=config.name,
        method="" if config.campaign is None else config.campaign.method,
        planned=config.planned_episodes,
        committed=len(numbers),
        others=len(dataset.episodes) - len(numbers),
        dimensions={one.name: _bins(one, planned, recorded) for one in sampling.dimensions},
        combinations=len(_cells(cells, planned)),
        covered=len(_cells(cells, recorded)),
        quotas=tuple(
            QuotaState(quota.name, quota.frames, counts.frames[quota.name])
            for quota in (() if config.campaign is None else config.campaign.quotas)
        ),
    )


def _cells(paths: Sequence[Path], values: Sequence[Mapping[Path, Any]]) -> set[tuple[str, ...]]:
    return {tuple(repr(one[path]) for path in paths) for one in values} if paths else set()


def _bins(
    dimension: Dimension,
    planned: Sequence[Mapping[Path, Any]],
    recorded: Sequence[Mapping[Path, Any]],
) -> tuple[Bin, ...]:
    """Episodes by value, or by equal parts of a range with many values."""
    labels = _Labels(dimension)
    of_all, of_recorded = (
        Counter(labels.of(one[dimension.path]) for one in values) for values in (planned, recorded)
    )
    return tuple(Bin(label, of_all[label], of_recorded[label]) for label in labels.all)


class _Labels:
    """The bins of a setting by their labels.

    Args:
        dimension: the setting.
    """

    def __init__(self, dimension: Dimension) -> None:
        ends = [value for _, value in dimension.sampled.ends]
        self._values = dimension.levels
        if dimension.is_integer and self._values is None and ends[-1] - ends[0] < _BINS:
            self._values = tuple(range(int(ends[0]), int(ends[-1]) + 1))
        if self._values is not None:
            self.all = tuple(dict.fromkeys(_text(value) for value in self._values))
            return
        self._low, high = ends
        self._width = (high - self._low) / _BINS
        edges = [self._low + self._width * part for part in range(_BINS)] + [high]
        self.all = tuple(f"{edges[part]:.6g} to {edges[part + 1]:.6g}" for part in range(_BINS))

    def of(self, value: Any) -> str:
        """The label of the bin of a value."""
        if self._values is not None:
            return _text(value)
        return self.all[min(_BINS - 1, max(0, int((value - self._low) / self._width)))]


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
