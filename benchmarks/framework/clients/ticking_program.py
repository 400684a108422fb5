"""A program that ticks a server and knows nothing of recorders: ``HOST PORT TICKS LIVES [input]``.

It makes its ego anew for each life. It ticks until somebody has attached a sensor, and while the
streams of the sensors come up: two seconds, or with ``input`` until a line comes on standard input.
Then it ticks so many times as fast as it can. A JSON line tells how fast. Lines ``begin`` and
``end`` on standard error enclose these.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time

import carla

_STREAMS_S = 2.0
"""From the first sensor until every one is listened to, on a machine that is not too busy."""
_PATIENCE_S = 120.0


def carries_sensors(world: carla.World, ego: carla.Actor) -> bool:
    """Whether somebody has attached a sensor to the ego."""
    parents = [sensor.parent for sensor in world.get_actors().filter("sensor.*")]
    return any(parent is not None and parent.id == ego.id for parent in parents)


def lines_of_input() -> threading.Semaphore:
    """Is released once for each line; the end of the input is no line."""
    came = threading.Semaphore(0)

    def read() -> None:
        # Not by sys.stdin: an interpreter that ends cannot close what a thread reads from.
        while part := os.read(0, 1):
            if part == b"\n":
                came.release()

    threading.Thread(target=read, daemon=True).start()
    return came


def tick_until_listened_to(world: carla.World, lines: threading.Semaphore | None) -> None:
    """Tick while streams come up: until a line says that they are, or for two seconds."""
    until_s = time.monotonic() + (_STREAMS_S if lines is None else _PATIENCE_S)
    while time.monotonic() < until_s and not (lines is not None and lines.acquire(blocking=False)):
        world.tick()


def main() -> None:
    """Run the program."""
    host, port, ticks, lives = sys.argv[1], *map(int, sys.argv[2:5])
    lines = lines_of_input() if sys.argv[5:] == ["input"] else None
    client = carla.Client(host, port)
    client.set_timeout(120.0)
    world = client.load_world("Stage01")
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.1
    world.apply_settings(settings)
    library = world.get_blueprint_library()
    points = world.get_map().get_spawn_points()
    blueprint = library.find("vehicle.tesla.model3")
    blueprint.set_attribute("role_name", "hero")
    ahead = world.spawn_actor(library.find("vehicle.audi.tt"), points[1])
    for _ in range(lives):
        ego = world.spawn_actor(blueprint, points[0])
        ego.apply_control(carla.VehicleControl(throttle=0.5))
        first_frame = world.tick()
        deadline_s = time.monotonic() + _PATIENCE_S
        while not carries_sensors(world, ego) and time.monotonic() < deadline_s:
            world.tick()
        tick_until_listened_to(world, lines)
        sys.stderr.write("begin\n")
        begin_s = time.perf_counter()
        for _ in range(ticks):
            frame = world.tick()
        ticks_per_s = ticks / (time.perf_counter() - begin_s)
        sys.stderr.write("end\n")
        frames = {"first_frame": first_frame, "last_frame": frame}
        line = json.dumps({**frames, "ticks_per_s": ticks_per_s})
        sys.stdout.write(line + "\n")
        sys.stdout.flush()
        ego.destroy()
        world.tick()
    ahead.destroy()
    settings.synchronous_mode, settings.fixed_delta_seconds = False, None
    world.apply_settings(settings)


if __name__ == "__main__":
    main()
