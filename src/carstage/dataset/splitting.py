"""Making ``splits.json``: the splits that belong to a dataset."""

from __future__ import annotations

import json
from collections.abc import Sequence

from carstage.dataset.collection import Dataset
from carstage.dataset.reading import Episode
from carstage.dataset.splits import SPLITS_FILE, Criterion, SplitRule, StoredSplits
from carstage.errors import BadInputError
from carstage.files.whole import write_whole
from carstage.storage.remote_path import DatasetPath, RemotePath

_OWN_WEATHER = "own"
"""Stratum of all weathers without a preset."""


def split_dataset(
    path: str | DatasetPath, rule: SplitRule, *, overwrite: bool = False
) -> StoredSplits:
    """Draw the split of every committed episode and store it in the dataset.

    Args:
        path: folder or address of the dataset.
        rule: shares, seed, strata.
        overwrite: replace splits that the dataset has.

    Returns:
        What was stored in ``splits.json``.

    Raises:
        BadInputError: the dataset has splits, or fewer episodes than splits are asked for.
        DatasetError: the folder is no dataset, or an episode cannot be read.
    """
    dataset = Dataset(path)
    target = dataset.path / SPLITS_FILE
    if target.exists() and not overwrite:
        raise BadInputError(
            f"{target} exists already.",
            "Episodes that were recorded later have their split by its rule. --overwrite draws "
            "all of them anew.",
        )
    stored = draw_splits(dataset.episodes, rule)
    if isinstance(target, RemotePath):
        target.write_bytes(stored.to_bytes())
    else:
        write_whole(target, stored.to_bytes())
    return stored


def draw_splits(episodes: Sequence[Episode], rule: SplitRule) -> StoredSplits:
    """Draw the split of episodes; variants of one episode are in one split.

    Args:
        episodes: those of a dataset.
        rule: shares, seed, strata.

    Raises:
        BadInputError: there are fewer episodes than splits are asked for.
        DatasetError: an episode cannot be read.
    """
    members: dict[str, list[Episode]] = {}
    for episode in episodes:
        members.setdefault(episode.base_id, []).append(episode)
    strata = {
        base_id: " ".join(sorted({stratum(episode, rule.stratify) for episode in group}))
        for base_id, group in members.items()
    }
    drawn = rule.draw(strata)
    return StoredSplits(
        rule,
        {episode.id: drawn[episode.base_id] for episode in episodes},
        {e.base_id: drawn[e.base_id] for e in episodes if e.variant is not None},
    )


def stratum(episode: Episode, criteria: Sequence[Criterion]) -> str:
    """What an episode has in common with others, as text."""
    spec = episode.spec
    values = {"map": spec.map, "weather": spec.weather.preset or _OWN_WEATHER}
    return json.dumps([values[name] for name in criteria])
