"""Names that the parts of a dataset have in every store."""

from __future__ import annotations

import re

from carstage.errors import StorageError

ATTEMPT = re.compile(r"a([1-9][0-9]*)")
"""Name of an attempt; its number."""
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
"""Of an episode or an attempt: it cannot lead out of the dataset."""

AGENTS = "agents"
"""Folder of an episode that holds one folder for each agent beside the ego."""


def agent_folder(name: str) -> str:
    """Folder of an agent beside the ego, relative to the episode's."""
    return f"{AGENTS}/{name}"


def check_attempt(episode_id: str, attempt: str) -> None:
    """Refuse names that could lead out of the dataset.

    Raises:
        StorageError: one cannot be the name of a folder.
    """
    for what, name in (("episode id", episode_id), ("attempt", attempt)):
        if not NAME.fullmatch(name):
            raise StorageError(
                f"{name!r} cannot be the name of a folder ({what}).",
                "Use letters, digits, '_', '.' and '-'.",
            )
