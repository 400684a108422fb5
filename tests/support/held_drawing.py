"""A served simulation whose pictures are drawn only when a test lets them."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

from carstage_sim.server import Server
from carstage_sim.simulation import Simulation
from carstage_sim.wire.dialect import dialect
from carstage_sim.wire.socket_loop import bind
from carstage_sim.world.actors import Actor
from carstage_sim.world.controls import EpisodeSettings
from carstage_sim.world.pose import Pose
from raw_client import RawClient, read_message, subscribe
from waiting import await_that

SIZE = {"image_size_x": "16", "image_size_y": "9"}
LARGE = {"image_size_x": "640", "image_size_y": "360"}  # more than a client receives unread
SYNCHRONOUS = EpisodeSettings(synchronous_mode=True, fixed_delta_seconds=0.05)


class Gate:
    """Lets cameras draw only while it is open, or slowly; counts those that came and went."""

    def __init__(self) -> None:
        self.open = threading.Event()
        self.open.set()
        self.came = self.done = 0
        self.takes_s = 0.0
        self.give_way: Callable[[], None] = lambda: None
        self.threads: set[str] = set()
        self._one = threading.Event()

    def let_one_through(self) -> None:
        """The camera that waits at the gate, or the next that comes to it."""
        self._one.set()

    def pass_through(self) -> None:
        self.came += 1
        self.threads.add(threading.current_thread().name)
        await_that(lambda: self.open.is_set() or self._one.is_set(), within_s=60.0)
        self._one.clear()
        for _ in range(round(self.takes_s / 0.01)):
            time.sleep(0.01)
            self.give_way()
        self.done += 1


@contextmanager
def server_of(simulation: Simulation) -> Iterator[Server]:
    """A server of the simulation that does not run yet."""
    with (
        bind("127.0.0.1", 0) as rpc_socket,
        bind("127.0.0.1", 0) as streaming_socket,
        Server(
            simulation,
            dialect("0.9.16"),
            rpc_socket=rpc_socket,
            streaming_socket=streaming_socket,
            frames_per_s=50.0,
        ) as server,
    ):
        yield server


@contextmanager
def serving(simulation: Simulation) -> Iterator[Server]:
    """A server of the simulation in a thread of its own; it ends with the block."""
    with server_of(simulation) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        try:
            yield server
        finally:
            server.stop()
            thread.join()


class Rig:
    """A served simulation with cameras and an IMU, and clients of it."""

    def __init__(self, simulation: Simulation, resources: ExitStack) -> None:
        world = simulation.world
        self.camera = world.spawn("sensor.camera.depth", SIZE, Pose((0.0, 0.0, 3.0)))
        self.colour = world.spawn("sensor.camera.rgb", LARGE, Pose((0.0, 0.0, 3.0)))
        self.events = world.spawn("sensor.camera.dvs", SIZE, Pose((0.0, 0.0, 3.0)))
        self.flow = world.spawn("sensor.camera.optical_flow", SIZE, Pose((0.0, 0.0, 3.0)))
        self.imu = world.spawn("sensor.other.imu", {}, Pose((0.0, 0.0, 3.0)))
        server = resources.enter_context(serving(simulation))
        self.client, self.other = (
            resources.enter_context(RawClient("127.0.0.1", server.rpc_port)) for _ in range(2)
        )
        self._world = world
        self._port = server.streaming_port
        self._resources = resources

    def subscribed(self, sensor: Actor) -> socket.socket:
        """A stream of a sensor, which the server knows of when it answers the next call."""
        self.client.value("get_sensor_token", sensor.stream_id)
        stream = subscribe("127.0.0.1", self._port, sensor.stream_id)
        return self._resources.enter_context(stream)

    def spawned_by_other(self, type_id: str, attributes: Mapping[str, str]) -> Actor:
        """A sensor of the other client."""
        values = [[name, 1, value] for name, value in attributes.items()]
        place = [[0.0, 0.0, 3.0], [0.0, 0.0, 0.0]]
        row = self.other.value("spawn_actor", [0, type_id, values], place)
        return self._world.live(row[0])

    def asking(self, name: str, *arguments: Any) -> Callable[[], Any]:
        """Call in the other client's thread; gives what is there of the answer."""
        answers: list[Any] = []
        thread = threading.Thread(target=lambda: answers.append(self.other.value(name, *arguments)))
        thread.start()
        self._resources.callback(thread.join)
        return lambda: answers[0] if answers else None

    def ticks(self, count: int) -> list[int]:
        """Frames of so many ticks."""
        return [self.client.value("tick_cue") for _ in range(count)]


def frame_of(message: bytes) -> int:
    (frame,) = struct.unpack_from("<Q", message, 8)
    return int(frame)


def frames_of(stream: socket.socket, count: int) -> list[int]:
    return [frame_of(read_message(stream)) for _ in range(count)]
