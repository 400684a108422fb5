"""Does the world keep pace with the clock, and are calls answered, while pictures are drawn?

Two clients: one drives the world with cameras, the other asks for the weather in a loop. First the
cameras tick a synchronous world as fast as pictures come: three of 800x600. Then one camera looks
at a world that runs freely, and a large one, of 1920x1080, at a synchronous world.
"""

from __future__ import annotations

import itertools
import os
import threading
import time
from dataclasses import dataclass
from typing import Any

import carla
import numpy as np

from benchmarks.crowding import crowding
from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import started_server
from carstage.bench.calibration import slowness
from carstage.bench.process_figures import process_cpu_s
from carstage.bench.verdict import Figure, Verdict

_TIMEOUT_S = 60.0
_DELTA_S = 0.05
_ASKED_EVERY_S = 0.02
_SMALLEST_SHARE = 0.95
_LONGEST_ANSWER_S = 0.05
_PERCENTILE = 99
_TICKS_PER_S, _TICKS_PER_S_OF_MANY_CORES, _MANY_CORES = 3.0, 15.0, 16
_LARGE_S = 0.8


@dataclass(frozen=True, slots=True)
class Pace:
    """What one trial measured.

    Attributes:
        ticks_per_s: frames of the world, by wall time.
        pictures_per_s: of each camera.
        simulated_share: simulated by wall time.
        answers_s: how long each call of the other client took.
        server_cpu_s: of the server, for each tick of a synchronous world.
        crowding: by what factor other programs stretched the time, before and after.
    """

    ticks_per_s: float
    pictures_per_s: float
    simulated_share: float
    answers_s: tuple[float, ...]
    server_cpu_s: float
    crowding: float

    @property
    def slow_answer_s(self) -> float:
        """The 99th percentile of the answers."""
        return float(np.percentile(self.answers_s, _PERCENTILE))


class _Asking:
    """A client that calls in a loop, in a thread; a context manager."""

    def __init__(self, port: int) -> None:
        client = carla.Client("127.0.0.1", port)
        client.set_timeout(_TIMEOUT_S)
        self._world = client.get_world()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._ask)
        self.answers_s: list[float] = []

    def __enter__(self) -> _Asking:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _ask(self) -> None:
        while not self._over.wait(_ASKED_EVERY_S):
            began = time.perf_counter()
            self._world.get_weather()
            self.answers_s.append(time.perf_counter() - began)


def pace_trial(
    port: int,
    server_pid: int,
    *,
    cameras: int,
    size: tuple[int, int],
    synchronous: bool,
    seconds: float,
) -> Pace:
    """Look at a world for some seconds; runs in the client's process."""
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_TIMEOUT_S)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode = synchronous
    settings.fixed_delta_seconds = _DELTA_S if synchronous else None
    world.apply_settings(settings)
    library = world.get_blueprint_library()
    place = world.get_map().get_spawn_points()[0]
    actors: list[Any] = [world.spawn_actor(library.find("vehicle.tesla.model3"), place)]
    blueprint = library.find("sensor.camera.rgb")
    for name, value in zip(("image_size_x", "image_size_y"), size, strict=True):
        blueprint.set_attribute(name, str(value))
    count = itertools.count()
    pictures = [0]
    came = threading.Condition()

    def received(_image: carla.Image) -> None:
        with came:
            pictures[0] = next(count) + 1
            came.notify_all()

    def wait_for(number: int) -> None:
        with came:
            if not came.wait_for(lambda: pictures[0] >= number, _TIMEOUT_S):
                raise TimeoutError(f"{pictures[0]} of {number} pictures came")

    for turn in range(cameras):
        mounted = carla.Transform(carla.Location(x=1.5, z=1.6), carla.Rotation(yaw=60.0 * turn))
        actors.append(world.spawn_actor(blueprint, mounted, attach_to=actors[0]))
        actors[-1].listen(received)
    try:
        if synchronous:
            world.tick()
        wait_for(cameras)
        crowded = crowding()
        with _Asking(port) as asking:
            first, before = pictures[0], world.get_snapshot()
            cpu_s, began = process_cpu_s(server_pid), time.perf_counter()
            while (elapsed := time.perf_counter() - began) < seconds:
                if synchronous:
                    expected = pictures[0] + cameras
                    world.tick()
                    wait_for(expected)
                else:
                    world.wait_for_tick(_TIMEOUT_S)
            after = world.get_snapshot()
            cpu_s = process_cpu_s(server_pid) - cpu_s
        ticks = after.frame - before.frame
        simulated_s = after.timestamp.elapsed_seconds - before.timestamp.elapsed_seconds
        return Pace(
            ticks_per_s=ticks / elapsed,
            pictures_per_s=(pictures[0] - first) / elapsed / cameras,
            simulated_share=simulated_s / elapsed,
            answers_s=tuple(asking.answers_s),
            server_cpu_s=cpu_s / ticks,
            crowding=(crowded + crowding()) / 2.0,
        )
    finally:
        for actor in actors[1:]:
            actor.stop()
        for actor in reversed(actors):
            actor.destroy()
        settings.synchronous_mode = False
        settings.fixed_delta_seconds = None
        world.apply_settings(settings)


def check_real_time(*, seconds: float = 10.0) -> Verdict:
    """Measures cameras in synchronous mode and one of 1280x720 in asynchronous mode."""
    cores = len(os.sched_getaffinity(0))
    with started_server(("--map", "Stage01")) as server:
        slow = max(1.0, slowness())
        synchronous, free, large = (
            run_trial(
                pace_trial,
                server.port,
                server.pid,
                cameras=cameras,
                size=size,
                synchronous=ticked,
                seconds=seconds,
                timeout_s=180.0 + 4.0 * seconds,
            )
            for cameras, size, ticked in (
                (3, (800, 600), True),
                (1, (1280, 720), False),
                (1, (1920, 1080), True),
            )
        )
    return Verdict(
        "real-time",
        (
            Figure("machine_slowness", slow),
            Figure("crowding_in_synchronous_mode", synchronous.crowding),
            Figure("cores", cores),
            Figure(
                "ticks_per_s_of_3_cameras",
                synchronous.ticks_per_s,
                ">=",
                _TICKS_PER_S_OF_MANY_CORES if cores >= _MANY_CORES else _TICKS_PER_S,
            ),
            Figure("s_per_tick_of_a_1920x1080_camera", 1.0 / large.ticks_per_s, "<=", _LARGE_S),
            Figure("server_cpu_s_per_tick_of_3_cameras", synchronous.server_cpu_s),
            Figure("answers_in_synchronous_mode", len(synchronous.answers_s)),
            Figure("answer_s_p99_in_synchronous_mode", synchronous.slow_answer_s),
            Figure(
                "scaled_answer_s_p99_in_synchronous_mode",
                synchronous.slow_answer_s / synchronous.crowding,
                "<=",
                _LONGEST_ANSWER_S,
            ),
            Figure("crowding_in_asynchronous_mode", free.crowding),
            Figure("simulated_by_wall_time", free.simulated_share, ">=", _SMALLEST_SHARE),
            Figure("ticks_per_s_in_asynchronous_mode", free.ticks_per_s),
            Figure("pictures_per_s_in_asynchronous_mode", free.pictures_per_s),
            Figure("answers_in_asynchronous_mode", len(free.answers_s)),
            Figure("answer_s_p99_in_asynchronous_mode", free.slow_answer_s),
            Figure(
                "scaled_answer_s_p99_in_asynchronous_mode",
                free.slow_answer_s / free.crowding,
                "<=",
                _LONGEST_ANSWER_S,
            ),
        ),
        ("answers are scaled by how much other programs stretched the time",),
    )
