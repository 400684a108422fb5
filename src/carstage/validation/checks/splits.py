"""Whether the stored splits fit the episodes."""

from __future__ import annotations

from carstage.dataset.collection import Dataset
from carstage.errors import DatasetError
from carstage.validation.checks.findings import Findings


def check_splits(dataset: Dataset, findings: Findings) -> None:
    """Read ``splits.json``, if there is one, and compare it with the episodes."""
    try:
        stored = dataset.stored_splits
    except DatasetError as error:
        findings.add("splits", str(error))
        return
    if stored is None:
        return
    present = {episode.id for episode in dataset.episodes}
    for name in stored.lost(present):
        findings.add(
            "splits",
            f"splits.json has the episode {name}, and the dataset does not",
            severity="warning",
        )
    used = set(dataset.splits().values())
    for split in stored.rule.wanted:
        if split not in used:
            findings.add("splits", f"no episode is in the split {split}", severity="warning")
