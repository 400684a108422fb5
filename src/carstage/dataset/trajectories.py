"""A committed episode as trajectories, for scenario ``replay``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from carstage.dataset.collection import Dataset
from carstage.dataset.reading import Episode
from carstage.dataset.tracks import may_come_back
from carstage.errors import ConfigError, DatasetError
from carstage.files.home import without_tilde
from carstage.geometry import FloatArray
from carstage.plan import Recording, Start, Track
from carstage.spec import Control

_COLUMNS = [
    *("k", "timestamp_s", "track_id", "blueprint", "actor_location", "actor_rotation_deg"),
    *("velocity", "acceleration", "angular_velocity"),
]
Read = TypeVar("Read")
_LOOKS = ("color", "driver_id", "role_name")


def read_recording(path: str | Path) -> Recording:
    """How everybody moved in an episode.

    Args:
        path: the episode's folder, ``DATASET/episodes/<id>/<attempt>`` (or its parent), or the
            dataset's if it has only one episode.

    Raises:
        ConfigError: there is no such episode, or it lacks what a replay needs; the message begins
            with ``scenario.episode``.
    """
    return read_episode(path, "scenario.episode", _recording)


def read_episode(path: str | Path, field: str, read: Callable[[Episode], Read]) -> Read:
    """What is read of the episode that a setting names.

    Args:
        path: the episode's folder or its parent, or the dataset's if it has only one episode.
        field: path of the setting; messages begin with it.
        read: reads the episode.

    Raises:
        ConfigError: there is no such episode, or it cannot be read.
    """
    try:
        return read(_find(without_tilde(path), field))
    except DatasetError as error:
        raise ConfigError(
            f"{field}: {error.message}", "Give the folder of a recorded episode."
        ) from error


def _find(path: Path, field: str) -> Episode:
    for folder in (path, *path.parents):
        if (folder / "dataset.json").is_file():
            break
    else:
        raise ConfigError(
            f"{field}: {path} lies in no dataset.",
            "Give DATASET/episodes/<id>/<attempt>, or DATASET if it has only one episode.",
        )
    episodes = Dataset(folder).episodes
    wanted = path.resolve()
    found = [e for e in episodes if wanted in (e.folder.resolve(), e.folder.resolve().parent)]
    if wanted == folder.resolve():
        found = list(episodes)
    if len(found) != 1:
        known = ", ".join(episode.folder.as_posix() for episode in episodes[:3])
        raise ConfigError(
            f"{field}: {path} is not the folder of one committed episode.",
            f"Committed: {known or 'none'}{', …' if len(episodes) > 3 else ''}.",
        )
    return found[0]


def _recording(episode: Episode) -> Recording:
    truth = episode.spec.ground_truth
    if not (truth.vehicles and truth.pedestrians):
        raise ConfigError(
            f"scenario.episode: {episode.folder} holds labels of some road users only.",
            "Replay an episode that was recorded with ground_truth for vehicles and pedestrians.",
        )
    rows: dict[int, list[dict[str, Any]]] = {}
    ego_id = int(episode.document["ego_id"])
    objects = episode.objects()
    # Level objects are there anyway, and riders come with their two-wheelers.
    actors_only = objects.filter(~may_come_back(objects))
    for row in actors_only.select(_COLUMNS).to_pylist():
        rows.setdefault(row["track_id"], []).append(row)
    if ego_id not in rows:
        raise DatasetError(f"{episode.folder} has no rows of its ego.")
    actors: dict[str, Any] = episode.document["actors"]
    tracks = []
    for track_id in [ego_id, *sorted(set(rows) - {ego_id})]:
        track = sorted(rows[track_id], key=lambda row: row["k"])
        looks = actors[str(track_id)]["attributes"]
        attributes = {name: looks[name] for name in _LOOKS if name in looks}
        if track_id == ego_id:
            attributes["role_name"] = "hero"
        tracks.append(
            Track(
                blueprint=track[0]["blueprint"],
                attributes=attributes,
                is_ego=track_id == ego_id,
                times_s=np.array([row["timestamp_s"] for row in track]),
                poses=np.array([[*r["actor_location"], *r["actor_rotation_deg"]] for r in track]),
                start=_start(track[0]),
                controls=_controls(episode, track) if track_id == ego_id else None,
            )
        )
    return Recording(
        episode_id=episode.id,
        map=episode.spec.map,
        duration_s=max(float(track.times_s[-1]) for track in tracks),
        tracks=tuple(tracks),
    )


def _start(row: dict[str, Any]) -> Start:
    """Motion in the first frame; an acceleration that is not known counts as none."""
    turning = row["angular_velocity"]
    return Start(
        velocity=np.array(row["velocity"]),
        acceleration=np.array(row["acceleration"] or (0.0, 0.0, 0.0)),
        yaw_rate=0.0 if turning is None else float(np.degrees(turning[2])),
    )


def _controls(episode: Episode, track: list[dict[str, Any]]) -> FloatArray | None:
    """``(T, 6)`` what the ego's driver did; None where a frame lacks it."""
    driven = {row["k"]: row for row in episode.ego().to_pylist()}
    if any(row["k"] not in driven for row in track):
        return None
    rows = [[driven[row["k"]][name] for name in Control._fields] for row in track]
    if any(value is None for row in rows for value in row):
        return None
    return np.array(rows, dtype=np.float64)
