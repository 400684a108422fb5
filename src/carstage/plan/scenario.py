"""What a scenario needs in an episode's specification: places of a route, recorded trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carstage.config import Config
from carstage.config.asked_events import Event
from carstage.config.drivers import AutopilotDriver
from carstage.config.scene import (
    LogScenario,
    OpenScenarioScenario,
    ReplayScenario,
    RouteScenario,
    ScenicScenario,
    StationaryScenario,
)
from carstage.config.scene import Place as ConfiguredPlace
from carstage.errors import ConfigError
from carstage.geometry import FloatArray
from carstage.spec import (
    AutopilotSpec,
    Control,
    OpenScenarioSpec,
    Place,
    ReplayedActor,
    ReplaySpec,
    RouteSpec,
    ScenarioSpec,
    ScenicSpec,
    StationarySpec,
    StoryboardSpec,
)

if TYPE_CHECKING:
    from carstage.spec.events import EventSpec

#: Recorded poses are kept to a tenth of a millimetre and of a thousandth of a degree.
_DECIMALS = 4
_SLACK_S = 1e-6


@dataclass(frozen=True, slots=True)
class Start:
    """Motion in a first frame, in the world.

    Attributes:
        velocity: ``(3,)`` m/s.
        acceleration: ``(3,)`` m/s².
        yaw_rate: deg/s.
    """

    velocity: FloatArray
    acceleration: FloatArray
    yaw_rate: float


@dataclass(frozen=True, slots=True)
class Track:
    """How one road user moved.

    Attributes:
        blueprint: CARLA's type id.
        attributes: blueprint attributes to set.
        is_ego: the vehicle that carried the sensors.
        times_s: ``(T,)`` seconds since the first frame, ascending.
        poses: ``(T, 6)`` x, y, z (m), pitch, yaw, roll (deg) of the actor in the world.
        start: how it moved in its first frame.
        controls: ``(T, 6)`` in the order of ``Control``; None where they were not recorded.
    """

    blueprint: str
    attributes: Mapping[str, str]
    is_ego: bool
    times_s: FloatArray
    poses: FloatArray
    start: Start | None = None
    controls: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class Recording:
    """A recorded episode or log, as far as it can be played again.

    Attributes:
        episode_id: the episode's; of a log, a hash of its content.
        map: its map, without folders.
        duration_s: from its first frame to its last.
        tracks: the ego's first, then by actor id.
        field: path of the setting that names it.
    """

    episode_id: str
    map: str
    duration_s: float
    tracks: tuple[Track, ...]
    field: str = "scenario.episode"


@dataclass(frozen=True, slots=True)
class ScenarioProgram:
    """A program that another tool plays, as far as it decides an episode.

    Attributes:
        text_hash: named hash of its text.
        version: of the tool: Scenic's, or a named hash of scenario_runner's modules.
        map: the map that it plays in.
        field: path of the setting that names the map.
    """

    text_hash: str
    version: str
    map: str
    field: str


@dataclass(frozen=True, slots=True)
class Storyboard:
    """An OpenSCENARIO file that Car-STAGE plays itself.

    Attributes:
        spec: what was read from it.
        map: the map that it plays in.
        field: path of the setting that names it.
    """

    spec: StoryboardSpec
    map: str
    field: str = "scenario.file"


def plan_scenario(
    config: Config,
    spawn_points: int | None,
    recording: Recording | ScenarioProgram | Storyboard | None,
) -> ScenarioSpec:
    """``scenario`` of the specification.

    Args:
        config: what the user asks for.
        spawn_points: number of the map's spawn points; None where it is unknown.
        recording: for ``replay``, ``log``, ``scenic``, ``openscenario``.

    Raises:
        ConfigError: a route leads through a spawn point that the map lacks, or the recording is
            shorter than the episode.
    """
    scenario = config.scenario
    if isinstance(scenario, RouteScenario):
        places = enumerate(scenario.through)
        through = tuple(_place(place, i, spawn_points) for i, place in places)
        return RouteSpec(through, _events(scenario.events))
    if isinstance(scenario, ReplayScenario | LogScenario):
        if not isinstance(recording, Recording):
            raise ConfigError("scenario: what is to be played was not read.", "Name it.")
        return _replay(config, recording)
    if isinstance(scenario, ScenicScenario):
        if not isinstance(recording, ScenarioProgram):
            raise ConfigError("scenario: the program was not read.", "Name it.")
        return ScenicSpec(
            recording.text_hash, recording.version, dict(scenario.params), scenario.mode_2d
        )
    if isinstance(scenario, OpenScenarioScenario):
        if isinstance(recording, Storyboard):
            return _storyboard(config, recording)
        if not isinstance(recording, ScenarioProgram):
            raise ConfigError("scenario: the file was not read.", "Name it.")
        return OpenScenarioSpec(recording.text_hash, recording.version, dict(scenario.params))
    if isinstance(scenario, StationaryScenario):
        return StationarySpec()
    return AutopilotSpec(_events(scenario.events))


def _storyboard(config: Config, recording: Storyboard) -> StoryboardSpec:
    ego = recording.spec.entities[0].name
    groups = (group for act in recording.spec.acts for group in act.groups)
    if not isinstance(config.ego.driver, AutopilotDriver) and any(ego in g.actors for g in groups):
        raise ConfigError(
            f"ego.driver: the file that scenario.file names moves {ego!r} itself.",
            "Leave the driver out, or take the ego out of the file's Actors.",
        )
    return recording.spec


def _events(events: Sequence[Event]) -> tuple[EventSpec, ...] | None:
    """None for no event, so that episodes without any keep their ids."""
    if not events:
        return None
    from carstage.spec.events import EVENT_SPECS  # few episodes have any

    asked = (event.by_key() for event in events)
    return tuple(EVENT_SPECS[event.pop("kind")](**event) for event in asked)


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
            f"duration_s: what {recording.field} names ends after {recording.duration_s:g} s.",
            f"Give at most {possible_s:g} s.",
        )
    return ReplaySpec(
        recording.episode_id,
        tuple(
            ReplayedActor(
                track.blueprint,
                dict(track.attributes),
                _resampled(track, steps_s),
                _run_up(track, 1.0 / config.fps),
                _controls(track, steps_s),
            )
            for track in recording.tracks
        ),
    )


def _run_up(track: Track, step_s: float) -> tuple[tuple[float, ...], ...] | None:
    """Poses of three steps before the first, from which speeds at it are as they were.

    A simulator that moves nobody takes differences of places for velocities, and differences of
    those for accelerations; an accelerometer looks three steps back.
    """
    if track.start is None:
        return None
    velocity, pose = track.start.velocity, track.poses[0]
    poses = []
    for change in (track.start.acceleration, 0.0, 0.0):
        turned = [0.0, track.start.yaw_rate, 0.0]
        pose = pose - np.concatenate([velocity, turned]) * step_s
        poses.append(_rounded(pose[None, :])[0])
        velocity = velocity - np.asarray(change) * step_s
    return tuple(tuple(row) for row in reversed(poses))


def _controls(track: Track, steps_s: FloatArray) -> tuple[Control, ...] | None:
    """What the driver did in the frame at or before each step."""
    if track.controls is None:
        return None
    frame = np.searchsorted(track.times_s, steps_s + _SLACK_S, side="right") - 1
    return tuple(Control(*row) for row in track.controls[np.maximum(frame, 0)].tolist())


def _resampled(track: Track, steps_s: FloatArray) -> tuple[tuple[float, ...] | None, ...]:
    """A pose for each step; None where it was gone.

    Between frames by a cubic through them whose slope at each is that between its neighbours
    (Catmull and Rom 1974), so that speeds do not jump; angles go the short way.
    """
    knots = np.column_stack(
        [track.poses[:, :3], np.unwrap(track.poses[:, 3:], period=360.0, axis=0)]
    )
    alive = (steps_s >= track.times_s[0] - _SLACK_S) & (steps_s <= track.times_s[-1] + _SLACK_S)
    rows = _rounded(_between(track.times_s, knots, steps_s))
    return tuple(
        tuple(row) if here else None for row, here in zip(rows, alive.tolist(), strict=True)
    )


def _between(times_s: FloatArray, knots: FloatArray, steps_s: FloatArray) -> FloatArray:
    """``(S, 6)`` of ``(T, 6)`` knots; the first and the last one stay beyond the ends."""
    if len(times_s) == 1:
        return np.repeat(knots, len(steps_s), axis=0)
    slopes = np.gradient(knots, times_s, axis=0)
    before = np.clip(np.searchsorted(times_s, steps_s, side="right") - 1, 0, len(times_s) - 2)
    span_s = times_s[before + 1] - times_s[before]
    t = np.clip((steps_s - times_s[before]) / span_s, 0.0, 1.0)[:, None]
    h = span_s[:, None]
    values: FloatArray = (
        (1.0 + 2.0 * t) * (1.0 - t) ** 2 * knots[before]
        + t * (1.0 - t) ** 2 * h * slopes[before]
        + t**2 * (3.0 - 2.0 * t) * knots[before + 1]
        + t**2 * (t - 1.0) * h * slopes[before + 1]
    )
    return values


def _rounded(poses: FloatArray) -> list[list[float]]:
    turned = poses.copy()
    turned[:, 3:] = (turned[:, 3:] + 180.0) % 360.0 - 180.0
    rows: list[list[float]] = (np.round(turned, _DECIMALS) + 0.0).tolist()
    return rows
