"""Motorcycles, scooters and bicycles, each with its rider."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.figures import Build as Dress
from carstage_sim.content.figures import Pose, add_figure
from carstage_sim.content.lofting import Array, ShapeBuilder, uniform
from carstage_sim.content.vehicle_shapes import Build
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material

Vector = tuple[float, float, float]


def add_two_wheeler(
    builder: ShapeBuilder,
    build: Build,
    low: Vector,
    high: Vector,
    axles: tuple[float, float],
    wheel_radius: float,
) -> None:
    """Add a two-wheeler that fills the box from ``low`` to ``high`` (metres), rider included.

    Args:
        builder: its tag is the machine's; the rider is tagged as such.
        build: motorcycle, scooter or bicycle.
        low, high: corners of the box.
        axles: x of the front and the rear axle.
        wheel_radius: metres.
    """
    front, rear = axles
    if build is Build.SCOOTER:
        wheel_radius = min(wheel_radius, 0.24)
    reach = min(high[0] - front, rear - low[0])
    radius = min(wheel_radius, reach - 0.004) if reach > 0.15 else wheel_radius
    machine = {
        Build.BICYCLE: _add_bicycle,
        Build.MOTORCYCLE: _add_motorcycle,
        Build.SCOOTER: _add_scooter,
    }[build]
    seat, grip, peg = machine(builder, front, rear, radius, high)
    _add_rider(builder, build, low, high, seat, grip, peg)


def _wheel(
    builder: ShapeBuilder, x: float, radius: float, width: float, hub: float, rim: Material
) -> None:
    """A wheel in the middle plane: tyre, rim ring, hub and four pairs of spokes."""
    half = width / 2
    segments = 20
    inner = radius - width * 1.1
    ring = [
        (inner, -half * 0.6),
        (radius - half, -half),
        (radius, 0.0),
        (radius - half, half),
        (inner, half * 0.6),
        (inner - 0.012, 0.0),
        (inner, -half * 0.6),
    ]
    materials = uniform(Material.RUBBER, len(ring) - 1, segments)
    materials[4:] = rim
    builder.lathe((x, 0.0, radius), ring, materials, segments=segments)
    disc = [(0.001, -hub), (hub * 1.2, -hub * 0.7), (hub * 1.2, hub * 0.7), (0.001, hub)]
    builder.lathe((x, 0.0, radius), disc, uniform(Material.METAL, 3, segments), segments=segments)
    for k in range(8):
        a = np.pi * k / 4
        tip = (x + inner * np.cos(a), 0.0, radius + inner * np.sin(a))
        builder.limb([(x, 0.0, radius), tip], [0.006, 0.006], rim, sides=3)


def _tube(builder: ShapeBuilder, a: Vector, b: Vector, radius: float, material: Material) -> None:
    builder.limb([a, b], [radius, radius], material, sides=5)


def _add_bicycle(
    builder: ShapeBuilder, front: float, rear: float, radius: float, high: Vector
) -> tuple[Array, Array, Array]:
    """Frame of tubes; returns the saddle, the right grip and the pedals' axle."""
    for x in (front, rear):
        _wheel(builder, x, radius, 0.04, 0.03, Material.RIM)
    base = front - rear
    crank = (rear + 0.43 * base, 0.0, radius * 0.85)
    saddle = (rear + 0.24 * base, 0.0, radius * 2 + 0.20)
    head = (front - 0.20 * base, 0.0, radius * 2 + 0.16)
    neck = (front - 0.12 * base, 0.0, radius * 2 - 0.02)
    paint = Material.PAINT
    _tube(builder, crank, (saddle[0], 0.0, saddle[2] - 0.06), 0.017, paint)
    _tube(builder, crank, neck, 0.02, paint)
    _tube(builder, (saddle[0] + 0.02, 0.0, saddle[2] - 0.16), head, 0.016, paint)
    _tube(builder, head, neck, 0.02, paint)
    for sign in (-1.0, 1.0):
        y = sign * 0.04
        _tube(builder, (rear, y, radius), (crank[0], y * 0.5, crank[2]), 0.010, paint)
        _tube(
            builder, (rear, y, radius), (saddle[0] + 0.01, y * 0.3, saddle[2] - 0.14), 0.009, paint
        )
        _tube(builder, (front, y, radius), (neck[0], y * 0.6, neck[2]), 0.012, paint)
    builder.limb(
        [np.array(saddle) + np.array([x, 0.0, 0.0]) for x in (-0.12, 0.0, 0.14)],
        [0.07, 0.06, 0.02], Material.PLASTIC_DARK, sides=6, squash=0.5,
    )  # fmt: skip
    grip = min(0.26, high[1] - 0.02)
    bar = (head[0] + 0.02, 0.0, head[2] + 0.08)
    _tube(builder, head, bar, 0.014, Material.METAL)
    _tube(builder, (bar[0], -grip, bar[2]), (bar[0], grip, bar[2]), 0.013, Material.PLASTIC_DARK)
    builder.box(
        (rear - 0.02, -0.03, radius * 2 + 0.06), (rear, 0.03, radius * 2 + 0.10), Material.TAIL_LAMP
    )
    builder.box(
        (bar[0] + 0.03, -0.03, bar[2] - 0.1),
        (bar[0] + 0.06, 0.03, bar[2] - 0.04),
        Material.HEAD_LAMP,
    )
    return (
        np.array((saddle[0], 0.0, saddle[2] + 0.09)),
        np.array((bar[0], grip - 0.05, bar[2] + 0.02)),
        np.array(crank),
    )


def _add_motorcycle(
    builder: ShapeBuilder, front: float, rear: float, radius: float, high: Vector
) -> tuple[Array, Array, Array]:
    """Engine, tank, seat, fork and lamps; returns the seat, the right grip and the pegs."""
    for x in (front, rear):
        _wheel(builder, x, radius, 0.14, 0.07, Material.RIM)
    base = front - rear
    paint, dark, metal = Material.PAINT, Material.PLASTIC_DARK, Material.METAL
    middle = rear + 0.5 * base
    seat_z = radius * 2 + 0.08
    builder.limb(
        [
            (middle - 0.28 * base, 0, radius * 1.05),
            (middle - 0.1 * base, 0, radius * 1.15),
            (middle + 0.14 * base, 0, radius * 1.2),
            (middle + 0.24 * base, 0, radius * 1.4),
        ],
        [0.10, 0.17, 0.17, 0.09], metal, sides=8, squash=1.1,
    )  # fmt: skip
    builder.limb(
        [
            (middle - 0.04 * base, 0, seat_z + 0.02),
            (middle + 0.06 * base, 0, seat_z + 0.08),
            (middle + 0.20 * base, 0, seat_z + 0.10),
            (middle + 0.30 * base, 0, seat_z + 0.02),
        ],
        [0.08, 0.15, 0.16, 0.08], paint, sides=8, squash=0.8,
    )  # fmt: skip
    builder.limb(
        [
            (rear - 0.10 * base, 0, seat_z + 0.10),
            (rear + 0.12 * base, 0, seat_z + 0.04),
            (middle - 0.02 * base, 0, seat_z),
        ],
        [0.07, 0.13, 0.11], dark, sides=8, squash=0.5,
    )  # fmt: skip
    builder.limb(
        [
            (rear - 0.16 * base, 0, seat_z + 0.02),
            (rear + 0.1 * base, 0, seat_z - 0.04),
            (middle - 0.1 * base, 0, seat_z - 0.12),
        ],
        [0.05, 0.10, 0.12], paint, sides=8, squash=0.5,
    )  # fmt: skip
    steer = (front - 0.26 * base, 0.0, seat_z + 0.26)
    for sign in (-1.0, 1.0):
        y = sign * 0.10
        _tube(builder, (front, y, radius), (steer[0], y, steer[2]), 0.026, metal)
        _tube(builder, (rear, y, radius), (middle, y, radius * 1.1), 0.028, dark)
    builder.limb(
        [
            (front - 0.30 * base, 0, seat_z + 0.06),
            (front - 0.18 * base, 0, seat_z + 0.10),
            (front - 0.06 * base, 0, seat_z + 0.04),
        ],
        [0.14, 0.15, 0.07], paint, sides=8, squash=0.9,
    )  # fmt: skip
    grip = min(0.36, high[1] - 0.02)
    _tube(builder, (steer[0], -grip, steer[2]), (steer[0], grip, steer[2]), 0.016, dark)
    lamp = front - 0.045 * base
    builder.box(
        (lamp - 0.03, -0.07, seat_z - 0.02), (lamp + 0.01, 0.07, seat_z + 0.08), Material.HEAD_LAMP
    )
    tail = rear - 0.17 * base
    builder.box(
        (tail - 0.01, -0.06, seat_z - 0.01), (tail + 0.02, 0.06, seat_z + 0.05), Material.TAIL_LAMP
    )
    for sign, blinker in ((-1.0, Material.BLINKER_LEFT), (1.0, Material.BLINKER_RIGHT)):
        ends = sorted((sign * 0.10, sign * 0.14))
        builder.box((tail, ends[0], seat_z - 0.02), (tail + 0.03, ends[1], seat_z + 0.02), blinker)
    builder.limb(
        [(rear - 0.05, 0.15, radius * 0.9), (middle, 0.16, radius * 0.7)],
        [0.05, 0.035],
        metal,
        sides=6,
    )
    return (
        np.array((middle - 0.14 * base, 0.0, seat_z + 0.12)),
        np.array((steer[0], grip - 0.06, steer[2] + 0.02)),
        np.array((middle - 0.06 * base, 0.0, radius * 0.85)),
    )


def _add_scooter(
    builder: ShapeBuilder, front: float, rear: float, radius: float, high: Vector
) -> tuple[Array, Array, Array]:
    """Leg shield, floor and rear shell; returns the seat, the right grip and the floor."""
    for x in (front, rear):
        _wheel(builder, x, radius, 0.10, 0.06, Material.RIM)
    base = front - rear
    paint, dark = Material.PAINT, Material.PLASTIC_DARK
    seat_z = 0.74
    builder.limb(
        [
            (rear - 0.20, 0, radius + 0.18),
            (rear, 0, radius + 0.24),
            (rear + 0.28 * base, 0, radius + 0.22),
            (rear + 0.42 * base, 0, radius + 0.10),
        ],
        [0.08, 0.20, 0.20, 0.12], paint, sides=8, squash=1.0,
    )  # fmt: skip
    builder.box((rear + 0.3 * base, -0.17, 0.22), (front - 0.2 * base, 0.17, 0.28), dark)
    shield = front - 0.16 * base
    builder.limb(
        [(shield + 0.06, 0, 0.26), (shield, 0, 0.55), (shield - 0.08, 0, 0.92)],
        [0.14, 0.20, 0.13], paint, sides=8, squash=0.35,
    )  # fmt: skip
    builder.limb(
        [(rear - 0.12, 0, seat_z), (rear + 0.1, 0, seat_z + 0.02), (rear + 0.36 * base, 0, seat_z)],
        [0.09, 0.14, 0.09], dark, sides=8, squash=0.5,
    )  # fmt: skip
    builder.limb([(front, 0, radius), (shield, 0, 0.6)], [0.05, 0.06], paint, sides=6)
    grip = min(0.34, high[1] - 0.02)
    bar = (shield - 0.09, 0.0, 1.0)
    _tube(builder, (shield - 0.06, 0.0, 0.85), bar, 0.03, paint)
    _tube(builder, (bar[0], -grip, bar[2]), (bar[0], grip, bar[2]), 0.016, dark)
    builder.box((bar[0] + 0.02, -0.06, 0.95), (bar[0] + 0.07, 0.06, 1.05), Material.HEAD_LAMP)
    builder.box(
        (rear - 0.25, -0.06, radius + 0.2), (rear - 0.20, 0.06, radius + 0.28), Material.TAIL_LAMP
    )
    return (
        np.array((rear + 0.12 * base, 0.0, seat_z + 0.12)),
        np.array((bar[0], grip - 0.06, bar[2] + 0.02)),
        np.array((rear + 0.5 * base, 0.0, 0.34)),
    )


def _add_rider(
    builder: ShapeBuilder,
    build: Build,
    low: Vector,
    high: Vector,
    seat: Array,
    grip: Array,
    peg: Array,
) -> None:
    """A rider between seat, grips and pegs whose head touches the top of the box."""
    crown = high[2] - 0.012
    size = float(np.clip((crown - seat[2]) / 0.50, 1.35, 1.80))
    unit = size / 1.80
    lean = {Build.BICYCLE: 0.24, Build.MOTORCYCLE: 0.20, Build.SCOOTER: 0.04}[build]
    neck_z = crown - 0.27 * unit
    pelvis = seat
    neck = np.array([pelvis[0] + lean, 0.0, neck_z])
    head = np.array([neck[0] + 0.05, 0.0, crown - 0.125 * unit])
    half = min(0.17 * unit, high[1] - 0.06)
    sides: list[dict[str, Array]] = []
    for sign in (-1.0, 1.0):
        mirror = np.array([1.0, sign, 1.0])
        hip = pelvis + np.array([0.0, sign * 0.09 * unit, -0.02])
        down = sign < 0 or build is not Build.BICYCLE
        foot = peg + np.array([0.0, sign * 0.11, 0.0])
        foot[2] += 0.0 if build is not Build.BICYCLE else (-0.10 if down else 0.16)
        ankle = np.array([foot[0] - 0.04, foot[1], max(foot[2] + 0.07, 0.10)])
        knee = (hip + ankle) / 2 + np.array([0.24 * unit, sign * 0.05, 0.06 * unit])
        shoulder = neck + np.array([-0.01, sign * half, -0.07 * unit])
        hand = grip * mirror
        elbow = (shoulder + hand) / 2 + np.array([-0.05, sign * 0.05, -0.08]) * unit
        elbow[1] = np.clip(elbow[1], -high[1] + 0.05, high[1] - 0.05)
        toe = ankle + np.array([0.15 * unit, 0.0, -0.05])
        sides.append(
            {
                "hip": hip,
                "knee": knee,
                "ankle": ankle,
                "toe": toe,
                "shoulder": shoulder,
                "elbow": elbow,
                "hand": hand,
            }
        )
    joints = {key: (sides[0][key], sides[1][key]) for key in sides[0]}
    pose = Pose(pelvis=pelvis, neck=neck, head=head, **joints)
    helmet = Material.PLASTIC_DARK if build is not Build.BICYCLE else Material.SIGN_WHITE
    dress = Dress(
        size=size,
        width=min(0.22 * unit, high[1] * 0.9),
        depth=0.115 * unit,
        helmet=helmet,
        upper=Material.CLOTH_LOWER if build is Build.MOTORCYCLE else Material.CLOTH_UPPER,
    )
    add_figure(builder, pose, dress, CityObjectLabel.RIDER)
