"""What a scenario needs in an episode's specification: places of a route, recorded trajectories."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from carstage.config import Config
from carstage.config.scene import Place as ConfiguredPlace
from carstage.config.scene import ReplayScenario, RouteScenario, StationaryScenario
from carstage.errors import ConfigError
from carstage.geometry import FloatArray
from carstage.spec import (
    AutopilotSpec,
    Place,
    ReplayedActor,
    ReplaySpec,
    RouteSpec,
    ScenarioSpec,
    StationarySpec,
)

#: Recorded poses are kept to a tenth of a millimetre and of a thousandth of a degree.
_DECIMALS = 4
_SLACK_S = 1e-6


@dataclass(frozen=True, slots=True)
class Track:
    """How one road user moved.

    Attributes:
        blueprint: CARLA's type id.
        attributes: blueprint attributes to set.
        is_ego: the vehicle that carried the sensors.
        times_s: ``(T,)`` seconds since the first frame, ascending.
        poses: ``(T, 6)`` x, y, z (m), pitch, yaw, roll (deg) of the actor in the world.
    """

    blueprint: str
    attributes: Mapping[str, str]
    is_ego: bool
    times_s: FloatArray
    poses: FloatArray


@dataclass(frozen=True, slots=True)
class Recording:
    """A recorded episode, as far as it can be played again.

    Attributes:
        episode_id: the episode's.
        map: its map, without folders.
        duration_s: from its first frame to its last.
        tracks: the ego's first, then by actor id.
    """

    episode_id: str
    map: str
    duration_s: float
    tracks: tuple[Track, ...]


def plan_scenario(
    config: Config, spawn_points: int | None, recording: Recording | None
) -> ScenarioSpec:
    """``scenario`` of the specification.

    Args:
        config: what the user asks for.
        spawn_points: number of the map's spawn points; None where it is unknown.
        recording: for ``replay``.

    Raises:
        ConfigError: a route leads through a spawn point that the map lacks, or the recording is
            shorter than the episode.
    """
    scenario = config.scenario
    if isinstance(scenario, RouteScenario):
        places = enumerate(scenario.through)
        return RouteSpec(tuple(_place(place, i, spawn_points) for i, place in places))
    if isinstance(scenario, ReplayScenario):
        if recording is None:
            raise ConfigError(
                f"scenario.episode: {scenario.episode} was not read.",
                "Give the folder of a recorded episode.",
            )
        return _replay(config, recording)
    return StationarySpec() if isinstance(scenario, StationaryScenario) else AutopilotSpec()


def _place(place: int | ConfiguredPlace, position: int, spawn_points: int | None) -> int | Place:
    if isinstance(place, ConfiguredPlace):
        return Place(x_m=place.x, y_m=place.y)
    if spawn_points is not None and place >= spawn_points:
        raise ConfigError(
            f"scenario.through[{position}]: the map has no spawn point {place}.",
            f"It has {spawn_points}, counted from 0.",
        )
    return place


def _replay(config: Config, recording: Recording) -> ReplaySpec:
    steps_s = np.arange(config.steps) / config.fps
    if steps_s[-1] > recording.duration_s + _SLACK_S:
        possible_s = (np.floor(recording.duration_s * config.fps + _SLACK_S) + 1) / config.fps
        raise ConfigError(
            f"duration_s: the recorded episode ends after {recording.duration_s:g} s.",
            f"Give at most {possible_s:g} s.",
        )
    return ReplaySpec(
        recording.episode_id,
        tuple(
            ReplayedActor(track.blueprint, dict(track.attributes), _resampled(track, steps_s))
            for track in recording.tracks
        ),
    )


def _resampled(track: Track, steps_s: FloatArray) -> tuple[tuple[float, ...] | None, ...]:
    """A pose for each step, linear between frames, angles the short way; None where it was gone."""
    unwrapped = np.column_stack(
        [track.poses[:, :3], np.unwrap(track.poses[:, 3:], period=360.0, axis=0)]
    )
    values = np.stack(
        [np.interp(steps_s, track.times_s, column) for column in unwrapped.T], axis=-1
    )
    values[:, 3:] = (values[:, 3:] + 180.0) % 360.0 - 180.0
    alive = (steps_s >= track.times_s[0] - _SLACK_S) & (steps_s <= track.times_s[-1] + _SLACK_S)
    rows: list[list[float]] = (np.round(values, _DECIMALS) + 0.0).tolist()
    return tuple(
        tuple(row) if here else None for row, here in zip(rows, alive.tolist(), strict=True)
    )
