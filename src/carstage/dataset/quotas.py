"""How many saved frames of episodes meet a condition, counted from their label tables."""

from __future__ import annotations

import json
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from carstage.config.campaign import Condition, Quota
from carstage.config.scene import map_name
from carstage.dataset.reading import Episode
from carstage.dataset.tables import require_columns


class QuotaCounts:
    """Frames that quotas have so far; each episode counts once.

    Args:
        quotas: of a campaign.
    """

    def __init__(self, quotas: Iterable[Quota]) -> None:
        self._quotas = tuple(quotas)
        self._counted: set[str] = set()
        self.frames = {quota.name: 0 for quota in self._quotas}
        """By the quota's name."""

    @property
    def met(self) -> bool:
        """Whether there are quotas, and all of them have what they want."""
        return bool(self._quotas) and all(
            self.frames[quota.name] >= quota.frames for quota in self._quotas
        )

    def add(self, episode: Episode) -> None:
        """Count an episode, unless it was counted.

        Args:
            episode: a committed one.

        Raises:
            DatasetError: one of its tables is missing or damaged.
        """
        if episode.id in self._counted:
            return
        for quota in self._quotas:
            self.frames[quota.name] += int(frames_where(episode, quota.where).sum())
        self._counted.add(episode.id)

    def __contains__(self, episode_id: object) -> bool:
        return episode_id in self._counted


def frames_where(episode: Episode, where: Condition) -> NDArray[np.bool_]:
    """Which saved frames of an episode meet a condition.

    Args:
        episode: a committed one.
        where: the condition.

    Returns:
        ``(frames,)``.

    Raises:
        DatasetError: one of its tables is missing or damaged.
    """
    meets = np.ones(episode.frames, np.bool_)
    if where.maps is not None and episode.spec.map not in set(map(map_name, where.maps)):
        return ~meets
    sun = (where.sun_altitude_above_deg, where.sun_altitude_below_deg)
    if where.weathers is not None or any(bound is not None for bound in sun):
        meets &= _in_weather(episode, where)
    if where.classes and meets.any():
        meets &= _with_objects(episode, where)
    return meets


def _in_weather(episode: Episode, where: Condition) -> NDArray[np.bool_]:
    table = episode.ego()
    require_columns(table, ("k", "weather_preset", "weather"), "ego.parquet")
    meets = np.zeros(episode.frames, np.bool_)
    low, high = where.sun_altitude_above_deg, where.sun_altitude_below_deg
    if not table.num_rows and low is None and high is None:  # no ego motion was asked for
        fps, weather = episode.spec.saved_fps, episode.spec.weather
        presets = [weather.preset_at(k / fps) for k in range(episode.frames)]
        return np.array([preset in (where.weathers or ()) for preset in presets], np.bool_)
    for row in table.select(["k", "weather_preset", "weather"]).to_pylist():
        altitude_deg = json.loads(row["weather"]).get("sun_altitude_angle")
        meets[row["k"]] = (
            (where.weathers is None or row["weather_preset"] in where.weathers)
            and (low is None or (altitude_deg is not None and altitude_deg > low))
            and (high is None or (altitude_deg is not None and altitude_deg < high))
        )
    return meets


def _with_objects(episode: Episode, where: Condition) -> NDArray[np.bool_]:
    table = episode.objects()
    columns = ("k", "class", "is_ego", "distance_ego", "visibility")
    require_columns(table, columns, "objects.parquet")
    counts = np.isin(np.array(table["class"].to_pylist(), np.str_), where.classes)
    counts &= ~np.array(table["is_ego"].to_pylist(), np.bool_)
    for bound, column, sign in (
        (where.min_distance_m, "distance_ego", 1.0),
        (where.max_distance_m, "distance_ego", -1.0),
        (where.min_visibility, "visibility", 1.0),
    ):
        if bound is not None:  # null becomes NaN, which compares with nothing
            counts &= sign * np.array(table[column].to_pylist(), np.float64) >= sign * bound
    k = table["k"].to_numpy()[counts]
    found: NDArray[np.bool_] = np.bincount(k, minlength=episode.frames) >= where.min_count
    return found[: episode.frames]
