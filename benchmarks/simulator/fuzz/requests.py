"""Requests for every call that the server knows: valid ones, and what becomes of them.

A call's arguments follow from its handler's parameters, so that a new handler is fuzzed without
being listed here.
"""

from __future__ import annotations

import copy
import random
import string
from collections.abc import Callable, Sequence
from typing import Any

import msgpack

from carstage_sim.wire.handlers import known_calls, parameters_of

LEFT_OUT = frozenset(
    {
        # They change the world of the healthy client as they should.
        "load_new_episode",
        "copy_opendrive_to_file",
        "set_episode_settings",
        # They write files under a client's names.
        "start_recorder",
        "replay_file",
    }
)
"""Calls that are not mutated at random; :func:`refused_requests` has cases of the first three."""

_NASTY: tuple[Any, ...] = (
    *(float("nan"), float("inf"), -float("inf"), 1e308, -1e-320, 1e9 + 1),
    *(0, -1, 2**31, 2**32, 2**63 - 1, 2**64 - 1, -(2**63)),
    *(None, True, False, "", "\x00", "é" * 300, "x" * 5000, b"", b"\xff" * 24),
    *([], [[]], {}, {"a": 1}, [None] * 100, [[[[[[0]]]]]], msgpack.ExtType(5, b"abc")),
)
_TYPE_IDS = (
    *("vehicle.tesla.model3", "vehicle.diamondback.century", "walker.pedestrian.0001"),
    *("static.prop.trafficcone01", "controller.ai.walker", "vehicle.no.such"),
    *("sensor.camera.rgb", "sensor.camera.dvs", "sensor.camera.optical_flow"),
    *("sensor.lidar.ray_cast", "sensor.lidar.ray_cast_semantic", "sensor.other.radar"),
    *("sensor.other.imu", "sensor.other.gnss", "sensor.other.obstacle", "sensor.other.collision"),
)
_ATTRIBUTES = (
    *("image_size_x", "image_size_y", "fov", "sensor_tick", "channels", "points_per_second"),
    *("range", "upper_fov", "horizontal_fov", "noise_seed", "noise_stddev", "role_name", "color"),
    *("hit_radius", "distance", "is_invincible", "speed"),
)
_ATTRIBUTE_VALUES = (
    *("0", "-1", "1", "64", "1e30", "nan", "inf", "", "true", "255,0,0", "9" * 30, "é", "0.05"),
)


class Requests:
    """Makes requests; the same seed makes the same ones.

    Args:
        rng: where all choices come from.
        actor_ids: ids that calls may be about; the list may grow and shrink meanwhile.
    """

    def __init__(self, rng: random.Random, actor_ids: Sequence[int] = ()) -> None:
        self._rng = rng
        self._actor_ids = actor_ids
        self._names = sorted(known_calls() - LEFT_OUT)

    def valid(self) -> tuple[str, list[Any]]:
        """Any call with arguments of the right shape."""
        name = self._rng.choice(self._names)
        return name, [self._argument(*parameter) for parameter in parameters_of(name)]

    def mutated(self) -> tuple[str, list[Any]]:
        """A call in which something is wrong."""
        name, arguments = self.valid()
        arguments = copy.deepcopy(arguments)
        for _ in range(self._rng.choice((1, 1, 1, 2, 5))):
            arguments = self._mutation(arguments)
        return name, arguments

    def packed(self, name: str, arguments: list[Any], message_id: int = 1) -> bytes:
        """The bytes of a request."""
        message: bytes = msgpack.packb(
            [0, message_id, name, [[False], *arguments]], unicode_errors="surrogateescape"
        )
        return message

    def _argument(self, name: str, annotation: str) -> Any:
        name = name.lstrip("_")
        if name in _STRUCTS:
            return _STRUCTS[name](self)
        if annotation.startswith("list[float]"):
            return self.vector()
        if annotation.startswith("list[int]"):
            return [self.actor_id() for _ in range(self._rng.randrange(4))]
        if annotation.startswith("list[str]"):
            return [self.text() for _ in range(self._rng.randrange(4))]
        simple: dict[str, Callable[[], Any]] = {
            "int": lambda: self._rng.choice((0, 1, 2, 3, 7, 255, 65535)),
            "float": lambda: self._rng.uniform(-10.0, 10.0),
            "bool": lambda: self._rng.random() < 0.5,
            "str": self.text,
        }
        return simple[annotation]() if annotation in simple else self._rng.choice(_NASTY)

    def _mutation(self, node: list[Any]) -> list[Any]:
        """The same list with one thing changed somewhere in it."""
        inner = [index for index, item in enumerate(node) if isinstance(item, list) and item]
        if inner and self._rng.random() < 0.6:
            index = self._rng.choice(inner)
            return [*node[:index], self._mutation(node[index]), *node[index + 1 :]]
        at = self._rng.randrange(len(node) + 1)
        nasty = self._rng.choice(_NASTY)
        kinds: list[Callable[[], list[Any]]] = [
            lambda: [*node[:at], nasty, *node[at + 1 :]],
            lambda: [*node[:at], nasty, *node[at:]],
            lambda: [*node[:at], *node[at + 1 :]],
            lambda: [*node, *node],
        ]
        return self._rng.choice(kinds)()

    def actor_id(self) -> int:
        """Mostly one that may exist."""
        if self._actor_ids and self._rng.random() < 0.8:
            return self._rng.choice(self._actor_ids)
        return self._rng.choice((0, 1, 2, 10_000_000, 2**32 - 1))

    def text(self) -> str:
        """Any short text."""
        return "".join(self._rng.choices(string.printable, k=self._rng.randrange(12)))

    def vector(self) -> list[float]:
        """Somewhere on a map, or a motion."""
        return [self._rng.uniform(-200.0, 200.0) for _ in range(3)]

    def transform(self) -> list[Any]:
        """A pose, mostly high above everything."""
        x, y, _ = self.vector()
        return [[x, y, self._rng.uniform(1.0, 80.0)], self.vector()]

    def description(self) -> list[Any]:
        """A blueprint with some attributes set."""
        attributes = [
            [self._rng.choice(_ATTRIBUTES), self._rng.randrange(1, 6), value]
            for value in self._rng.sample(_ATTRIBUTE_VALUES, self._rng.randrange(4))
        ]
        return [0, self._rng.choice(_TYPE_IDS), attributes]

    def control(self) -> list[Any]:
        """The controls of a vehicle, of a walker, or the physics of a vehicle."""
        wheel = [2.0, 0.25, 70.0, 35.0, 1500.0, 3000.0, 2.0, 17.0, 1000.0, [0.0, 0.0, 0.0]]
        curve = [[0.0, 400.0], [5000.0, 300.0]]
        gears = [[4.0, 0.5, 0.65], [2.0, 0.5, 0.65]]
        physics = [curve, 5000.0, 1.0, 0.15, 2.0, 0.35, True, 0.5, 10.0, 4.0, gears, 1500.0, 0.3]
        physics += [[0.0, 0.0, 0.0], [[0.0, 1.0], [100.0, 0.5]], [wheel] * 4, True]
        return self._rng.choice(
            (
                [self._rng.random(), 0.1, 0.0, False, False, False, 1],
                [[1.0, 0.0, 0.0], 1.4, False],
                [0.1, 0.0, 5.0, 1.0, 0.0],
                physics,
            )
        )

    def commands(self) -> list[Any]:
        """A batch."""
        return [self._command(3) for _ in range(self._rng.randrange(6))]

    def _command(self, depth: int) -> list[Any]:
        index = self._rng.randrange(23)
        if index == 0:
            after = [self._command(depth - 1) for _ in range(self._rng.randrange(2) * depth)]
            return [[0, [self.description(), self.transform(), [False], 0, "", after]]]
        bodies: tuple[list[Any], ...] = (
            *([], [self.control()], [self.vector()], [self.transform()]),
            *([self.transform(), 1.0], [True], [self._rng.randrange(4096)]),
        )
        return [[index, [self.actor_id(), *self._rng.choice(bodies)]]]


_STRUCTS: dict[str, Callable[[Requests], Any]] = {
    "actor_id": Requests.actor_id,
    "parent_id": Requests.actor_id,
    "follow_id": Requests.actor_id,
    "transform": Requests.transform,
    "offset": Requests.transform,
    "description": Requests.description,
    "control": Requests.control,
    "commands": Requests.commands,
    "do_tick": lambda _: False,
    "weather": lambda _: [10.0] * 14,
    "gains": lambda _: [0.15, 0.0, 0.25, 0.01, 0.0, 0.01],
    "flags": lambda _: [5],
    "shape": lambda requests: [
        [1, [requests.vector(), requests.vector(), 0.1]],
        [255, 0, 0],
        1.0,
        False,
    ],
    "texture": lambda _: [2, 2, [[255, 0, 0, 255]] * 4],
    "states": lambda requests: [[1, requests.vector(), 100.0, 2, [255, 0, 0], True]],
    "bones": lambda requests: [[["crl_hips__C", requests.transform()]]],
    "address": lambda _: ["127.0.0.1", 0],
    "port": lambda _: 0,
}


def refused_requests() -> list[tuple[str, list[Any]]]:
    """Requests about the whole world that must be refused, or change nothing."""
    nan = float("nan")
    settings = [True, False, [True, 0.05], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]

    def changed(index: int, value: Any) -> tuple[str, list[Any]]:
        return "set_episode_settings", [[*settings[:index], value, *settings[index + 1 :]]]

    return [
        *(changed(2, [True, step]) for step in (nan, -1.0, 1e9, "0.05", None)),
        *(changed(4, step) for step in (nan, -1.0, "x")),
        *(changed(5, substeps) for substeps in (-1, "x", None, 2**40)),
        *(changed(index, switch) for index in (0, 1) for switch in ("x", 0.5, None)),
        *(changed(6, distance) for distance in (nan, "x")),
        ("set_episode_settings", [[]]),
        ("set_episode_settings", [[True, False]]),
        ("set_episode_settings", []),
        ("load_new_episode", ["NoSuchTown", True, 0]),
        ("load_new_episode", ["../../../etc/passwd", True, 0]),
        ("load_new_episode", [5, "x", None]),
        ("load_new_episode", []),
        ("copy_opendrive_to_file", []),
        ("request_file", ["/etc/passwd"]),
    ]


def wrong_arguments(rng: random.Random) -> list[tuple[str, list[Any]]]:
    """Every call once, with arguments that do not fit it, or with none."""
    requests = []
    for name in sorted(known_calls()):
        count = len(parameters_of(name))
        wrong: list[list[Any]] = [
            [],
            [None] * count,
            [{}] * count,
            [rng.choice(_NASTY)] * (count + 3),
            [[] for _ in range(max(count - 1, 0))],
        ]
        requests.append((name, rng.choice(wrong)))
    return requests
