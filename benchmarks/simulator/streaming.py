"""How fast do pictures reach the client, and what does sending them cost?

The server renders a few distinct pictures per camera and repeats them (``--loop``), so that only
the way from its memory into the client's callbacks is measured.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import carla

from benchmarks.crowding import crowding
from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import started_server
from carstage.bench.calibration import slowness
from carstage.bench.process_figures import process_cpu_s
from carstage.bench.verdict import Figure, Verdict

WIDTH, HEIGHT = 1280, 720
DISTINCT = 4
PACED_HZ = 10.0
MANY = 5
_DELTA_S = 0.05
_TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class Throughput:
    """What one trial measured.

    Attributes:
        images_per_s: into the callbacks, of all cameras together.
        server_cpu_per_s: cores that the server used.
        client_cpu_per_s: cores that the client used.
        mismatched: pictures whose frame was not that of a tick, or of the wrong size.
        crowding: by what factor other programs stretched the time, before and after.
    """

    images_per_s: float
    server_cpu_per_s: float
    client_cpu_per_s: float
    mismatched: int
    crowding: float


class _Counter:
    """Counts pictures in callbacks, which come in threads of the client."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self.count = 0
        self.mismatched = 0

    def __call__(self, image: carla.Image) -> None:
        with self._changed:
            self.count += 1
            self.mismatched += (image.width, image.height) != (WIDTH, HEIGHT)
            self._changed.notify()

    def wait_for(self, count: int) -> None:
        with self._changed:
            if not self._changed.wait_for(lambda: self.count >= count, _TIMEOUT_S):
                raise TimeoutError(f"{self.count} of {count} pictures came")


def throughput_trial(
    port: int, server_pid: int, *, cameras: int, seconds: float, paced_hz: float | None
) -> Throughput:
    """Ticks as fast as pictures come, or at a pace; runs in the client's process."""
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_TIMEOUT_S)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = _DELTA_S
    world.apply_settings(settings)
    blueprint = world.get_blueprint_library().find("sensor.camera.rgb")
    blueprint.set_attribute("image_size_x", str(WIDTH))
    blueprint.set_attribute("image_size_y", str(HEIGHT))
    place = carla.Transform(carla.Location(z=20.0))
    sensors = [world.spawn_actor(blueprint, place) for _ in range(cameras)]
    counter = _Counter()
    for sensor in sensors:
        sensor.listen(counter)
    ticks = 0
    try:
        for _ in range(DISTINCT + 2):  # these are rendered
            world.tick()
            ticks += 1
            counter.wait_for(ticks * cameras)
        crowded = crowding()
        first, server_before, client_before = (
            counter.count,
            process_cpu_s(server_pid),
            time.process_time(),
        )
        began = time.perf_counter()
        while (elapsed := time.perf_counter() - began) < seconds:
            if paced_hz is not None:
                _sleep_until(began + (ticks - DISTINCT - 2) / paced_hz)
            world.tick()
            ticks += 1
            # One tick ahead: the server writes while the client reads the picture before.
            counter.wait_for((ticks - 1) * cameras)
        counter.wait_for(ticks * cameras)
        elapsed = time.perf_counter() - began
        return Throughput(
            images_per_s=(counter.count - first) / elapsed,
            server_cpu_per_s=(process_cpu_s(server_pid) - server_before) / elapsed,
            client_cpu_per_s=(time.process_time() - client_before) / elapsed,
            mismatched=counter.mismatched + abs(counter.count - ticks * cameras),
            crowding=(crowded + crowding()) / 2.0,
        )
    finally:
        for sensor in sensors:
            sensor.stop()
            sensor.destroy()
        settings.synchronous_mode = False
        world.apply_settings(settings)


def _sleep_until(moment: float) -> None:
    # A pace is what this is for: there is no condition to wait for.
    time.sleep(max(moment - time.perf_counter(), 0.0))


def check_streaming(*, seconds: float = 5.0) -> Verdict:
    """Measures one camera and five at full speed, and five at 10 Hz.

    Targets are those of the reference machine. Pictures per second are scaled by how slow this
    one is and by how much of it other programs take meanwhile; CPU time by the former.
    """
    with started_server(("--loop", str(DISTINCT), "--map", "Stage01")) as server:
        slow = max(1.0, slowness())
        trials: dict[str, tuple[int, float | None]] = {
            "one": (1, None),
            "five": (MANY, None),
            "five_paced": (MANY, PACED_HZ),
        }
        found = {
            name: run_trial(
                throughput_trial,
                server.port,
                server.pid,
                cameras=cameras,
                seconds=seconds,
                paced_hz=paced_hz,
                timeout_s=120.0 + 2.0 * seconds,
            )
            for name, (cameras, paced_hz) in trials.items()
        }
    one, five, paced = (found[name] for name in trials)
    return Verdict(
        "streaming",
        (
            Figure("machine_slowness", slow),
            Figure("images_per_s_of_1_camera", one.images_per_s),
            Figure("crowding_with_1_camera", one.crowding),
            Figure(
                "scaled_images_per_s_of_1_camera",
                one.images_per_s * slow * one.crowding,
                ">=",
                500.0,
            ),
            Figure("server_cpu_ms_per_image", 1e3 * one.server_cpu_per_s / one.images_per_s),
            Figure("server_cores_with_1_camera", one.server_cpu_per_s),
            Figure("client_cores_with_1_camera", one.client_cpu_per_s),
            Figure("images_per_s_of_5_cameras", five.images_per_s),
            Figure("crowding_with_5_cameras", five.crowding),
            Figure(
                "scaled_images_per_s_of_5_cameras",
                five.images_per_s * slow * five.crowding,
                ">=",
                300.0,
            ),
            Figure("server_cores_with_5_cameras", five.server_cpu_per_s),
            Figure("client_cores_with_5_cameras", five.client_cpu_per_s),
            Figure("images_per_s_of_5_cameras_at_10_hz", paced.images_per_s),
            Figure("server_cores_of_5_cameras_at_10_hz", paced.server_cpu_per_s),
            Figure(
                "scaled_server_cores_of_5_cameras_at_10_hz",
                paced.server_cpu_per_s / slow,
                "<=",
                0.2,
            ),
            Figure(
                "pictures_of_a_wrong_number_or_size",
                sum(f.mismatched for f in found.values()),
                "==",
                0,
            ),
        ),
    )
