"""Which episodes are for training and which for validation."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Final, Literal

from carstage.dataset import Episode

Split = Literal["train", "val"]
SPLITS: Final[tuple[Split, ...]] = ("train", "val")


def split_episodes(episodes: Sequence[Episode], validation_share: float) -> dict[str, Split]:
    """The split of each episode by its id.

    Whole episodes are drawn, as frames of one episode are too alike; by a hash of the id, so that
    the draw is the same each time. With a share above 0 both splits get an episode, if there are
    two at least; a single one is for training.
    """
    count = round(validation_share * len(episodes))
    if validation_share > 0.0:
        count = min(max(count, 1), len(episodes) - 1)
    drawn = sorted(hashlib.sha256(episode.id.encode()).digest() for episode in episodes)[:count]
    return {
        episode.id: "val" if hashlib.sha256(episode.id.encode()).digest() in drawn else "train"
        for episode in episodes
    }
