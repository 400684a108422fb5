"""Several programs on one server: one ticks, others look; or nobody does and time goes on."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from client_scripts import client_process
from raw_client import RawClient

if TYPE_CHECKING:
    from running_simulator import RunningSimulator

pytestmark = pytest.mark.end_to_end

SYNCHRONOUS = [True, False, [True, 0.05], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]
FREE = [False, False, [False], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]

LISTENING = """
world.on_tick(lambda snapshot: print(snapshot.frame, flush=True))
print("ready", flush=True)
sys.stdin.read()
"""
WAITING = """
try:
    world.wait_for_tick(0.3)
except RuntimeError as error:
    assert "time-out" in str(error), error
    print("ready", flush=True)
print(world.wait_for_tick(20.0).frame, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def ticking(simulator: RunningSimulator) -> Iterator[RawClient]:
    """The client that ticks; the world is free again afterwards."""
    with RawClient(simulator.host, simulator.port) as raw:
        raw.value("set_episode_settings", SYNCHRONOUS)
        raw.value("load_new_episode", "", False, 0xFFFF)
        yield raw
        raw.value("set_episode_settings", FREE)


def read_frame(client: subprocess.Popen[str]) -> int:
    assert client.stdout is not None
    return int(client.stdout.readline())


def read_up_to(client: subprocess.Popen[str], frame: int) -> list[int]:
    """Frame numbers that the client prints, until it prints this one."""
    frames = [read_frame(client)]
    while frames[-1] < frame:
        frames.append(read_frame(client))
    return frames


def test_one_client_ticks_and_the_others_see_every_frame(
    simulator: RunningSimulator, ticking: RawClient, tmp_path: Path
) -> None:
    with (
        client_process(LISTENING, tmp_path, simulator.port) as one,
        client_process(LISTENING, tmp_path, simulator.port) as other,
    ):
        made = [ticking.value("tick_cue") for _ in range(20)]
        for client in (one, other):
            seen = read_up_to(client, made[-1])
            assert seen[-20:] == made


def test_clients_of_a_free_world_see_the_same_frames(
    simulator: RunningSimulator, ticking: RawClient, tmp_path: Path
) -> None:
    ticking.value("set_episode_settings", FREE)
    with (
        client_process(LISTENING, tmp_path, simulator.port) as one,
        client_process(LISTENING, tmp_path, simulator.port) as other,
    ):
        begin = max(read_frame(one), read_frame(other)) + 1
        sightings = [read_up_to(client, begin + 10) for client in (one, other)]
        for seen in sightings:
            assert seen == sorted(set(seen))  # rising; a busy machine may leave some out
        assert set(sightings[0]) & set(sightings[1])


def test_waiting_for_a_tick_that_nobody_makes_times_out_and_the_client_lives_on(
    simulator: RunningSimulator, ticking: RawClient, tmp_path: Path
) -> None:
    # The script is ready when it has had its time-out, and only then.
    with (
        client_process(WAITING, tmp_path, simulator.port) as waiting,
        ThreadPoolExecutor(1) as pool,
    ):
        told = pool.submit(read_frame, waiting)
        frames = []
        while not told.done():  # one tick alone may come before it waits again
            frames.append(ticking.value("tick_cue"))
        assert told.result() in frames
