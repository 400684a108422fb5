from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.wire.dialect import dialect
from carstage_sim.wire.snapshot import RECORD, TRAFFIC_LIGHT, VEHICLE, WALKER, encode_snapshot
from carstage_sim.world.snapshot import (
    Snapshot,
    TrafficLightColumns,
    VehicleColumns,
    WalkerColumns,
)
from carstage_sim.world.state import ActorKind, Weather, WorldState

HEADER_BYTES = 48
EPISODE_BYTES = 36
RECORD_BYTES = 119
UNION = 65


@pytest.mark.parametrize(
    ("dtype", "offsets"),
    [
        (
            RECORD,
            {
                "actor_id": 0,
                "actor_state": 4,
                "location": 5,
                "rotation_deg": 17,
                "velocity": 29,
                "angular_velocity_deg": 41,
                "acceleration": 53,
                "union": 65,
            },
        ),
        (
            VEHICLE,
            {
                "control": 0,
                "hand_brake": 12,
                "reverse": 13,
                "manual_gear_shift": 14,
                "gear": 15,
                "speed_limit_kmh": 19,
                "light_state": 23,
                "has_light": 24,
                "light_id": 25,
                "failure": 29,
            },
        ),
        (WALKER, {"direction": 0, "speed": 12, "jump": 16}),
        (
            TRAFFIC_LIGHT,
            {
                "sign_id": 0,
                "green_s": 32,
                "yellow_s": 36,
                "red_s": 40,
                "elapsed_s": 44,
                "pole_index": 48,
                "frozen": 52,
                "state": 53,
            },
        ),
    ],
)
def test_fields_stand_at_the_offsets_of_the_protocol(
    dtype: np.dtype[np.void], offsets: dict[str, int]
) -> None:
    assert dtype.fields is not None
    assert {name: dtype.fields[name][1] for name in offsets} == offsets
    assert dtype.itemsize == (RECORD_BYTES if dtype is RECORD else RECORD_BYTES - UNION)


def three_actors() -> Snapshot:
    """A light (id 1), a vehicle (id 5) and a walker (id 9), each with its own numbers."""
    rows = np.arange(9.0).reshape(3, 3)
    state = WorldState(
        frame=77,
        timestamp_s=3.85,
        delta_s=0.05,
        weather=Weather(),
        actor_id=np.array([1, 5, 9], np.uint32),
        kind=np.array([ActorKind.TRAFFIC_LIGHT, ActorKind.VEHICLE, ActorKind.WALKER], np.uint8),
        type_id=("traffic.traffic_light", "vehicle.tesla.model3", "walker.pedestrian.0001"),
        location=rows,
        rotation_deg=rows + 10.0,
        velocity=rows + 20.0,
        angular_velocity_deg=rows + 30.0,
        acceleration=rows + 40.0,
        light_state=np.zeros(3, np.uint32),
        control=np.zeros((3, 3), np.float32),
        colour=np.zeros((3, 3), np.uint8),
        wheel_angle_deg=np.zeros(3, np.float32),
        rolled_m=np.zeros(3),
    )
    return Snapshot(
        episode_id=4,
        map_changed=True,
        state=state,
        vehicles=VehicleColumns(
            rows=np.array([1]),
            control=np.array([[0.25, -0.5, 0.75]], np.float32),
            hand_brake=np.array([True]),
            reverse=np.array([False]),
            manual_gear_shift=np.array([True]),
            gear=np.array([-1], np.int32),
            speed_limit_kmh=np.array([50.0], np.float32),
            light_id=np.array([1], np.uint32),
            light_state=np.array([0], np.uint8),
        ),
        walkers=WalkerColumns(
            rows=np.array([2]),
            direction=np.array([[0.0, 1.0, 0.0]], np.float32),
            speed=np.array([1.5], np.float32),
            jump=np.array([True]),
        ),
        traffic_lights=TrafficLightColumns(
            rows=np.array([0]),
            sign_id=("10072",),
            green_s=np.array([10.0], np.float32),
            yellow_s=np.array([3.0], np.float32),
            red_s=np.array([2.0], np.float32),
            elapsed_s=np.array([1.25], np.float32),
            pole_index=np.array([2], np.uint32),
            frozen=np.array([True]),
            state=np.array([1], np.uint8),
        ),
    )


@pytest.fixture
def message() -> bytes:
    return encode_snapshot(three_actors(), dialect("0.9.16"), platform_timestamp_s=123.5)


def test_message_begins_with_type_frame_and_time(message: bytes) -> None:
    assert struct.unpack_from("<QQd", message) == (17, 77, 3.85)
    assert len(message) == HEADER_BYTES + EPISODE_BYTES + 3 * RECORD_BYTES


def test_episode_header_carries_the_step_and_the_change_of_map(message: bytes) -> None:
    episode, wall, delta, x, y, z, flags = struct.unpack_from("<Qdf3iI", message, HEADER_BYTES)
    assert (episode, wall, (x, y, z), flags) == (4, 123.5, (0, 0, 0), 1)
    assert delta == np.float32(0.05)


def record(message: bytes, row: int) -> bytes:
    begin = HEADER_BYTES + EPISODE_BYTES + row * RECORD_BYTES
    return message[begin : begin + RECORD_BYTES]


@pytest.mark.parametrize(("row", "actor_id"), [(0, 1), (1, 5), (2, 9)])
def test_record_holds_the_motion_of_its_actor(message: bytes, row: int, actor_id: int) -> None:
    expected = [3.0 * row + column for column in range(3)]
    values = struct.unpack_from("<IB15f", record(message, row))
    assert values[:2] == (actor_id, 1)
    motion = [number + offset for offset in (0, 10, 20, 30, 40) for number in expected]
    assert list(values[2:]) == motion


def test_vehicle_union_is_decoded_by_hand(message: bytes) -> None:
    union = record(message, 1)[UNION:]
    assert struct.unpack("<fff???ifB?IB24x", union) == (
        *(0.25, -0.5, 0.75),
        *(True, False, True),
        *(-1, 50.0, 0, True, 1, 0),
    )


def test_walker_union_is_decoded_by_hand(message: bytes) -> None:
    union = record(message, 2)[UNION:]
    assert struct.unpack("<ffff?37x", union) == (0.0, 1.0, 0.0, 1.5, True)


def test_traffic_light_union_is_decoded_by_hand(message: bytes) -> None:
    union = record(message, 0)[UNION:]
    sign_id, *rest = struct.unpack("<32sffffI?B", union)
    assert sign_id.rstrip(b"\0") == b"10072"
    assert rest == [10.0, 3.0, 2.0, 1.25, 2, True, 1]


@pytest.mark.parametrize(("version", "told"), [("0.9.13", 0), ("0.9.14", 2), ("0.9.16", 2)])
def test_switched_street_lights_are_told_to_clients_that_may_ask_again(
    version: str, told: int
) -> None:
    switched = replace(three_actors(), map_changed=False, lights_changed=True)
    payload = encode_snapshot(switched, dialect(version), platform_timestamp_s=0.0)
    *_, flags = struct.unpack_from("<Qdf3iI", payload, HEADER_BYTES)
    assert flags == told
