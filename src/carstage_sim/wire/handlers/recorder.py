"""CARLA's recorder and replayer, which this server does not have: every call says so."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire.handlers.registry import Call, handles, handles_void

_NO_RECORDER = "This server has no recorder; record with a client instead."


def _refuse(_call: Call, *_arguments: Any) -> str:
    return _NO_RECORDER


for _name in (
    "start_recorder",
    "show_recorder_file_info",
    "show_recorder_collisions",
    "show_recorder_actors_blocked",
    "replay_file",
):
    handles(_name)(_refuse)


@handles_void(
    "stop_recorder",
    "stop_replayer",
    "set_replayer_time_factor",
    "set_replayer_ignore_hero",
    "set_replayer_ignore_spectator",
)
def _nothing_runs(_call: Call, *_arguments: Any) -> None:
    """Nothing is recorded or replayed, so there is nothing to stop or change."""
