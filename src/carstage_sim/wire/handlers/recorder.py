"""CARLA's recorder and replayer: the calls; what they do is in :mod:`carstage_sim.recording`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from carstage_sim.recording import RecordingError
from carstage_sim.recording.replay_cast import FOLLOWING, ReplayOptions
from carstage_sim.wire import values
from carstage_sim.wire.handlers.registry import Call, handles, handles_void


@handles("start_recorder")
def _start_recorder(call: Call, name: str, additional_data: bool = False) -> str:
    deck = call.simulation.recordings
    return deck.start(str(name), call.world, additional_data=bool(additional_data))


@handles_void("stop_recorder")
def _stop_recorder(call: Call) -> None:
    call.simulation.recordings.stop()


@handles("show_recorder_file_info")
def _show_recorder_file_info(call: Call, name: str, show_all: bool) -> str:
    return _text(lambda: call.simulation.recordings.file_info(str(name), show_all=bool(show_all)))


@handles("show_recorder_collisions")
def _show_recorder_collisions(call: Call, name: str, first: int, second: int) -> str:
    deck = call.simulation.recordings
    return _text(lambda: deck.collisions(str(name), _category(first), _category(second)))


def _category(letter: int) -> str:
    """A category of actors, which clients send as the number of its letter."""
    return chr(int(letter) & 0x7F)


@handles("show_recorder_actors_blocked")
def _show_recorder_actors_blocked(
    call: Call, name: str, min_time_s: float, min_distance_cm: float
) -> str:
    deck = call.simulation.recordings
    return _text(lambda: deck.actors_blocked(str(name), float(min_time_s), float(min_distance_cm)))


@handles("replay_file")
def _replay_file(
    call: Call,
    name: str,
    start_s: float,
    duration_s: float,
    follow_id: int,
    replay_sensors: bool = False,
    offset: list[Any] | None = None,
) -> str:
    """Replay a log; one of another map loads that map first."""
    start_s, duration_s = values.finite(start_s, duration_s)
    options = ReplayOptions(
        start_s,
        duration_s,
        follow_id=int(follow_id),
        follow_offset=values.pose(offset) if offset is not None else FOLLOWING,
        sensors=bool(replay_sensors),
    )
    deck, name = call.simulation.recordings, str(name)
    return _text(lambda: _replay(call, name, deck.map_of(name), options))


def _replay(call: Call, name: str, map_name: str, options: ReplayOptions) -> str:
    deck = call.simulation.recordings
    lines = [f"Replaying File: {deck.path(name)}\n"]
    wanted = map_name.rsplit("/", 1)[-1]
    if wanted != call.world.town.name:
        if wanted not in call.simulation.maps:
            return "".join([*lines, f"Could not load mapfile {map_name}\n"])
        call.simulation.load(wanted, reset_settings=False)
        call.session.episode_began(0.0)
        lines.append(f"Loading map {map_name}\n")
    return "".join([*lines, deck.replay(name, call.world, options)])


def _text(tell: Callable[[], str]) -> str:
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
