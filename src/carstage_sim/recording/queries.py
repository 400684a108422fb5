"""The texts about a log that clients print, in the layout of CARLA's ``CarlaRecorderQuery``."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from carstage_sim.recording import describing
from carstage_sim.recording.events import actors_added
from carstage_sim.recording.layout import NO_ACTOR, Packet, records
from carstage_sim.recording.log import LogFrame, RecordingLog

_CATEGORIES = "ovwtha"
"""Letters of the actor types: other, vehicle, walker, traffic light; then hero and any."""


def file_info(log: RecordingLog, *, show_all: bool) -> str:
    """What is in a log: who comes, goes and collides, and with ``show_all`` every record."""
    lines = [_head(log)]
    for index, frame in enumerate(log.frames):
        body = [
            text
            for kind, payload in log.packets(index)
            if (text := _described(kind, payload, show_all=show_all))
        ]
        if body or show_all:
            lines.append(f"Frame {frame.number} at {frame.elapsed_s:g} seconds\n")
        lines += body
    return "".join([*lines, _foot(log)])


def _described(kind: int, payload: bytes, *, show_all: bool) -> str:
    describe: Callable[[bytes], str] | None = describing.EVENTS.get(kind)
    if describe is None and show_all:
        describe = describing.STATES.get(kind)
    return describe(payload) if describe is not None else ""


def collisions(log: RecordingLog, first: str, second: str) -> str:
    """Collisions of two categories of actors (o, v, w, t, h, a), reported when they begin."""
    lines = [
        _head(log),
        f"{'Time':>8} {'Types':>6} {'Id':>6} {'Actor 1':<35} {'Id':>6} {'Actor 2':<35}\n",
    ]
    actors = _Actors()
    touching: set[tuple[int, int]] = set()
    for frame, packets in _frames(log):
        before, touching = touching, set()
        for kind, payload in packets:
            actors.follow(kind, payload)
            if kind != Packet.COLLISION:
                continue
            for row in records(Packet.COLLISION, payload):
                pair = (int(row["first"]), int(row["second"]))
                letters = actors.category(pair[0]), actors.category(pair[1])
                if not (
                    _matches(first, letters[0], bool(row["first_is_hero"]))
                    and _matches(second, letters[1], bool(row["second_is_hero"]))
                ):
                    continue
                if pair not in before | touching:
                    lines.append(
                        f"{frame.elapsed_s:8.0f}   {letters[0]} {letters[1]}  "
                        f"{_number(pair[0]):>6} {actors.type_id(pair[0]):<35} "
                        f"{_number(pair[1]):>6} {actors.type_id(pair[1]):<35}\n"
                    )
                touching.add(pair)
    return "".join([*lines, _foot(log)])


def _number(actor_id: int) -> int:
    return -1 if actor_id == NO_ACTOR else actor_id


def _matches(wanted: str, category: str, is_hero: bool) -> bool:
    return wanted in ("a", category) or (wanted == "h" and is_hero)


@dataclass(slots=True)
class _Actors:
    """Which actors live at a point of a log, and what they are."""

    known: dict[int, tuple[int, str]] = field(default_factory=dict)

    def follow(self, kind: int, payload: bytes) -> None:
        """Take note of who comes. Who went is still named: ids are not used again."""
        if kind == Packet.EVENT_ADD:
            for actor in actors_added(payload):
                self.known[actor.actor_id] = (actor.kind, actor.type_id)

    def category(self, actor_id: int) -> str:
        kind, _ = self.known.get(actor_id, (0, ""))
        return _CATEGORIES[kind] if kind < len(_CATEGORIES) else "o"

    def type_id(self, actor_id: int) -> str:
        return self.known.get(actor_id, (0, ""))[1]


@dataclass(slots=True)
class _Stop:
    """Where an actor was last seen moving, since when it stands and for how long."""

    place: np.ndarray[tuple[int], np.dtype[np.float32]]
    since_s: float = 0.0
    lasted_s: float = 0.0


def actors_blocked(log: RecordingLog, min_time_s: float, min_distance_cm: float) -> str:
    """Who stood for a time, the longest first.

    Args:
        log: the recording.
        min_time_s: shortest stop that is reported.
        min_distance_cm: way that ends a stop.
    """
    actors, stops = _Actors(), dict[int, _Stop]()
    found: list[tuple[float, str]] = []

    def tell(actor_id: int, stop: _Stop) -> None:
        if stop.lasted_s >= min_time_s:
            line = (
                f"{stop.since_s:8.0f} {actor_id:>6} {actors.type_id(actor_id):<35} "
                f"{stop.lasted_s:>10.0f}\n"
            )
            found.append((stop.lasted_s, line))

    times = [frame.elapsed_s for frame in log.frames]
    for index, (frame, packets) in enumerate(_frames(log)):
        lasts_s = times[index + 1] - times[index] if index + 1 < len(times) else 0.0
        for kind, payload in packets:
            actors.follow(kind, payload)
            if kind != Packet.POSITION:
                continue
            for row in records(Packet.POSITION, payload):
                actor_id, place = int(row["id"]), row["location"]
                stop = stops.get(actor_id)
                if stop is not None and np.linalg.norm(place - stop.place) < min_distance_cm:
                    stop.since_s = stop.since_s if stop.lasted_s else frame.elapsed_s
                    stop.lasted_s += lasts_s
                    continue
                if stop is not None:
                    tell(actor_id, stop)
                stops[actor_id] = _Stop(place)
    for actor_id, stop in stops.items():
        tell(actor_id, stop)
    found.sort(key=lambda item: -item[0])
    head = f"{'Time':>8} {'Id':>6} {'Actor':<35} {'Duration':>10}\n"
    return "".join([_head(log), head, *(line for _, line in found), _foot(log)])


def _frames(log: RecordingLog) -> Iterator[tuple[LogFrame, Iterator[tuple[int, bytes]]]]:
    for index, frame in enumerate(log.frames):
        yield frame, log.packets(index)


def _head(log: RecordingLog) -> str:
    """Version, map and date; a log without a date has that of its file."""
    moment = time.localtime(log.info.date or log.modified_s)
    date = time.strftime("%m/%d/%y %H:%M:%S", moment)
    return f"Version: {log.info.version}\nMap: {log.info.map_name}\nDate: {date}\n\n"


def _foot(log: RecordingLog) -> str:
    number = log.frames[-1].number if log.frames else 0
    return f"\nFrames: {number}\nDuration: {log.duration_s:g} seconds\n"
