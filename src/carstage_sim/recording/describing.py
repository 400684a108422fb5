"""One packet of a log in words, as ``show_recorder_file_info`` prints it."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from carstage_sim.recording import events
from carstage_sim.recording.layout import Packet, records

_LAMPS = (
    "Position", "LowBeam", "HighBeam", "Brake", "RightBlinker", "LeftBlinker", "Reverse", "Fog",
    "Interior", "Special1", "Special2",
)  # fmt: skip
_DOORS = {0: "Front Left", 1: "Front Right", 2: "Rear Left", 3: "Rear Right", 4: "Hood",
          5: "Trunk", 6: "All"}  # fmt: skip


def _point(values: Any) -> str:
    return "(" + ", ".join(f"{float(value):g}" for value in values) + ")"


def _added(payload: bytes) -> str:
    lines = []
    for actor in events.actors_added(payload):
        place = _point(events.ue_pose(actor.pose)[:3])
        lines.append(f" Create {actor.actor_id}: {actor.type_id} ({actor.kind}) at {place}\n")
        lines += [f"  {name} = {value}\n" for _, name, value in actor.attributes]
    return "".join(lines)


def _lines(kind: Packet, template: Callable[[Any], str], title: str = "") -> Callable[[bytes], str]:
    """Describes the records of a packet by one line each, below a title with their number."""

    def describe(payload: bytes) -> str:
        rows = records(kind, payload)
        head = f" {title}: {len(rows)}\n" if title else ""
        return head + "".join(f"{template(row)}\n" for row in rows)

    return describe


def _collision(row: Any) -> str:
    first = " (hero) " if row["first_is_hero"] else ""
    second = " (hero) " if row["second_is_hero"] else ""
    return f" Collision id {row['id']} between {row['first']}{first} with {row['second']}{second}"


def _lamps(row: Any) -> str:
    names = [name for bit, name in enumerate(_LAMPS) if int(row["state"]) >> bit & 1]
    return f"  Id: {row['id']} {' '.join(names) or 'None'}"


def _box(row: Any) -> str:
    return f"  Id: {row['id']} origin: {_point(row['origin'])} extension: {_point(row['extent'])}"


def _scene_light(row: Any) -> str:
    return (
        f"  Id: {row['id']} enabled: {bool(row['on'])} intensity: {row['intensity']:g} "
        f"RGB_color: {_point(row['colour'][:3])}"
    )


def _bones(payload: bytes) -> str:
    walkers = events.bones(payload)
    lines = [f" Walkers Bones: {len(walkers)}\n"]
    for actor_id, bones in walkers:
        lines.append(f"  Id: {actor_id}\n")
        for name, pose in bones:
            numbers = events.ue_pose(pose)
            place, turn = _point(numbers[:3]), _point(numbers[3:])
            lines.append(f'     Bone: "{name}" relative: Loc{place} Rot{turn}\n')
    return "".join([*lines, "\n"])


def _physics(payload: bytes) -> str:
    vehicles = events.physics(payload)
    lines = [f" Physics Control events: {len(vehicles)}\n"]
    names = (
        "max_rpm", "MOI", "damping_rate_full_throttle", "damping_rate_zero_throttle_clutch_engaged",
        "damping_rate_zero_throttle_clutch_disengaged", "use_gear_auto_box", "clutch_strength",
        "final_ratio", "mass", "drag_coefficient",
    )  # fmt: skip
    for vehicle in vehicles:
        lines.append(f"  Id: {vehicle.actor_id}\n")
        for name, value in zip(names, vehicle.numbers[:10], strict=True):
            shown = str(value).lower() if isinstance(value, bool) else f"{value:g}"
            lines.append(f"   {name} = {shown}\n")
        lines.append(f"   center_of_mass = {_point(vehicle.numbers[10:])}\n")
        for name, curve in (
            ("torque_curve", vehicle.torque_curve),
            ("steering_curve", vehicle.steering_curve),
        ):
            lines.append(f"   {name} = {' '.join(map(_point, curve))}\n")
        lines.append("   forward_gears:\n")
        lines += [
            f"    gear {number}: ratio {ratio:g} down_ratio {down:g} up_ratio {up:g}\n"
            for number, (ratio, down, up) in enumerate(vehicle.gears)
        ]
        lines.append("   wheels:\n")
        for number, wheel in enumerate(vehicle.wheels):
            friction, damping, steer, radius, brake, hand_brake, *_ = wheel
            lines.append(
                f"    wheel {number}: tire_friction {friction:g} damping_rate {damping:g} "
                f"max_steer_angle {steer:g} radius {radius:g} max_brake_torque {brake:g} "
                f"max_handbrake_torque {hand_brake:g} position {_point(wheel[-3:])}\n"
            )
    return "".join(lines)


EVENTS: dict[int, Callable[[bytes], str]] = {
    Packet.EVENT_ADD: _added,
    Packet.EVENT_DEL: _lines(Packet.EVENT_DEL, lambda row: f" Destroy {row['id']}"),
    Packet.EVENT_PARENT: _lines(
        Packet.EVENT_PARENT, lambda row: f" Parenting {row['id']} with {row['parent']} (parent)"
    ),
    Packet.COLLISION: _lines(Packet.COLLISION, _collision),
}
"""What is always reported; an empty text reports nothing."""

STATES: dict[int, Callable[[bytes], str]] = {
    Packet.POSITION: _lines(
        Packet.POSITION,
        lambda row: (
            f"  Id: {row['id']} Location: {_point(row['location'])} "
            f"Rotation: {_point(row['rotation'])}"
        ),
        "Positions",
    ),
    Packet.STATE: _lines(
        Packet.STATE,
        lambda row: (
            f"  Id: {row['id']} state: {row['state']} frozen: {int(row['frozen'])} "
            f"elapsedTime: {row['elapsed']:g}"
        ),
        "State traffic lights",
    ),
    Packet.ANIM_VEHICLE: _lines(
        Packet.ANIM_VEHICLE,
        lambda row: (
            f"  Id: {row['id']} Steering: {row['steer']:g} Throttle: {row['throttle']:g} "
            f"Brake: {row['brake']:g} Handbrake: {int(row['hand_brake'])} Gear: {row['gear']}"
        ),
        "Vehicle animations",
    ),
    Packet.ANIM_WALKER: _lines(
        Packet.ANIM_WALKER,
        lambda row: f"  Id: {row['id']} speed: {row['speed']:g}",
        "Walker animations",
    ),
    Packet.VEHICLE_DOOR: _lines(
        Packet.VEHICLE_DOOR,
        lambda row: f"  Id: {row['id']}\n  Doors opened:  {_DOORS.get(int(row['door']), '?')} ",
        "Vehicle door animations",
    ),
    Packet.VEHICLE_LIGHT: _lines(Packet.VEHICLE_LIGHT, _lamps, "Vehicle light animations"),
    Packet.SCENE_LIGHT: _lines(Packet.SCENE_LIGHT, _scene_light, "Scene light changes"),
    Packet.KINEMATICS: _lines(
        Packet.KINEMATICS,
        lambda row: (
            f"  Id: {row['id']} linear_velocity: {_point(row['linear'])} "
            f"angular_velocity: {_point(row['angular'])}"
        ),
        "Dynamic actors",
    ),
    Packet.BOUNDING_BOX: _lines(Packet.BOUNDING_BOX, _box, "Actor bounding boxes"),
    Packet.TRIGGER_VOLUME: _lines(Packet.TRIGGER_VOLUME, _box, "Actor trigger volumes"),
    Packet.PLATFORM_TIME: lambda payload: (
        f" Current platform time: {struct.unpack('<d', payload)[0]:g}\n"
    ),
    Packet.PHYSICS_CONTROL: _physics,
    Packet.TRAFFIC_LIGHT_TIME: _lines(
        Packet.TRAFFIC_LIGHT_TIME,
        lambda row: (
            f"  Id: {row['id']} green_time: {row['green']:g} yellow_time: {row['yellow']:g} "
            f"red_time: {row['red']:g}"
        ),
        "Traffic Light time events",
    ),
    Packet.WALKER_BONES: _bones,
}
"""What is reported when everything is asked for."""
