"""What happens to the world when clients die, hang, or share it."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from carstage.server import free_port
from client_scripts import client_process
from raw_client import RawClient
from waiting import await_that, holds_for

if TYPE_CHECKING:
    from running_simulator import RunningSimulator

pytestmark = pytest.mark.end_to_end

SYNCHRONOUS = [True, False, [True, 0.05], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]
FREE = [False, False, [False], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]
LET_GO_S = 1.5
"""Longer than the server waits before it lets a world go."""

SYNCHRONOUS_SETTINGS = """
settings = world.get_settings()
settings.synchronous_mode = True
settings.fixed_delta_seconds = 0.05
"""
TICKING_WITH_TRAFFIC = (
    SYNCHRONOUS_SETTINGS
    + """
world.apply_settings(settings)
manager = client.get_trafficmanager(int(sys.argv[2]))
manager.set_synchronous_mode(True)
for _ in range(3):
    world.tick()
print("ready", flush=True)
sys.stdin.read()
"""
)
WATCHING_A_CAMERA = """
camera = world.get_blueprint_library().find("sensor.camera.semantic_segmentation")
camera.set_attribute("image_size_x", "1280")
camera.set_attribute("image_size_y", "960")
sensor = world.spawn_actor(camera, carla.Transform(carla.Location(z=30.0)))
sensor.listen(lambda image: print(image.frame, flush=True))
print("ready", flush=True)
sys.stdin.read()
"""


def is_synchronous(client: RawClient) -> bool:
    return bool(client.value("get_episode_settings")[0])


@pytest.fixture
def observer(simulator: RunningSimulator) -> Iterator[RawClient]:
    """A client that only looks, on a world that is free before and after."""
    with RawClient(simulator.host, simulator.port) as raw:
        raw.value("set_episode_settings", FREE)
        raw.value("load_new_episode", "", False, 0xFFFF)
        yield raw
        raw.value("set_episode_settings", FREE)


def test_killed_synchronous_client_gives_the_world_back(
    simulator: RunningSimulator, observer: RawClient, tmp_path: Path
) -> None:
    port = free_port()
    with client_process(TICKING_WITH_TRAFFIC, tmp_path, simulator.port, port) as client:
        assert is_synchronous(observer)
        assert observer.value("is_traffic_manager_running", port) is True
        client.kill()
        await_that(lambda: not is_synchronous(observer))
    assert observer.value("get_episode_settings") == FREE  # as it was found
    assert observer.value("is_traffic_manager_running", port) is False
    frame = observer.value("tick_cue")
    await_that(lambda: observer.value("tick_cue") > frame + 2)


def test_idle_client_keeps_the_world_while_others_come_and_go(
    simulator: RunningSimulator, observer: RawClient
) -> None:
    with RawClient(simulator.host, simulator.port) as idle:
        idle.value("set_episode_settings", SYNCHRONOUS)
        with RawClient(simulator.host, simulator.port) as visitor:
            visitor.value("version")
        assert holds_for(LET_GO_S, lambda: is_synchronous(observer))
    await_that(lambda: not is_synchronous(observer))


def test_client_that_ticks_too_keeps_the_world_after_the_first_one_left(
    simulator: RunningSimulator, observer: RawClient
) -> None:
    with RawClient(simulator.host, simulator.port) as second:
        with RawClient(simulator.host, simulator.port) as first:
            first.value("set_episode_settings", SYNCHRONOUS)
            second.value("tick_cue")
        assert holds_for(LET_GO_S, lambda: is_synchronous(observer))
    await_that(lambda: not is_synchronous(observer))


def test_client_that_comes_back_at_once_finds_the_world_as_it_left_it(
    simulator: RunningSimulator, observer: RawClient
) -> None:
    with RawClient(simulator.host, simulator.port) as first:
        first.value("set_episode_settings", SYNCHRONOUS)
    with RawClient(simulator.host, simulator.port) as again:
        again.value("tick_cue")
        assert holds_for(LET_GO_S, lambda: is_synchronous(observer))


def test_stopped_client_with_a_full_stream_does_not_hold_up_the_one_that_ticks(
    simulator: RunningSimulator, observer: RawClient, tmp_path: Path
) -> None:
    with (
        client_process(WATCHING_A_CAMERA, tmp_path, simulator.port) as watching,
        RawClient(simulator.host, simulator.port) as ticking,
    ):
        assert watching.stdout is not None
        ticking.value("set_episode_settings", SYNCHRONOUS)
        ticking.value("tick_cue")
        assert int(watching.stdout.readline()) > 0
        watching.send_signal(signal.SIGSTOP)
        longest_s = 0.0
        for _ in range(6):  # pictures of 4.9 MB: the kernel has room for one or two
            started = time.monotonic()
            ticking.value("tick_cue")
            longest_s = max(longest_s, time.monotonic() - started)
        assert longest_s < 20.0  # the client's own time limit
        watching.send_signal(signal.SIGCONT)
        frame = ticking.value("tick_cue")
        seen: list[int] = []
        reader = threading.Thread(target=lambda: seen.extend(map(int, watching.stdout or ())))
        reader.start()

        def sees_new_frames() -> bool:
            ticking.value("tick_cue")
            return max(seen, default=0) > frame

        await_that(sees_new_frames, within_s=60.0)  # it subscribed again by itself
        watching.kill()
        reader.join()


def test_free_world_does_not_wait_for_a_stopped_client(
    simulator: RunningSimulator, observer: RawClient, tmp_path: Path
) -> None:
    with client_process(WATCHING_A_CAMERA, tmp_path, simulator.port) as watching:
        assert watching.stdout is not None
        assert int(watching.stdout.readline()) > 0
        watching.send_signal(signal.SIGSTOP)
        frame = observer.value("tick_cue")
        await_that(lambda: observer.value("tick_cue") > frame + 6, within_s=60.0)
        watching.send_signal(signal.SIGCONT)
        newest = observer.value("tick_cue")
        while int(watching.stdout.readline()) < newest:  # never dropped, it only missed frames
            pass
