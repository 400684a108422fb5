"""While one client waits for a map that must be baked, the world runs on for the others."""

from __future__ import annotations

import select
import uuid
from typing import TYPE_CHECKING

import msgpack
import psutil

import small_maps
from raw_client import RawClient
from waiting import await_that

if TYPE_CHECKING:
    from running_simulator import RunningSimulator

_BARE = [2.0, 50.0, 0.0, 0.6, True, True, False]
_ROAD = (
    '<OpenDRIVE><header revMajor="1" revMinor="4"/><road id="1" junction="-1" length="100" '
    'name="{name}"><link/><planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/>'
    '</geometry></planView><lanes><laneSection s="0"><center><lane id="0" type="none" '
    'level="false"/></center><right><lane id="-1" type="driving" level="false"><link/><width '
    'sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>'
    "</OpenDRIVE>"
)


def new_road() -> str:
    """A map that no cache has."""
    return _ROAD.format(name=uuid.uuid4().hex)


def test_others_are_served_while_a_map_is_baked_for_one(simulator: RunningSimulator) -> None:
    host, port = simulator.host, simulator.port
    with RawClient(host, port) as waiting, RawClient(host, port) as other:
        message = [0, 1, "copy_opendrive_to_file", [[False], new_road(), _BARE]]
        waiting.socket.sendall(msgpack.packb(message))
        frame = other.value("tick_cue")
        assert other.value("tick_cue") > frame
        assert not select.select([waiting.socket], [], [], 0.0)[0], "nothing was left to bake"
        waiting.socket.settimeout(120.0)
        assert msgpack.unpackb(waiting.socket.recv(1 << 16)) == [1, 1, None, [[False]]]


def test_the_world_survives_who_leaves_while_a_map_is_baked(simulator: RunningSimulator) -> None:
    host, port = simulator.host, simulator.port
    with RawClient(host, port) as staying:
        episode = staying.value("get_episode_info")[0]
        with RawClient(host, port) as leaving:
            message = [0, 1, "copy_opendrive_to_file", [[False], new_road(), _BARE]]
            leaving.socket.sendall(msgpack.packb(message))
            assert leaving.socket.fileno() > 0
        assert staying.value("tick_cue") > 0
        # What one client builds, another may load meanwhile; bakes run one after the other.
        staying.socket.settimeout(120.0)
        staying.value("copy_opendrive_to_file", new_road(), _BARE)
        staying.value("load_new_episode", "OpenDriveMap", True, 0xFFFF)
        assert staying.value("get_episode_info")[0] == episode + 1
        staying.value("load_new_episode", "Stage01", True, 0xFFFF)


def test_a_bake_ends_with_the_client_that_asked_for_it(simulator: RunningSimulator) -> None:
    host, port = simulator.host, simulator.port
    server = psutil.Process(simulator.process.pid)
    long = small_maps.document(
        *(small_maps.road(n, 0, 9 * n, 0, 900 + n) for n in range(300)),
        controllers=f"<!-- {uuid.uuid4().hex} -->",
    )
    with RawClient(host, port) as staying:
        with RawClient(host, port) as leaving:
            message = [0, 1, "copy_opendrive_to_file", [[False], long, _BARE]]
            leaving.socket.sendall(msgpack.packb(message))
            await_that(lambda: server.children(), within_s=30.0)
            assert staying.value("tick_cue") > 0
        await_that(lambda: not server.children(), within_s=10.0)
        assert staying.value("tick_cue") > 0
