"""What exports say of the variants of episodes; nothing where there are none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from carstage.dataset import Episode


def variant_entry(episode: Episode) -> dict[str, str]:
    """Entries for what a format says of an episode: its variant, and what all variants share."""
    if episode.variant is None:
        return {}
    return {"variant": episode.variant, "base_id": episode.base_id}


def episode_entries(episodes: Sequence[Episode]) -> dict[str, Any]:
    """Entries of ``export.json``: ids of the episodes, and the variants' names by them."""
    names = {episode.id: episode.variant for episode in episodes if episode.variant is not None}
    entries: dict[str, Any] = {"episode_ids": [episode.id for episode in episodes]}
    return {**entries, "variants": names} if names else entries
