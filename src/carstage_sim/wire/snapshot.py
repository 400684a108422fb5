"""The world-observer message: one fixed-size record per actor, filled column by column."""

from __future__ import annotations

import struct

import numpy as np

from carstage_sim.wire.dialect import Dialect
from carstage_sim.wire.payloads import sensor_header
from carstage_sim.world.pose import Pose
from carstage_sim.world.snapshot import Snapshot

_EPISODE = struct.Struct("<Qdf3iI")
_MAP_CHANGE = 1
_PENDING_LIGHT_UPDATE = 2
_ACTIVE = 1
_UNION_BYTES = 54

RECORD = np.dtype(
    [
        ("actor_id", "<u4"),
        ("actor_state", "u1"),
        ("location", "<f4", (3,)),
        ("rotation_deg", "<f4", (3,)),
        ("velocity", "<f4", (3,)),
        ("angular_velocity_deg", "<f4", (3,)),
        ("acceleration", "<f4", (3,)),
        ("union", f"V{_UNION_BYTES}"),
    ]
)
"""``ActorDynamicState``, 119 bytes, packed; the union's layout depends on the kind of actor."""

VEHICLE = np.dtype(
    [
        ("control", "<f4", (3,)),
        ("hand_brake", "u1"),
        ("reverse", "u1"),
        ("manual_gear_shift", "u1"),
        ("gear", "<i4"),
        ("speed_limit_kmh", "<f4"),
        ("light_state", "u1"),
        ("has_light", "u1"),
        ("light_id", "<u4"),
        ("failure", "u1"),
        ("padding", f"V{_UNION_BYTES - 30}"),
    ]
)
"""The union of a vehicle; to clients of 0.9.13 ``failure`` is padding, which they do not read."""

WALKER = np.dtype(
    [
        ("direction", "<f4", (3,)),
        ("speed", "<f4"),
        ("jump", "u1"),
        ("padding", f"V{_UNION_BYTES - 17}"),
    ]
)
"""The union of a walker."""

TRAFFIC_LIGHT = np.dtype(
    [
        ("sign_id", "S32"),
        ("green_s", "<f4"),
        ("yellow_s", "<f4"),
        ("red_s", "<f4"),
        ("elapsed_s", "<f4"),
        ("pole_index", "<u4"),
        ("frozen", "u1"),
        ("state", "u1"),
    ]
)
"""The union of a traffic light."""


def encode_snapshot(snapshot: Snapshot, dialect: Dialect, platform_timestamp_s: float) -> bytes:
    """The payload of one world-observer message.

    Args:
        snapshot: the frame.
        dialect: gives the message's type number.
        platform_timestamp_s: wall clock of the server; the only part that no replay repeats.
    """
    state = snapshot.state
    records = np.zeros(len(state.actor_id), RECORD)
    records["actor_state"] = _ACTIVE
    for name in RECORD.names or ():
        if name not in ("actor_state", "union"):
            records[name] = getattr(state, name)
    _fill_vehicles(records, snapshot)
    _fill_walkers(records, snapshot)
    _fill_traffic_lights(records, snapshot)
    _fill_traffic_signs(records, snapshot)
    header = sensor_header(dialect.world_observer, state.frame, state.timestamp_s, Pose())
    episode = _EPISODE.pack(
        snapshot.episode_id,
        platform_timestamp_s,
        state.delta_s,
        0,
        0,
        0,
        _simulation_state(snapshot, dialect),
    )
    return header + episode + records.tobytes()


def _simulation_state(snapshot: Snapshot, dialect: Dialect) -> int:
    """Bits that make clients fetch the map, or the street lights, again."""
    lights = snapshot.lights_changed and dialect.rereads_lights
    return (_MAP_CHANGE if snapshot.map_changed else 0) | (_PENDING_LIGHT_UPDATE if lights else 0)


def _fill_vehicles(records: np.ndarray[tuple[int], np.dtype[np.void]], snapshot: Snapshot) -> None:
    columns = snapshot.vehicles
    union = np.zeros(len(columns.rows), VEHICLE)
    for name in (
        "control",
        "hand_brake",
        "reverse",
        "manual_gear_shift",
        "gear",
        "speed_limit_kmh",
        "light_state",
        "light_id",
    ):
        union[name] = getattr(columns, name)
    union["has_light"] = columns.light_id != 0
    records["union"][columns.rows] = union.view(f"V{_UNION_BYTES}")


def _fill_walkers(records: np.ndarray[tuple[int], np.dtype[np.void]], snapshot: Snapshot) -> None:
    columns = snapshot.walkers
    union = np.zeros(len(columns.rows), WALKER)
    for name in ("direction", "speed", "jump"):
        union[name] = getattr(columns, name)
    records["union"][columns.rows] = union.view(f"V{_UNION_BYTES}")


def _fill_traffic_signs(
    records: np.ndarray[tuple[int], np.dtype[np.void]], snapshot: Snapshot
) -> None:
    columns = snapshot.traffic_signs
    if columns is not None:
        # A sign's union is the first field of a light's.
        union = np.zeros(len(columns.rows), TRAFFIC_LIGHT)
        union["sign_id"] = [sign_id.encode() for sign_id in columns.sign_id]
        records["union"][columns.rows] = union.view(f"V{_UNION_BYTES}")


def _fill_traffic_lights(
    records: np.ndarray[tuple[int], np.dtype[np.void]], snapshot: Snapshot
) -> None:
    columns = snapshot.traffic_lights
    union = np.zeros(len(columns.rows), TRAFFIC_LIGHT)
    union["sign_id"] = [sign_id.encode() for sign_id in columns.sign_id]
    for name in (
        "green_s",
        "yellow_s",
        "red_s",
        "elapsed_s",
        "pole_index",
        "frozen",
        "state",
    ):
        union[name] = getattr(columns, name)
    records["union"][columns.rows] = union.view(f"V{_UNION_BYTES}")
