"""The client that does everything right and must not notice anything."""

from __future__ import annotations

import queue
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import carla

_DELTA_S = 0.05
_TIMEOUT_S = 60.0
_MOST_WAITING = 256
"""Data of one sensor that may wait; each tick takes what has come."""
_PACE_S = 0.02
_HEIGHT_M = 30.0
_SLOW_S = 0.3


@dataclass(slots=True)
class HealthyFigures:
    """What the healthy client saw.

    Attributes:
        ticks: that it made.
        ticks_s: how long it waited for each, with the data of its sensors.
        slow: those that took a while: when they ended on the machine's monotonic clock, how long
            they took.
        wrong: what was not as it should be.
    """

    ticks: int = 0
    ticks_s: list[float] = field(default_factory=list)
    slow: list[tuple[float, float]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    @property
    def longest_tick_s(self) -> float:
        """The longest wait for a tick; 0 without any."""
        return max(self.ticks_s, default=0.0)

    def note(self, began_s: float) -> None:
        """A tick that began then has just ended."""
        now_s = time.monotonic()
        self.ticks += 1
        self.ticks_s.append(now_s - began_s)
        if now_s - began_s > _SLOW_S:
            self.slow.append((now_s, now_s - began_s))


def healthy_trial(port: int, *, ready: str, enough: str, fewest: int, until: str) -> HealthyFigures:
    """Ticks and compares until a file exists; runs in the client's process.

    Args:
        port: the server's.
        ready: path of a file to make when the client is at work.
        enough: path of a file to make once it has ticked often enough to have noticed.
        fewest: that many ticks are enough.
        until: path of the file that ends it.
    """
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_TIMEOUT_S)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = _DELTA_S
    world.apply_settings(settings)
    library = world.get_blueprint_library()
    place = carla.Transform(carla.Location(x=1.0, y=2.0, z=_HEIGHT_M))
    camera = library.find("sensor.camera.semantic_segmentation")
    camera.set_attribute("image_size_x", "96")
    camera.set_attribute("image_size_y", "64")
    sensors = [world.spawn_actor(camera, place)]
    sensors.append(world.spawn_actor(library.find("sensor.other.gnss"), place))
    arrived: list[queue.Queue[Any]] = [queue.Queue(_MOST_WAITING) for _ in sensors]
    for sensor, data in zip(sensors, arrived, strict=True):
        sensor.listen(data.put)
    figures = HealthyFigures()
    stop, pause = Path(until), threading.Event()
    before = world.tick()
    Path(ready).touch()
    try:
        while not stop.exists():
            began_s = time.monotonic()
            frame = world.tick()
            for data in arrived:
                _take(data, frame, figures)
            figures.note(began_s)
            _compare(client, world, sensors, figures, newer=frame > before)
            before = frame
            if figures.ticks == fewest:
                Path(enough).touch()
            pause.wait(_PACE_S)
    finally:
        for sensor in sensors:
            sensor.stop()
            sensor.destroy()
        settings.synchronous_mode = False
        settings.fixed_delta_seconds = None
        world.apply_settings(settings)
    return figures


def _take(data: queue.Queue[Any], frame: int, figures: HealthyFigures) -> None:
    """Waits for the data of a frame; every frame has to come."""
    while True:
        measurement = data.get(timeout=_TIMEOUT_S)
        if measurement.frame == frame:
            return
        if measurement.frame > frame:
            figures.wrong.append(f"no {type(measurement).__name__} of frame {frame}")
            return


def _compare(
    client: carla.Client,
    world: carla.World,
    sensors: list[carla.Sensor],
    figures: HealthyFigures,
    *,
    newer: bool,
) -> None:
    place = sensors[0].get_location()
    settings = world.get_settings()
    expected = {
        "frame numbers rise": newer,
        "its sensors live": all(sensor.is_alive for sensor in sensors),
        "its sensors stay": (place.x, place.y, place.z) == (1.0, 2.0, _HEIGHT_M),
        "the server answers": client.get_server_version() == "0.9.16",
        "the world is synchronous": settings.synchronous_mode,
        "the step is the same": settings.fixed_delta_seconds == _DELTA_S,
    }
    figures.wrong.extend(f"not so: {what}" for what, holds in expected.items() if not holds)


def newcomer_trial(port: int) -> list[str]:
    """Looks at everything once, after all that happened; what it did not find."""
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_TIMEOUT_S)
    world = client.get_world()
    found = {
        "a frame": world.wait_for_tick(_TIMEOUT_S).frame,
        "spawn points": world.get_map().get_spawn_points(),
        "blueprints": world.get_blueprint_library(),
        "traffic lights": world.get_actors().filter("traffic.traffic_light"),
        "a spectator": world.get_spectator(),
        "weather": world.get_weather(),
        "vehicles' lights": world.get_vehicles_light_states() is not None,
        "boxes of the level": world.get_level_bbs(carla.CityObjectLabel.Any),
    }
    world.get_lightmanager().get_all_lights()
    return [name for name, value in found.items() if not value]
