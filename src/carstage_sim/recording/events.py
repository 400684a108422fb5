"""Records of changing size: an actor that comes, wheels, physics, bones."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from carstage_sim.recording.layout import Cursor, Packet, packet, text
from carstage_sim.world.pose import Pose, Vector3
from carstage_sim.world.vehicles.parameters import VehicleParameters

CM_PER_M = 100.0


@dataclass(frozen=True, slots=True)
class ActorAdded:
    """An actor that the log knows from this frame on.

    Attributes:
        kind: CARLA's actor type: other, vehicle, walker, traffic light, traffic sign, sensor.
        pose: in the world, or in the parent's frame where the frame tells its parent too.
        attributes: type, name and value; types count from 0.
    """

    actor_id: int
    kind: int
    pose: Pose
    uid: int
    type_id: str
    attributes: tuple[tuple[int, str, str], ...]

    @property
    def is_hero(self) -> bool:
        """Whether this is the ego vehicle, which a replay may leave out."""
        return any(name == "role_name" and value == "hero" for _, name, value in self.attributes)

    def encode(self) -> bytes:
        """The record."""
        head = struct.pack("<IB6fI", self.actor_id, self.kind, *ue_pose(self.pose), self.uid)
        parts = [head, text(self.type_id), struct.pack("<H", len(self.attributes))]
        for kind, name, value in self.attributes:
            parts += [struct.pack("<B", kind), text(name), text(value)]
        return b"".join(parts)

    @classmethod
    def decode(cls, cursor: Cursor) -> ActorAdded:
        """Read a record."""
        actor_id, kind, *numbers, uid = cursor.take("IB6fI")
        type_id = cursor.text()
        (count,) = cursor.take("H")
        attributes = tuple(
            (int(cursor.take("B")[0]), cursor.text(), cursor.text()) for _ in range(count)
        )
        return cls(actor_id, kind, pose_of_ue(numbers), uid, type_id, attributes)


def actors_added(payload: bytes) -> list[ActorAdded]:
    """The records of an ``EVENT_ADD`` packet."""
    cursor = Cursor(payload)
    (count,) = cursor.take("H")
    return [ActorAdded.decode(cursor) for _ in range(count)]


def actors_added_packet(actors: Sequence[ActorAdded]) -> bytes:
    """An ``EVENT_ADD`` packet."""
    return _packet(Packet.EVENT_ADD, [actor.encode() for actor in actors])


def ue_pose(pose: Pose) -> tuple[float, ...]:
    """Location in centimetres, then roll, pitch, yaw: UE's ``FQuat::Euler`` has x, y, z."""
    x, y, z = pose.location
    pitch, yaw, roll = pose.rotation_deg
    return (x * CM_PER_M, y * CM_PER_M, z * CM_PER_M, roll, pitch, yaw)


def pose_of_ue(numbers: Sequence[float]) -> Pose:
    """The pose of :func:`ue_pose`'s numbers."""
    x, y, z, roll, pitch, yaw = (float(number) for number in numbers)
    return Pose((x / CM_PER_M, y / CM_PER_M, z / CM_PER_M), (pitch, yaw, roll))


@dataclass(frozen=True, slots=True)
class WheelPose:
    """How a wheel is seen: number, steering angle and rolled angle in degrees."""

    number: int
    steer_deg: float
    rolled_deg: float


def wheels_packet(vehicles: Iterable[tuple[int, Sequence[WheelPose]]]) -> bytes:
    """An ``ANIM_VEHICLE_WHEELS`` packet of actor ids and their wheels."""
    return _packet(
        Packet.ANIM_VEHICLE_WHEELS,
        [
            struct.pack("<II", actor_id, len(wheels))
            + b"".join(struct.pack("<Bff", w.number, w.steer_deg, w.rolled_deg) for w in wheels)
            for actor_id, wheels in vehicles
        ],
    )


def wheels(payload: bytes) -> list[tuple[int, list[WheelPose]]]:
    """Actor ids and wheels of an ``ANIM_VEHICLE_WHEELS`` packet."""
    cursor = Cursor(payload)
    (count,) = cursor.take("H")
    found = []
    for _ in range(count):
        actor_id, wheel_count = cursor.take("II")
        found.append((actor_id, [WheelPose(*cursor.take("Bff")) for _ in range(wheel_count)]))
    return found


def bones_packet(walkers: Sequence[tuple[int, Sequence[tuple[str, Pose]]]]) -> bytes:
    """A ``WALKER_BONES`` packet: actor ids, and names and relative poses of their bones."""
    return _packet(
        Packet.WALKER_BONES,
        [
            struct.pack("<IH", actor_id, len(bones))
            + b"".join(text(name) + struct.pack("<6f", *ue_pose(pose)) for name, pose in bones)
            for actor_id, bones in walkers
        ],
    )


def bones(payload: bytes) -> list[tuple[int, list[tuple[str, Pose]]]]:
    """Actor ids and bones of a ``WALKER_BONES`` packet."""
    cursor = Cursor(payload)
    (count,) = cursor.take("H")
    found = []
    for _ in range(count):
        actor_id, bone_count = cursor.take("IH")
        found.append(
            (
                int(actor_id),
                [(cursor.text(), pose_of_ue(cursor.take("6f"))) for _ in range(bone_count)],
            )
        )
    return found


@dataclass(frozen=True, slots=True)
class PhysicsRecord:
    """A vehicle's physics as a log has it: ``carla.VehiclePhysicsControl`` without two fields.

    Attributes:
        numbers: max_rpm, moi, the three damping rates, use_gear_autobox, clutch_strength,
            final_ratio, mass, drag_coefficient, then the centre of mass.
        torque_curve, steering_curve: points.
        gears: ratio, down_ratio, up_ratio of each.
        wheels: friction, damping, max steer angle, radius (cm), brake and hand brake torque, the
            three stiffness values, position (cm).
    """

    actor_id: int
    numbers: tuple[float, ...]
    torque_curve: tuple[tuple[float, ...], ...]
    gears: tuple[tuple[float, ...], ...]
    steering_curve: tuple[tuple[float, ...], ...]
    wheels: tuple[tuple[float, ...], ...]

    @classmethod
    def of(
        cls, actor_id: int, p: VehicleParameters, wheel_positions_m: Sequence[Vector3]
    ) -> PhysicsRecord:
        """The record of a vehicle whose wheels are at these places of the world."""
        return cls(
            actor_id,
            (p.max_rpm, p.moi, p.damping_rate_full_throttle,
             p.damping_rate_zero_throttle_clutch_engaged,
             p.damping_rate_zero_throttle_clutch_disengaged, p.use_gear_autobox,
             p.clutch_strength, p.final_ratio, p.mass_kg, p.drag_coefficient, *p.center_of_mass),
            p.torque_curve,
            tuple((gear.ratio, gear.down_ratio, gear.up_ratio) for gear in p.forward_gears),
            p.steering_curve,
            tuple(
                (w.tire_friction, w.damping_rate, w.max_steer_angle_deg, w.radius_m * CM_PER_M,
                 w.max_brake_torque, w.max_handbrake_torque, w.lat_stiff_max_load,
                 w.lat_stiff_value, w.long_stiff_value, *(np.array(place) * CM_PER_M).tolist())
                for w, place in zip(p.wheels, wheel_positions_m, strict=True)
            ),
        )  # fmt: skip

    def encode(self) -> bytes:
        """The record's bytes."""
        head = struct.pack("<I", self.actor_id) + struct.pack("<5f?4f3f", *self.numbers)
        return head + b"".join(
            struct.pack("<I", len(rows)) + b"".join(struct.pack(f"<{len(r)}f", *r) for r in rows)
            for rows in (self.torque_curve, self.gears, self.steering_curve, self.wheels)
        )

    @classmethod
    def decode(cls, cursor: Cursor) -> PhysicsRecord:
        """Read a record."""
        (actor_id,) = cursor.take("I")
        numbers = cursor.take("5f?4f3f")
        tables = []
        for width in (2, 3, 2, 12):
            (count,) = cursor.take("I")
            tables.append(tuple(cursor.take(f"{width}f") for _ in range(count)))
        return cls(actor_id, numbers, *tables)


def physics_packet(vehicles: Sequence[PhysicsRecord]) -> bytes:
    """A ``PHYSICS_CONTROL`` packet."""
    return _packet(Packet.PHYSICS_CONTROL, [vehicle.encode() for vehicle in vehicles])


def physics(payload: bytes) -> list[PhysicsRecord]:
    """The records of a ``PHYSICS_CONTROL`` packet."""
    cursor = Cursor(payload)
    (count,) = cursor.take("H")
    return [PhysicsRecord.decode(cursor) for _ in range(count)]


def _packet(kind: Packet, encoded: Sequence[bytes]) -> bytes:
    return packet(kind, struct.pack("<H", len(encoded)) + b"".join(encoded))
