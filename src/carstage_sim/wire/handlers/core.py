"""Episode, settings, maps, files and the tick."""

from __future__ import annotations

import hashlib
import logging
import time
from typing import Any

from carstage_sim.maps import Bake, MapFileError, MapSamplingError, Town, generated_source
from carstage_sim.wire import values
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.bakes import once_finished
from carstage_sim.wire.handlers.registry import LATER, Call, TickRequest, handles, handles_void
from carstage_sim.wire.rpc import Packed
from carstage_sim.wire.streaming import (
    SENSORS_SUBSCRIBED_WITHIN_S,
    SNAPSHOTS_SUBSCRIBED_WITHIN_S,
)
from carstage_sim.wire.token import stream_token
from carstage_sim.world.errors import WorldError
from carstage_sim.world.pose import Pose

logger = logging.getLogger(__name__)

_MAP_FOLDER = "Carla/Maps"
_ALL_LAYERS = 0xFFFF
_LARGEST_STREAM = 2**32 - 1
_ANSWER_AFTER_S = 0.1
_REOPENED_AFTER_S = 0.3
_GIVE_UP_S = 5.0
_HELD_WHILE_REOPENING = frozenset(
    {"get_episode_settings", "get_weather_parameters", "get_vehicle_light_states"}
)


@handles("version")
def _version(call: Call) -> str:
    return call.session.dialect.version


@handles("get_episode_info")
def _get_episode_info(call: Call) -> list[Any]:
    stream_id = call.session.dialect.episode_stream(call.world.stream_id)
    token = stream_token(stream_id, call.session.streaming_port)
    return [call.world.episode_id, [token]]


@handles("get_sensor_token")
def _get_sensor_token(call: Call, stream_id: int) -> list[bytes]:
    if not 0 <= stream_id <= _LARGEST_STREAM:
        raise CallError(f"{stream_id} is no stream: 0 to {_LARGEST_STREAM}")
    if stream_id != call.world.stream_id:
        call.session.expect_subscriber(stream_id, SENSORS_SUBSCRIBED_WITHIN_S, call.connection)
    else:
        call.session.expect_subscriber(stream_id, SNAPSHOTS_SUBSCRIBED_WITHIN_S, call.connection)
        if call.connection.held_calls:
            _release(call, _REOPENED_AFTER_S)
    return [stream_token(stream_id, call.session.streaming_port)]


def _release(call: Call, delay_s: float = 0.0) -> None:
    """Let later calls of this client be answered at once, and those kept back after a while."""
    held = call.connection.take_held()
    call.session.after(delay_s, lambda: call.connection.send_held(held))


@handles("get_episode_settings")
def _get_episode_settings(call: Call) -> list[Any]:
    return values.encode_settings(call.simulation.settings)


@handles("set_episode_settings")
def _set_episode_settings(call: Call, settings: list[Any]) -> int:
    call.simulation.apply_settings(values.settings(settings))
    return call.world.frame


@handles("get_map_info")
def _get_map_info(call: Call) -> Packed:
    town = call.world.town
    return call.packed(town, lambda: _map_info(town))


def _map_info(town: Town) -> list[Any]:
    spawn_points = [
        values.encode_pose(Pose((x, y, z), (pitch, yaw, roll)))
        for x, y, z, pitch, yaw, roll in town.spawn_points.tolist()
    ]
    return [f"{_MAP_FOLDER}/{town.name}", spawn_points]


@handles("get_map_data")
def _get_map_data(call: Call) -> str:
    return call.world.town.opendrive


@handles("get_navigation_mesh")
def _get_navigation_mesh(call: Call) -> bytes:
    return call.world.town.navigation


def _navigation_path(call: Call) -> str:
    # Clients keep this file for ever under its path: a changed mesh needs another one.
    town = call.world.town
    digest = hashlib.sha256(town.navigation).hexdigest()[:16]
    return f"{_MAP_FOLDER}/Nav/{town.name}-{digest}.bin"


@handles("get_required_files")
def _get_required_files(call: Call, folder: str) -> list[str]:
    """Of a folder of the map, or of all of them: only that of the navigation is to be had so."""
    offered = folder in ("", "Nav") and call.world.town.navigation
    return [_navigation_path(call)] if offered else []


@handles("request_file")
def _request_file(call: Call, path: str) -> bytes:
    if path != _navigation_path(call):
        raise CallError(f"no file {path!r} on this server")
    return call.world.town.navigation


@handles("get_available_maps")
def _get_available_maps(call: Call) -> list[str]:
    return [f"/Game/{_MAP_FOLDER}/{name}" for name in call.simulation.maps.names]


@handles_void("load_new_episode")
def _load_new_episode(
    call: Call, map_name: str, reset_settings: bool, layers: int = _ALL_LAYERS
) -> Any:
    name = map_name.rsplit("/", 1)[-1] or call.world.town.name
    if name not in call.simulation.maps:
        available = ", ".join(call.simulation.maps.names)
        logger.warning("no map %r was found; there are %s", name, available)
        raise CallError("map not found")
    try:
        bake = call.simulation.prepare(name)
    except (MapFileError, MapSamplingError) as error:
        raise CallError(str(error)) from error
    return once_finished(call, bake, lambda: _load(call, bake, name, reset_settings, int(layers)))


def _load(call: Call, bake: Bake, name: str, reset_settings: bool, layers: int) -> Any:
    try:
        bake.result()
        call.simulation.load(name, reset_settings=reset_settings)
    except (MapFileError, MapSamplingError) as error:
        raise CallError(str(error)) from error
    call.world.objects.load_layers(~layers, False)
    if not call.session.dialect.reopens_episode:
        call.session.episode_began(0.0)
        return None
    # On the answer, this client closes its stream of snapshots and opens another. Its threads crash
    # if a snapshot arrives in that moment (it reads into what was freed), or if its Traffic Manager
    # looks for the episode that is gone. So the stream is quiet from a while before the answer
    # until a while after it, and the Traffic Manager is caught in its next query, which is answered
    # when the gap is over; what the client asks after the gap began is answered at once.
    call.session.episode_began(_ANSWER_AFTER_S + _REOPENED_AFTER_S)
    if call.session.traffic_managers.owned_by(call.connection):
        call.connection.held_calls = _HELD_WHILE_REOPENING
        call.session.after(_GIVE_UP_S, lambda: _release(call))
    call.session.after(_ANSWER_AFTER_S, lambda: call.answer(None))
    return LATER


@handles_void("load_map_layer")
def _load_map_layer(call: Call, layers: int) -> None:
    call.world.objects.load_layers(int(layers), True)


@handles_void("unload_map_layer")
def _unload_map_layer(call: Call, layers: int) -> None:
    call.world.objects.load_layers(int(layers), False)


@handles_void("copy_opendrive_to_file")
def _copy_opendrive_to_file(call: Call, opendrive: str, parameters: list[Any]) -> Any:
    """The first half of ``generate_opendrive_world``; the map is loaded by a call that follows."""
    source = generated_source(opendrive, values.bake_options(parameters))
    try:
        bake = call.simulation.bakes.begin(source)
    except MapSamplingError as error:
        raise _unparsed(error) from error
    return once_finished(call, bake, lambda: _generate(call, bake))


def _generate(call: Call, bake: Bake) -> None:
    try:
        bake.result()
        call.simulation.maps.generate(bake.source)
    except MapSamplingError as error:
        raise _unparsed(error) from error


def _unparsed(error: MapSamplingError) -> CallError:
    return CallError(f"opendrive could not be correctly parsed: {error}")


@handles("tick_cue")
def _tick_cue(call: Call) -> Any:
    """Answered after the frame's snapshot is out, so that the client need not spin for it."""
    call.session.request_tick(TickRequest(call, time.monotonic()))
    return LATER


@handles("console_command")
def _console_command(_call: Call, command: str) -> bool:
    raise WorldError(f"this server has no console: {command!r} was not run")
