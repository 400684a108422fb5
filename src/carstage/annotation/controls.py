"""Rows of ``controls.parquet``: what the ego's driver commanded in each tick."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from carstage.rawlog.reader import WorldFrame
from carstage.spec import Command, EpisodeSpec

_FLAGS = ("hand_brake", "reverse", "manual_gear_shift")


def control_rows(
    spec: EpisodeSpec, frames: Iterable[WorldFrame], episode_id: str
) -> list[dict[str, Any]]:
    """One row for each tick, saved or not.

    Args:
        spec: the episode, or an agent's part of it.
        frames: its ticks in order.
        episode_id: the episode's; the spec of an agent has one of its own.
    """
    rows = []
    for world in frames:
        command = Command(*world.meta["driver"])._asdict()
        rows.append(
            {
                "tick": world.tick,
                "k": spec.saved.index(world.tick),
                "server_frame": world.frame,
                "episode_id": episode_id,
                **command,
                **{name: bool(command[name]) for name in _FLAGS},
            }
        )
    return rows
