"""A log of CARLA's recorder as trajectories, for scenario ``log``.

Little endian; locations in centimetres, angles in degrees, times in seconds. Source: CARLA's page
"Recorder binary file format" and the records ``CarlaRecorder*.h`` of its plugin (0.9.13 to 0.9.16).
The file is whoever's: it is bounded in size, and each count in it by the bytes that are there.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.config.scene import LogScenario, map_name
from carstage.errors import ConfigError
from carstage.files.bounded import read_bounded
from carstage.files.hashing import hash_of
from carstage.files.home import without_tilde
from carstage.geometry import FloatArray
from carstage.plan import Recording, Start, Track

MOST_BYTES: Final = 1 << 29
"""Half an hour of 200 road users at 20 frames per second."""
_MAGIC: Final = b"CARLA_RECORDER"
_CM_PER_M: Final = 100.0
_FARTHEST_M: Final = 1e5
_LOOKS: Final = ("color", "driver_id", "role_name")
_LONGEST_WORD: Final = 200
_BLUEPRINT: Final = re.compile(r"(vehicle|walker)\.[a-z0-9_.-]+")

_PACKET = struct.Struct("<BI")
_FRAME = struct.Struct("<Qdd")
_FRAME_START, _FRAME_END, _ADDED, _REMOVED, _POSITIONS, _PEDALS = 0, 1, 2, 3, 6, 8
_RECORDS: Final[dict[int, np.dtype[Any]]] = {
    _REMOVED: np.dtype([("id", "<u4")]),
    _POSITIONS: np.dtype([("id", "<u4"), ("location", "<f4", 3), ("rotation", "<f4", 3)]),
    _PEDALS: np.dtype(
        [
            *(("id", "<u4"), ("steer", "<f4"), ("throttle", "<f4"), ("brake", "<f4")),
            *(("hand_brake", "u1"), ("gear", "<i4")),
        ]
    ),
}


@dataclass(slots=True)
class _Actor:
    """A vehicle or walker of a log.

    Attributes:
        frames: the frames that place it.
        poses: six numbers of each, as in ``Track``.
        pedals: what drove it, by frame, in the order of ``Control``.
    """

    actor_id: int
    blueprint: str
    attributes: dict[str, str]
    frames: list[int] = field(default_factory=list)
    poses: list[tuple[float, ...]] = field(default_factory=list)
    pedals: dict[int, tuple[float, ...]] = field(default_factory=dict)


class _BrokenLogError(Exception):
    """The file is no log, or none that can be played."""


def read_log(scenario: LogScenario, folder: Path | None = None) -> Recording:
    """How everybody moved in a log.

    Args:
        scenario: names the log, its ego and the moment to begin with.
        folder: what a relative path is relative to; None: the working directory.

    Raises:
        ConfigError: the file cannot be read or is no log, or the ego is not in it; with the path of
            the setting.
    """
    path = (folder or Path.cwd()) / without_tilde(scenario.file)
    try:
        content = read_bounded(path, MOST_BYTES)
        town, times_s, actors = _parsed(content)
    except OSError as error:
        raise _refused("file", f"{path} cannot be read: {error.strerror}.") from error
    except (_BrokenLogError, struct.error) as error:
        raise _refused("file", f"{path} is no log of CARLA's recorder: {error}.") from error
    first = int(np.searchsorted(times_s, scenario.start_s - 1e-6))
    if first >= len(times_s):
        raise _refused("start_s", f"the log ends after {times_s[-1]:g} s.", "Begin earlier.")
    ego = _ego(scenario.ego, actors, first, times_s)
    here = [actor for actor in actors.values() if actor.frames and actor.frames[-1] >= first]
    others = [actor for actor in here if actor is not ego]
    tracks = tuple(_track(one, first, times_s, one is ego) for one in (ego, *others))
    return Recording(
        episode_id=f"log {hash_of(content)}",
        map=map_name(town),
        duration_s=float(tracks[0].times_s[-1]),
        tracks=tracks,
        field="scenario.file",
    )


def _refused(name: str, message: str, hint: str = "Give a file of start_recorder.") -> ConfigError:
    return ConfigError(f"scenario.{name}: {message}", hint)


def _parsed(content: bytes) -> tuple[str, FloatArray, dict[int, _Actor]]:
    """The map, ``(F,)`` times of the frames from the first one on, and vehicles and walkers by id.

    A frame that is cut off, as a writer's death leaves it, is no frame.

    Raises:
        _BrokenLogError, struct.error: it is no log.
    """
    town, start = _head(content)
    actors: dict[int, _Actor] = {}
    times_s: list[float] = []
    for elapsed_s, packets in _frames(content, start):
        if times_s and not elapsed_s > times_s[-1]:
            raise _BrokenLogError(f"its frame {len(times_s)} is not later than the one before")
        for kind, payload in packets:
            if kind == _ADDED:
                _note_added(payload, actors)
            elif kind in _RECORDS:
                _note(kind, _rows(kind, payload), len(times_s), actors)
        times_s.append(elapsed_s)
    if not times_s:
        raise _BrokenLogError("it has no whole frame")
    return town, np.array(times_s) - times_s[0], actors


def _head(content: bytes) -> tuple[str, int]:
    """The map, and where the packets begin."""
    magic, at = _text(content, 2)
    if magic != _MAGIC.decode():
        raise _BrokenLogError("it begins otherwise")
    town, at = _text(content, at + 8)
    return town, at


def _frames(content: bytes, at: int) -> Iterator[tuple[float, list[tuple[int, bytes]]]]:
    """Time and packets of each whole frame."""
    packets: list[tuple[int, bytes]] | None = None
    elapsed_s = 0.0
    while at + _PACKET.size <= len(content):
        kind, size = _PACKET.unpack_from(content, at)
        start, at = at + _PACKET.size, at + _PACKET.size + size
        if at > len(content):
            return
        if kind == _FRAME_START and size >= _FRAME.size:
            _, _, elapsed_s = _FRAME.unpack_from(content, start)
            packets = []
        elif kind == _FRAME_END and packets is not None:
            yield elapsed_s, packets
            packets = None
        elif packets is not None and (kind == _ADDED or kind in _RECORDS):
            packets.append((kind, content[start:at]))


def _text(content: bytes, at: int) -> tuple[str, int]:
    """A string and where it ends."""
    (size,) = struct.unpack_from("<H", content, at)
    end = at + 2 + size
    return content[at + 2 : end].decode(errors="replace"), end


def _rows(kind: int, payload: bytes) -> NDArray[np.void]:
    """The records of a packet; a count that promises more than there is counts what there is."""
    dtype = _RECORDS[kind]
    (count,) = struct.unpack_from("<H", payload)
    rows: NDArray[np.void] = np.frombuffer(
        payload, dtype, min(count, (len(payload) - 2) // dtype.itemsize), 2
    )
    return rows


def _note_added(payload: bytes, actors: dict[int, _Actor]) -> None:
    (count,) = struct.unpack_from("<H", payload)
    at = 2
    for _ in range(count):
        (actor_id,) = struct.unpack_from("<I", payload, at)
        blueprint, at = _text(payload, at + 33)  # behind the type, a pose and a number
        (attributes,) = struct.unpack_from("<H", payload, at)
        at += 2
        looks = {}
        for _ in range(attributes):
            name, at = _text(payload, at + 1)
            value, at = _text(payload, at)
            if name in _LOOKS and len(value) <= _LONGEST_WORD:
                looks[name] = value
        if len(blueprint) <= _LONGEST_WORD and _BLUEPRINT.fullmatch(blueprint):
            actors.setdefault(actor_id, _Actor(actor_id, blueprint, looks))


def _note(kind: int, rows: NDArray[np.void], frame: int, actors: dict[int, _Actor]) -> None:
    for row in rows:
        actor = actors.get(int(row["id"]))
        if actor is None:
            continue
        if kind == _POSITIONS:
            x, y, z = (row["location"].astype(np.float64) / _CM_PER_M).tolist()
            roll, pitch, yaw = row["rotation"].astype(np.float64).tolist()
            pose = (x, y, z, pitch, yaw, roll)
            if not (np.isfinite(pose).all() and max(map(abs, pose[:3])) <= _FARTHEST_M):
                raise _BrokenLogError(f"its frame {frame} places {actor.blueprint} nowhere")
            if not actor.frames or actor.frames[-1] < frame:
                actor.frames.append(frame)
                actor.poses.append(pose)
        elif kind == _PEDALS:
            gear = int(row["gear"])
            drive = [float(row[name]) for name in ("throttle", "steer", "brake")]
            if np.isfinite(drive).all():
                flags = (float(row["hand_brake"] != 0), float(gear < 0), float(gear))
                actor.pedals[frame] = (*drive, *flags)


def _ego(wanted: str, actors: Mapping[int, _Actor], first: int, times_s: FloatArray) -> _Actor:
    """The vehicle of a role, an id or a pattern that is there from a frame on."""
    vehicles = [actor for actor in actors.values() if actor.blueprint.startswith("vehicle.")]
    if wanted.isdigit():
        found = [actor for actor in vehicles if actor.actor_id == int(wanted)]
    elif "." in wanted or "*" in wanted:
        found = [actor for actor in vehicles if fnmatchcase(actor.blueprint, wanted)]
    else:
        found = [actor for actor in vehicles if actor.attributes.get("role_name") == wanted]
    found = sorted((one for one in found if one.frames), key=lambda actor: actor.actor_id)
    if not found:
        roles = sorted({actor.attributes.get("role_name", "") for actor in vehicles} - {""})
        raise _refused(
            "ego",
            f"no vehicle {wanted!r} is in the log, which has {len(vehicles)}.",
            f"Give a role ({', '.join(roles[:8]) or 'none is there'}), an id, or a pattern such as "
            "vehicle.tesla.*.",
        )
    for actor in found:
        if actor.frames[0] <= first < actor.frames[-1]:
            return actor
    begin_s, end_s = times_s[found[0].frames[0]], times_s[found[0].frames[-1]]
    raise _refused(
        "start_s",
        f"the ego {wanted!r} is there from {begin_s:g} s to {end_s:g} s only.",
        f"Give {begin_s:g}, or a later time.",
    )


def _track(actor: _Actor, first: int, times_s: FloatArray, is_ego: bool) -> Track:
    """The trajectory from a frame on, with the motion that it had there."""
    frames, poses = np.array(actor.frames), np.array(actor.poses)
    kept = frames >= first
    later = frames[kept]
    controls = None
    if is_ego and all(int(frame) in actor.pedals for frame in later):
        controls = np.array([actor.pedals[int(frame)] for frame in later])
    attributes = dict(actor.attributes)
    if is_ego:
        attributes["role_name"] = "hero"
    return Track(
        blueprint=actor.blueprint,
        attributes=attributes,
        is_ego=is_ego,
        times_s=times_s[later] - times_s[first],
        poses=poses[kept],
        start=_start(times_s[frames], poses, int(np.argmax(kept))),
        controls=controls,
    )


def _start(times_s: FloatArray, poses: FloatArray, at: int) -> Start | None:
    """Motion at a pose, by differences between its neighbours; None where it has none."""
    if len(times_s) < 3:
        return None
    around = slice(max(0, at - 2), at + 3)
    turned = np.unwrap(poses[around, 4], period=360.0)
    velocity = np.gradient(poses[around, :3], times_s[around], axis=0)
    acceleration = np.gradient(velocity, times_s[around], axis=0)
    here = at - around.start
    yaw_rate = np.gradient(turned, times_s[around])[here]
    return Start(velocity[here], acceleration[here], float(yaw_rate))
