"""Which episodes of an export are for training, validation and test."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from carstage.dataset import Dataset, Episode, SplitRule
from carstage.dataset.splits import SPLITS, Split, StoredSplits
from carstage.dataset.splitting import draw_splits
from carstage.exporters.options import ExportOptions

__all__ = ["SPLITS", "ExportSplits", "Split", "splits_of_export"]

_MOST_NAMED = 10


@dataclass(frozen=True, slots=True)
class ExportSplits:
    """The splits of an export.

    Attributes:
        episodes: the split of each episode by its id.
        warnings: what a user has to know about them, a sentence or two each.
    """

    episodes: Mapping[str, Split]
    warnings: tuple[str, ...]

    @property
    def counts(self) -> dict[Split, int]:
        """Episodes by split; splits without episodes are left out."""
        counts = Counter(self.episodes.values())
        return {split: counts[split] for split in SPLITS if counts[split]}


def splits_of_export(
    dataset: Dataset, episodes: Sequence[Episode], options: ExportOptions
) -> ExportSplits:
    """The splits by the shares of the options, else those of the dataset, else all ``train``.

    Args:
        dataset: may have splits of its own.
        episodes: those that are exported.
        options: may have shares.

    Raises:
        BadInputError: shares ask for more splits than there are episodes.
        DatasetError: the splits of the dataset are damaged.
    """
    ids = [episode.id for episode in episodes]
    if options.val_share is not None or options.test_share is not None:
        rule = SplitRule(options.val_share or 0.0, options.test_share or 0.0)
        return ExportSplits(draw_splits(episodes, rule).episodes, ())
    stored = dataset.stored_splits
    if stored is None:
        return ExportSplits(dict.fromkeys(ids, "train"), (_without_splits(len(ids)),))
    found = {episode.id: stored.of(episode.id, episode.base_id) for episode in episodes}
    present = {episode.id for episode in dataset.episodes}
    return ExportSplits(found, tuple(_of_stored(stored, found.values(), present)))


def _without_splits(episodes: int) -> str:
    only = "The only episode is" if episodes == 1 else f"All {episodes} episodes are"
    more = "record more episodes, then " if episodes == 1 else ""
    return (
        f"{only} in train; val and test are empty. To have them: {more}"
        f"carstage split DATASET --val 0.2 --test 0.1, or --val-share for this export."
    )


def _of_stored(
    stored: StoredSplits, used: Collection[Split], present: Collection[str]
) -> list[str]:
    warnings = []
    lost = stored.lost(present)
    if lost:
        named = ", ".join(lost[:_MOST_NAMED]) + ", …" * (len(lost) > _MOST_NAMED)
        warnings.append(f"splits.json names episodes that the dataset does not have: {named}.")
    empty = [split for split in stored.rule.wanted if split not in used]
    if empty:
        warnings.append(
            f"No episode is in {' or '.join(empty)}. Draw anew: carstage split --overwrite."
        )
    return warnings
