"""A server of the oldest dialect, asked for what its own clients never ask."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import pytest

from raw_client import RawClient, await_first_message, read_message, subscribe
from running_simulator import RunningSimulator, start_simulator, stop_simulator

pytestmark = pytest.mark.xdist_group("older dialect")  # one server

SETTINGS = [True, False, [True, 0.05], True, 0.01, 10, 0.0, True, 3000.0, 2000.0]
SPAWN_ACTOR = 0


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningSimulator]:
    log = tmp_path_factory.mktemp("server") / "stderr.log"
    running = start_simulator(log, "--exit-with-parent", "--protocol", "0.9.13")
    yield running
    stop_simulator(running)


@pytest.fixture
def client(server: RunningSimulator) -> Iterator[RawClient]:
    with RawClient(server.host, server.port) as raw:
        assert raw.value("version") == "0.9.13"
        raw.value("set_episode_settings", SETTINGS)
        yield raw


def test_call_of_a_later_version_is_unknown(client: RawClient) -> None:
    error, _ = client.call("get_sensor_token", 1)
    assert error == (
        "rpclib: server could not find function 'get_sensor_token' with argument count 2."
    )


def test_sensor_of_a_later_version_is_neither_offered_nor_spawned(client: RawClient) -> None:
    offered = {definition[1] for definition in client.value("get_actor_definitions")}
    assert "sensor.camera.rgb" in offered
    assert "sensor.camera.normals" not in offered
    description = [1, "sensor.camera.normals", []]
    place = [[0.0, 0.0, 5.0], [0.0, 0.0, 0.0]]
    text = "CARLA 0.9.13 has no blueprint 'sensor.camera.normals'"
    _, alone = client.call("spawn_actor", description, place)
    assert alone == [[0, [text]]]
    command = [[SPAWN_ACTOR, [description, place, [False], []]]]
    _, results = client.call("apply_batch", [command], False)
    assert results == [[[0, [text]]]]


def test_snapshots_of_all_episodes_come_on_the_stream_that_clients_keep(
    server: RunningSimulator, client: RawClient
) -> None:
    seen = set()
    with subscribe(server.host, server.streaming_port, 1) as stream:
        await_first_message(client, stream)
        for _ in range(3):
            _, (token,) = client.value("get_episode_info")
            assert struct.unpack_from("<I", token) == (1,)
            client.value("load_new_episode", "", False, 0xFFFF)
            sensor_type, frame = struct.unpack_from("<QQ", message := read_message(stream))
            assert (sensor_type, frame) == (15, 1)
            seen.update(struct.unpack_from("<Q", message, 48))
    assert len(seen) == 3
