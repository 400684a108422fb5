"""A committed episode as commands of its driver, for driver ``replay``."""

from __future__ import annotations

from pathlib import Path

from carstage.dataset.reading import Episode
from carstage.dataset.trajectories import read_episode
from carstage.errors import ConfigError
from carstage.plan import Drive
from carstage.spec import Command

_FIELD = "ego.driver.episode"


def read_drive(path: str | Path) -> Drive:
    """What the ego's driver did in an episode, step by step.

    Args:
        path: the episode's folder, ``DATASET/episodes/<id>/<attempt>`` (or its parent), or the
            dataset's if it has only one episode.

    Raises:
        ConfigError: there is no such episode, or no driver drove in it; the message begins with
            ``ego.driver.episode``.
    """
    return read_episode(path, _FIELD, _drive)


def _drive(episode: Episode) -> Drive:
    table = episode.controls()
    if table is None:
        raise ConfigError(
            f"{_FIELD}: in {episode.folder} the Traffic Manager drove, or another program did.",
            "Give an episode that a driver drove; scenario replay moves everybody as in any other.",
        )
    rows = table.select(["tick", *Command._fields]).to_pylist()
    commands = tuple(
        Command(
            row["throttle"],
            row["steer"],
            row["brake"],
            int(row["hand_brake"]),
            int(row["reverse"]),
            int(row["manual_gear_shift"]),
            row["gear"],
        )
        for row in rows
    )
    if [row["tick"] for row in rows] != list(range(len(rows))):
        raise ConfigError(
            f"{_FIELD}: the commands in {episode.folder} are not one for each step.",
            "Check the dataset with `carstage validate`.",
        )
    return Drive(episode.spec, commands)
