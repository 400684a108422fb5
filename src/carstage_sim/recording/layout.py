"""The bytes of a log: packets, their records, strings. Little endian, packed, UE's units.

Locations and boxes are centimetres, rotations (roll, pitch, yaw) degrees, times seconds, linear
velocities metres per second. Source: CARLA's page "Recorder binary file format" and the record
types ``CarlaRecorder*.h`` of its plugin (0.9.13 to 0.9.16).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from carstage_sim.recording.errors import NotALogError

MAGIC: Final = "CARLA_RECORDER"
VERSION: Final = 1
"""Attribute types count from 0 in version 1, whatever the protocol."""

NO_ACTOR: Final = 0xFFFF_FFFF
"""The id of what a collision had with the town."""

UNKNOWN_DURATION_S: Final = -1.0
"""The duration of a log's last frame: no later one tells it."""


GAMMA: Final = 2.2
"""Colours of street lamps are linear in a log and sRGB for clients."""


class Packet(IntEnum):
    """Numbers of the packets. Readers skip what they do not know."""

    FRAME_START = 0
    FRAME_END = 1
    EVENT_ADD = 2
    EVENT_DEL = 3
    EVENT_PARENT = 4
    COLLISION = 5
    POSITION = 6
    STATE = 7
    ANIM_VEHICLE = 8
    ANIM_WALKER = 9
    VEHICLE_LIGHT = 10
    SCENE_LIGHT = 11
    KINEMATICS = 12
    BOUNDING_BOX = 13
    PLATFORM_TIME = 14
    PHYSICS_CONTROL = 15
    TRAFFIC_LIGHT_TIME = 16
    TRIGGER_VOLUME = 17
    FRAME_COUNTER = 18
    WALKER_BONES = 19
    VISUAL_TIME = 20
    VEHICLE_DOOR = 21
    ANIM_VEHICLE_WHEELS = 22
    ANIM_BIKER = 23
    WEATHER = 24


_ID = ("id", "<u4")
_BOX = [_ID, ("origin", "<f4", 3), ("extent", "<f4", 3)]

RECORDS: Final[dict[Packet, np.dtype[Any]]] = {
    packet: np.dtype(fields)  # type: ignore[call-overload]
    for packet, fields in {
        Packet.EVENT_DEL: [_ID],
        Packet.EVENT_PARENT: [_ID, ("parent", "<u4")],
        Packet.COLLISION: [_ID, ("first", "<u4"), ("second", "<u4"), ("first_is_hero", "?"),
                           ("second_is_hero", "?")],
        Packet.POSITION: [_ID, ("location", "<f4", 3), ("rotation", "<f4", 3)],
        Packet.STATE: [_ID, ("frozen", "?"), ("elapsed", "<f4"), ("state", "<u1")],
        Packet.ANIM_VEHICLE: [_ID, ("steer", "<f4"), ("throttle", "<f4"), ("brake", "<f4"),
                              ("hand_brake", "?"), ("gear", "<i4")],
        Packet.ANIM_WALKER: [_ID, ("speed", "<f4")],
        Packet.VEHICLE_LIGHT: [_ID, ("state", "<u4")],
        Packet.SCENE_LIGHT: [("id", "<i4"), ("intensity", "<f4"), ("colour", "<f4", 4),
                             ("on", "?"), ("type", "<u1")],
        Packet.KINEMATICS: [_ID, ("linear", "<f4", 3), ("angular", "<f4", 3)],
        Packet.BOUNDING_BOX: _BOX,
        Packet.TRIGGER_VOLUME: _BOX,
        Packet.TRAFFIC_LIGHT_TIME: [_ID, ("green", "<f4"), ("yellow", "<f4"), ("red", "<f4")],
        Packet.VEHICLE_DOOR: [_ID, ("door", "<u1"), ("open", "?")],
        Packet.WEATHER: [("values", "<f4", 14)],
    }.items()
}  # fmt: skip
"""The packets whose records all have one size: a 16-bit count, then the records."""

FRAME = struct.Struct("<Qdd")
"""Number, duration, elapsed time of a frame."""

HEADER = struct.Struct("<BI")
"""Number and size of a packet."""


def packet(kind: Packet, payload: bytes) -> bytes:
    """A packet with its header."""
    return HEADER.pack(kind, len(payload)) + payload


def records_packet(kind: Packet, records: NDArray[np.void]) -> bytes:
    """A packet of records of one size."""
    return packet(kind, struct.pack("<H", len(records)) + records.tobytes())


def rows_packet(kind: Packet, **columns: Any) -> bytes:
    """A packet of records, given by their columns."""
    count = len(next(iter(columns.values())))
    rows = np.zeros(count, RECORDS[kind])
    for name, column in columns.items():
        if count:
            rows[name] = column
    return records_packet(kind, rows)


def records(kind: Packet, payload: bytes) -> NDArray[np.void]:
    """The records of a packet; a count that promises more than there is counts what there is."""
    dtype = RECORDS[kind]
    (count,) = struct.unpack_from("<H", payload)
    whole = min(count, (len(payload) - 2) // dtype.itemsize)
    found: NDArray[np.void] = np.frombuffer(payload, dtype, whole, 2)
    return found


def text(value: str) -> bytes:
    """A string: a 16-bit count of bytes, then UTF-8, or the very bytes that a client sent."""
    encoded = value.encode(errors="surrogateescape")[:0xFFFF]
    return struct.pack("<H", len(encoded)) + encoded


class Cursor:
    """Reads values of changing size out of a packet, one after the other."""

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._at = 0

    def take(self, pattern: str) -> tuple[Any, ...]:
        """Values of a ``struct`` pattern.

        Raises:
            struct.error: the packet ends before.
        """
        values = struct.unpack_from(f"<{pattern}", self._payload, self._at)
        self._at += struct.calcsize(f"<{pattern}")
        return values

    def text(self) -> str:
        """A string."""
        (size,) = self.take("H")
        start, self._at = self._at, self._at + size
        return self._payload[start : self._at].decode(errors="replace")


@dataclass(frozen=True, slots=True)
class LogInfo:
    """The head of a log.

    Attributes:
        date: seconds since 1970; 0 where the writer keeps wall time out of its files.
        map_name: as the writing server names it to clients.
    """

    version: int
    date: int
    map_name: str

    def encode(self) -> bytes:
        """The bytes that a log begins with."""
        head = struct.pack("<H", self.version) + text(MAGIC)
        return head + struct.pack("<q", self.date) + text(self.map_name)

    @classmethod
    def read(cls, file: BinaryIO) -> LogInfo:
        """Read the head of a log.

        Raises:
            NotALogError: the file begins otherwise.
        """
        try:
            (version,) = struct.unpack("<H", file.read(2))
            magic = _read_text(file)
            if magic != MAGIC:
                raise NotALogError
            (date,) = struct.unpack("<q", file.read(8))
            return cls(version, date, _read_text(file))
        except (struct.error, UnicodeDecodeError) as error:
            raise NotALogError from error


def _read_text(file: BinaryIO) -> str:
    (size,) = struct.unpack("<H", file.read(2))
    return file.read(size).decode()
