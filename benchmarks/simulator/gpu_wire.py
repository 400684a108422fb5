"""How many ticks a second a client gets that waits for the pictures of five cameras."""

from __future__ import annotations

import queue
import statistics
import time
from collections import Counter, deque
from collections.abc import Sequence

import carla

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import started_server
from carstage.bench.verdict import Figure

CAMERAS = 5
_DELTA_S = 0.05
_TIMEOUT_S = 60.0
_WARM_TICKS = 60
_ROUNDS = 5
_ROUND_TICKS = 100
_LEAST_TICKS_PER_S = 120.0


def ticks_trial(
    port: int, *, size: tuple[int, int], warm: int, ticks: int, ahead: int
) -> list[float]:
    """Ticks per second in each of five rounds; runs in the client's process.

    Args:
        port: of the server.
        size: of the pictures.
        warm: ticks before the first round.
        ticks: of a round.
        ahead: ticks that the client asks for before it has the pictures of an earlier one.
    """
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_TIMEOUT_S)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = _DELTA_S
    world.apply_settings(settings)
    library = world.get_blueprint_library()
    car = world.spawn_actor(
        library.find("vehicle.tesla.model3"), world.get_map().get_spawn_points()[0]
    )
    blueprint = library.find("sensor.camera.rgb")
    for name, side in zip(("image_size_x", "image_size_y"), size, strict=True):
        blueprint.set_attribute(name, str(side))
    pictures: queue.Queue[carla.Image] = queue.Queue(4 * CAMERAS)
    sensors = []
    for number in range(CAMERAS):
        place = carla.Transform(carla.Location(z=2.0), carla.Rotation(yaw=number * 360.0 / CAMERAS))
        sensors.append(world.spawn_actor(blueprint, place, attach_to=car))
        sensors[-1].listen(pictures.put)
    rates = []
    waiting: deque[int] = deque()
    came: Counter[int] = Counter()
    try:
        for count in (warm, *[ticks] * _ROUNDS):
            begun = time.perf_counter()
            for _ in range(count):
                waiting.append(world.tick())
                while len(waiting) > ahead:
                    while came[waiting[0]] < CAMERAS:
                        picture = pictures.get(timeout=_TIMEOUT_S)
                        if picture.frame not in waiting:
                            raise RuntimeError(f"a picture of {picture.frame}, not of {waiting}")
                        came[picture.frame] += 1
                    del came[waiting.popleft()]
            rates.append(count / (time.perf_counter() - begun))
    finally:
        for sensor in sensors:
            sensor.stop()
            sensor.destroy()
        car.destroy()
    return rates[1:]


def wire_figures(
    town: str,
    *,
    device: str = "gpu",
    size: tuple[int, int] = (1280, 720),
    warm: int = _WARM_TICKS,
    ticks: int = _ROUND_TICKS,
) -> Sequence[Figure]:
    """Median and least of the rounds, server and client started afresh.

    The target is for a client that waits for a tick's pictures before it asks for the next; the
    recorder asks before it has them.
    """
    of_client: list[list[float]] = []
    for ahead in (0, 1):
        with started_server(("--device", device, "--map", town)) as server:
            of_client.append(
                run_trial(
                    ticks_trial,
                    server.port,
                    size=size,
                    warm=warm,
                    ticks=ticks,
                    ahead=ahead,
                    timeout_s=600.0,
                )
            )
    rates, rates_ahead = of_client
    return (
        Figure(
            f"ticks a second through the wire, five cameras, colours, {town}",
            statistics.median(rates),
            ">=",
            _LEAST_TICKS_PER_S,
        ),
        Figure(f"the slowest of {len(rates)} rounds of {ticks} ticks, {town}", min(rates)),
        Figure(
            f"the same of a client that asks for one tick more at once, {town}",
            statistics.median(rates_ahead),
        ),
    )
