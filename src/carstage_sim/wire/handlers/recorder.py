"""CARLA's recorder and replayer: the calls; what they do is in :mod:`carstage_sim.recording`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from carstage_sim.maps import Bake, MapFileError, MapSamplingError
from carstage_sim.recording import RecordingError
from carstage_sim.recording.replay_actors import FOLLOWING, ReplayOptions
from carstage_sim.wire import values
from carstage_sim.wire.handlers.bakes import once_finished
from carstage_sim.wire.handlers.registry import Call, handles, handles_void

Answer = TypeVar("Answer")


@handles("start_recorder")
def _start_recorder(call: Call, name: str, additional_data: bool = False) -> str:
    recordings = call.simulation.recordings
    return recordings.start(str(name), call.world, additional_data=bool(additional_data))


@handles_void("stop_recorder")
def _stop_recorder(call: Call) -> None:
    call.simulation.recordings.stop()


@handles("show_recorder_file_info")
def _show_recorder_file_info(call: Call, name: str, show_all: bool) -> str:
    return _text(lambda: call.simulation.recordings.file_info(str(name), show_all=bool(show_all)))


@handles("show_recorder_collisions")
def _show_recorder_collisions(call: Call, name: str, first: int, second: int) -> str:
    recordings = call.simulation.recordings
    return _text(lambda: recordings.collisions(str(name), _category(first), _category(second)))


def _category(letter: int) -> str:
    """A category of actors, which clients send as the number of its letter."""
    return chr(int(letter) & 0x7F)


@handles("show_recorder_actors_blocked")
def _show_recorder_actors_blocked(
    call: Call, name: str, min_time_s: float, min_distance_cm: float
) -> str:
    recordings = call.simulation.recordings
    return _text(
        lambda: recordings.actors_blocked(str(name), float(min_time_s), float(min_distance_cm))
    )


@handles("replay_file")
def _replay_file(
    call: Call,
    name: str,
    start_s: float,
    duration_s: float,
    follow_id: int,
    replay_sensors: bool = False,
    offset: list[Any] | None = None,
) -> Any:
    """Replay a log; one of another map loads that map first."""
    start_s, duration_s = values.finite(start_s, duration_s)
    options = ReplayOptions(
        start_s,
        duration_s,
        follow_id=int(follow_id),
        follow_offset=values.pose(offset) if offset is not None else FOLLOWING,
        sensors=bool(replay_sensors),
    )
    return _text(lambda: _on_its_map(call, str(name), options))


def _on_its_map(call: Call, name: str, options: ReplayOptions) -> Any:
    """Replay a log at once, or as soon as its map is baked."""
    map_name = call.simulation.recordings.map_of(name)
    wanted = map_name.rsplit("/", 1)[-1]
    if wanted == call.world.town.name:
        return _replay(call, name, options)
    if wanted not in call.simulation.maps:
        return _without_map(call, name, map_name)
    try:
        bake = call.simulation.prepare(wanted)
    except (MapFileError, MapSamplingError) as error:
        return _without_map(call, name, map_name, error)
    return once_finished(
        call, bake, lambda: _text(lambda: _load_and_replay(call, bake, name, map_name, options))
    )


def _load_and_replay(
    call: Call, bake: Bake, name: str, map_name: str, options: ReplayOptions
) -> str:
    try:
        bake.result()
        call.simulation.load(map_name.rsplit("/", 1)[-1], reset_settings=False)
    except (MapFileError, MapSamplingError) as error:
        return _without_map(call, name, map_name, error)
    call.session.episode_began(0.0)
    return _replay(call, name, options, f"Loading map {map_name}\n")


def _replay(call: Call, name: str, options: ReplayOptions, loaded: str = "") -> str:
    recordings = call.simulation.recordings
    return f"{_replaying(call, name)}{loaded}{recordings.replay(name, call.world, options)}"


def _replaying(call: Call, name: str) -> str:
    return f"Replaying File: {call.simulation.recordings.path(name)}\n"


def _without_map(call: Call, name: str, map_name: str, error: Exception | None = None) -> str:
    reason = f": {error}" if error is not None else ""
    return f"{_replaying(call, name)}Could not load mapfile {map_name}{reason}\n"


def _text(tell: Callable[[], Answer]) -> Answer | str:
    """A text about a file; what is wrong with the file is a text too, as in CARLA."""
    try:
        return tell()
    except RecordingError as error:
        return str(error)


@handles_void("stop_replayer")
def _stop_replayer(call: Call, keep_actors: bool = False) -> None:
    call.simulation.recordings.end_replay(keep_actors=bool(keep_actors))


@handles_void("set_replayer_time_factor")
def _set_replayer_time_factor(call: Call, factor: float) -> None:
    call.simulation.recordings.set_time_factor(float(factor))


@handles_void("set_replayer_ignore_hero")
def _set_replayer_ignore_hero(call: Call, ignore: bool) -> None:
    call.simulation.recordings.ignore_hero = bool(ignore)


@handles_void("set_replayer_ignore_spectator")
def _set_replayer_ignore_spectator(call: Call, ignore: bool) -> None:
    call.simulation.recordings.ignore_spectator = bool(ignore)
