"""Motorcycles, scooters and bicycles, each with its rider."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from carstage_sim.content.lofting import Array, ShapeBuilder, uniform
from carstage_sim.content.riders import BICYCLES, add_rider
from carstage_sim.content.vehicle_shapes import Build
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
        build: motorcycle, cruiser, scooter, bicycle or city bike.
        low, high: corners of the box.
        axles: x of the front and the rear axle.
        wheel_radius: metres.
    """
    front, rear = axles
    if build in BICYCLES:
        # Wheels of a bicycle reach to both ends, wherever its axles are said to be.
        radius = min(wheel_radius, 0.215 * (high[0] - low[0]))
        front, rear = high[0] - radius - 0.004, low[0] + radius + 0.004
    else:
        if build is Build.SCOOTER:
            wheel_radius = min(wheel_radius, 0.24)
        reach = min(high[0] - front, front, rear - low[0])
        radius = min(wheel_radius, reach - 0.004) if reach > 0.15 else wheel_radius
    machine = {
        Build.BICYCLE: _add_bicycle,
        Build.CITY_BIKE: _add_city_bike,
        Build.MOTORCYCLE: _add_motorcycle,
        Build.CRUISER: _add_cruiser,
        Build.SCOOTER: _add_scooter,
    }[build]
    seat, grip, peg = machine(builder, front, rear, radius, low, high)
    if build not in BICYCLES:
        _add_mirrors(builder, grip, high[1])
        _add_tail(builder, low[0], rear, seat[2] - 0.20)
    add_rider(builder, build, low, high, seat, grip, peg)


def _add_mirrors(builder: ShapeBuilder, grip: Array, reach: float) -> None:
    """Mirrors on stalks, out to the box's sides."""
    for sign in (-1.0, 1.0):
        foot = (grip[0] + 0.02, sign * grip[1] * 0.75, grip[2])
        head = (grip[0] + 0.07, sign * (reach - 0.07), grip[2] + 0.17)
        _tube(builder, foot, head, 0.007, Material.PLASTIC_DARK)
        tip = (grip[0] + 0.07, sign * (reach - 0.002), grip[2] + 0.18)
        inner = (grip[0] + 0.07, sign * (reach - 0.13), grip[2] + 0.17)
        middle = tuple((np.array(inner) + np.array(tip)) / 2)
        builder.limb([inner, middle, tip], [0.022, 0.042, 0.018], Material.PLASTIC_DARK, sides=7)


def _add_tail(builder: ShapeBuilder, end: float, rear: float, z: float) -> None:
    """A mudguard with the number plate, to the box's rear end."""
    x = end + 0.004
    _tube(builder, (rear + 0.05, 0.0, z), (x + 0.03, 0.0, z - 0.10), 0.022, Material.PLASTIC_DARK)
    builder.box((x, -0.09, z - 0.22), (x + 0.012, 0.09, z - 0.07), Material.LICENCE_PLATE)
    for k in range(3):
        y = -0.055 + 0.045 * k
        builder.box((x - 0.003, y, z - 0.18), (x, y + 0.025, z - 0.11), Material.PAINT_BLACK)


def _ring(builder: ShapeBuilder, x: float, radius: float, width: float, rim: Material) -> float:
    """Tyre and rim of a wheel in the middle plane; the rim's inner radius."""
    half = width / 2
    segments = 24
    inner = radius - width * 1.1
    ring = [
        (inner, -half * 0.6),
        (radius - half, -half),
        (radius, 0.0),
        (radius - half, half),
        (inner, half * 0.6),
        (inner - 0.014, 0.0),
        (inner, -half * 0.6),
    ]
    materials = uniform(Material.RUBBER, len(ring) - 1, segments)
    materials[4:] = rim
    builder.lathe((x, 0.0, radius), ring, materials, segments=segments)
    return inner


def _spoked_wheel(builder: ShapeBuilder, x: float, radius: float, width: float) -> None:
    """A wheel with thin spokes that leave a hub to both sides."""
    inner = _ring(builder, x, radius, width, Material.RIM)
    hub = [(0.001, -0.045), (0.022, -0.04), (0.022, 0.04), (0.001, 0.045)]
    builder.lathe((x, 0.0, radius), hub, uniform(Material.METAL, 3, 8), segments=8)
    for k in range(18):
        a = 2 * np.pi * k / 18
        tip = (x + inner * np.cos(a), 0.0, radius + inner * np.sin(a))
        # Spokes cross: they leave the hub aside of where they go.
        b = a + (0.9 if k % 4 < 2 else -0.9)
        foot = (x + 0.02 * np.cos(b), 0.035 * (-1) ** k, radius + 0.02 * np.sin(b))
        builder.limb([foot, tip], [0.0035, 0.0035], Material.RIM, sides=3)


def _cast_wheel(
    builder: ShapeBuilder, x: float, radius: float, width: float, rim: Material
) -> None:
    """A wheel with five cast spokes and a brake disc."""
    inner = _ring(builder, x, radius, width, rim)
    hub = [(0.001, -0.08), (0.05, -0.07), (0.05, 0.07), (0.001, 0.08)]
    builder.lathe((x, 0.0, radius), hub, uniform(Material.METAL, 3, 10), segments=10)
    for y in (-0.075, 0.075):
        disc = [(inner * 0.35, y - 0.004), (inner * 0.72, y - 0.004), (inner * 0.72, y + 0.004),
                (inner * 0.35, y + 0.004)]  # fmt: skip
        builder.lathe((x, 0.0, radius), disc, uniform(Material.METAL, 3, 16), segments=16)
    for k in range(5):
        a = 2 * np.pi * (k + 0.25) / 5
        way = np.array([np.cos(a), 0.0, np.sin(a)])
        ends = np.array([x, 0.0, radius]) + way * np.array([[0.03], [inner * 1.01]])
        builder.limb(ends, [0.030, 0.022], rim, sides=4)


def _at(x: float, y: float, z: float) -> Array:
    return np.array([x, y, z])


def _tube(
    builder: ShapeBuilder, a: ArrayLike, b: ArrayLike, radius: float, material: Material
) -> None:
    builder.limb(np.array([a, b], np.float64), [radius, radius], material, sides=6)


def _mudguard(
    builder: ShapeBuilder, x: float, radius: float, wide: float, turn: tuple[float, float],
    material: Material,
) -> None:  # fmt: skip
    """A strip around the upper part of a wheel, between two angles from the front (degrees)."""
    angle = np.radians(np.linspace(*turn, 9))
    away = radius + 0.022
    rows = []
    for y, less in ((-1.0, 0.012), (-0.6, 0.0), (0.6, 0.0), (1.0, 0.012)):
        rows.append(
            np.stack(
                [
                    x + (away - less) * np.cos(angle),
                    np.full_like(angle, y * wide / 2),
                    radius + (away - less) * np.sin(angle),
                ],
                axis=-1,
            )
        )
    builder.grid(np.stack(rows), material)


def _lamp(builder: ShapeBuilder, x: float, z: float, radius: float) -> None:
    """A round head lamp that looks ahead."""
    builder.limb(
        [(x - 0.10, 0, z), (x - 0.05, 0, z), (x, 0, z)], [radius * 0.5, radius, radius * 1.04],
        Material.RIM, sides=12,
    )  # fmt: skip
    builder.limb(
        [(x - 0.01, 0, z), (x + 0.012, 0, z)], [radius * 0.92, radius * 0.86], Material.HEAD_LAMP,
        sides=12,
    )  # fmt: skip


def _add_frame(
    builder: ShapeBuilder, front: float, rear: float, radius: float, high: Vector, *, low_step: bool
) -> tuple[Array, Array, Array]:
    """Wheels, tubes, drive and saddle of a bicycle; saddle, head of the fork, pedals' axle."""
    for x in (front, rear):
        with builder.wheel():
            _spoked_wheel(builder, x, radius, 0.042)
    base = front - rear
    paint, metal, dark = Material.PAINT, Material.METAL, Material.PLASTIC_DARK
    crank = _at(rear + 0.43 * base, 0.0, radius * 0.85)
    saddle = _at(rear + 0.22 * base, 0.0, radius * 2 + 0.22)
    head = _at(front - 0.20 * base, 0.0, radius * 2 + 0.17)
    neck = _at(front - 0.13 * base, 0.0, radius * 2 + 0.01)
    seat_tube = saddle - _at(-0.03, 0.0, 0.15)
    _tube(builder, crank, seat_tube, 0.019, paint)
    _tube(builder, seat_tube, saddle - _at(0.0, 0.0, 0.03), 0.014, metal)
    _tube(builder, crank, neck, 0.023, paint)
    top = head - _at(0.0, 0.0, 0.03)
    if low_step:
        _tube(builder, crank + (seat_tube - crank) * 0.35, neck, 0.019, paint)
    else:
        _tube(builder, seat_tube, top, 0.018, paint)
    _tube(builder, head, neck, 0.024, paint)
    for sign in (-1.0, 1.0):
        y = _at(0.0, sign * 0.045, 0.0)
        axle = _at(rear, 0.0, radius) + y
        _tube(builder, axle, crank + y * 0.5, 0.011, paint)
        _tube(builder, axle, seat_tube + y * 0.3, 0.010, paint)
        _tube(builder, _at(front, 0.0, radius) + y, neck + y * 0.5, 0.013, paint)
        foot = crank + _at(0.0, sign * 0.09, -0.13 if sign < 0 else 0.13)
        _tube(builder, crank + y, foot, 0.010, metal)
        builder.box(foot - _at(0.045, 0.05, 0.012), foot + _at(0.045, 0.05, 0.012), dark)
    wheel = [(0.03, 0.050), (0.085, 0.050), (0.085, 0.056), (0.03, 0.056)]
    builder.lathe(crank, wheel, uniform(metal, 3, 16), segments=16)
    for z in (-0.075, 0.075):
        _tube(builder, crank + _at(0.0, 0.053, z), (rear, 0.053, radius + 0.45 * z), 0.006, dark)
    builder.limb(
        saddle + np.array([(-0.13, 0.0, 0.01), (-0.05, 0.0, 0.02), (0.14, 0.0, 0.0)]),
        [0.085, 0.075, 0.025], dark, sides=8, squash=0.4,
    )  # fmt: skip
    builder.box(
        (rear - 0.05, -0.035, radius * 2 + 0.05), (rear - 0.02, 0.035, radius * 2 + 0.11),
        Material.TAIL_LAMP,
    )  # fmt: skip
    _tube(builder, (rear - 0.02, 0, radius * 2 + 0.07), seat_tube, 0.008, dark)
    return saddle, head, crank


def _add_bicycle(
    builder: ShapeBuilder, front: float, rear: float, radius: float, low: Vector, high: Vector
) -> tuple[Array, Array, Array]:
    """A sporty bicycle; returns the seat, the right grip and the pedals' axle."""
    saddle, head, crank = _add_frame(builder, front, rear, radius, high, low_step=False)
    grip = min(0.36, high[1] - 0.03)
    bar = head + _at(0.07, 0.0, 0.05)
    _tube(builder, head, bar, 0.016, Material.METAL)
    _tube(
        builder, bar - _at(0.0, grip, 0.0), bar + _at(0.0, grip, 0.0), 0.013, Material.PLASTIC_DARK
    )
    _lamp(builder, bar[0] + 0.09, bar[2] - 0.05, 0.035)
    for sign in (-1.0, 1.0):
        lever = bar + _at(0.0, sign * (grip - 0.1), 0.0)
        _tube(builder, lever, lever + _at(0.06, sign * 0.08, -0.03), 0.006, Material.METAL)
    return saddle + _at(0.0, 0.0, 0.09), bar + _at(0.0, grip - 0.05, 0.02), crank


def _add_city_bike(
    builder: ShapeBuilder, front: float, rear: float, radius: float, low: Vector, high: Vector
) -> tuple[Array, Array, Array]:
    """An upright bicycle with mudguards, a carrier and a basket."""
    saddle, head, crank = _add_frame(builder, front, rear, radius - 0.02, high, low_step=True)
    radius -= 0.02
    dark = Material.PLASTIC_DARK
    _mudguard(builder, front, radius, 0.06, (20, 170), dark)
    _mudguard(builder, rear, radius, 0.06, (30, 190), dark)
    top = radius * 2 + 0.10
    for y in (-0.06, 0.0, 0.06):
        _tube(builder, (rear - 0.22, y, top), (rear + 0.22, y, top), 0.006, Material.METAL)
    for y in (-0.06, 0.06):
        _tube(builder, (rear, y, radius), (rear - 0.14, y, top), 0.006, Material.METAL)
    grip = min(0.30, high[1] - 0.02)
    bar = head + _at(0.0, 0.0, 0.20)
    _tube(builder, head, bar, 0.014, Material.METAL)
    back = bar - _at(0.16, 0.0, -0.01)
    for sign in (-1.0, 1.0):
        turn = bar + _at(-0.02, sign * grip * 0.9, 0.01)
        _tube(builder, bar, turn, 0.012, Material.METAL)
        _tube(builder, turn, back + _at(0.0, sign * grip, 0.0), 0.014, dark)
    basket = head + _at(0.20, 0.0, 0.05)
    for side in (-1.0, 1.0):
        builder.box(basket + _at(-0.12, side * 0.16 - 0.006, -0.10),
                    basket + _at(0.12, side * 0.16 + 0.006, 0.12), Material.WOOD)  # fmt: skip
        builder.box(basket + _at(side * 0.12 - 0.006, -0.16, -0.10),
                    basket + _at(side * 0.12 + 0.006, 0.16, 0.12), Material.WOOD)  # fmt: skip
    builder.box(basket + _at(-0.12, -0.16, -0.10), basket + _at(0.12, 0.16, -0.09), Material.WOOD)
    _lamp(builder, basket[0] + 0.16, basket[2] - 0.16, 0.04)
    return saddle + _at(0.0, 0.0, 0.09), back + _at(0.05, grip - 0.02, 0.02), crank


def _add_engine(
    builder: ShapeBuilder, middle: float, base: float, radius: float, *, cylinders: bool
) -> None:
    """Crank case, cylinders with fins, exhaust."""
    metal, dark = Material.METAL, Material.PLASTIC_DARK
    z = radius * 1.0
    builder.limb(
        [(middle - 0.20 * base, 0, z), (middle, 0, z - 0.03), (middle + 0.15 * base, 0, z)],
        [0.11, 0.15, 0.11], metal, sides=10,
    )  # fmt: skip
    leans = (-0.16, 0.16) if cylinders else (0.10,)
    for lean in leans:
        foot = _at(middle + 0.04 * base, 0.0, z + 0.06)
        for k in range(5):
            at = foot + _at(lean, 0.0, 0.26) * (0.2 + 0.2 * k)
            wide = 0.085 if k % 2 else 0.11
            builder.box(
                at - _at(wide, wide, 0.02), at + _at(wide, wide, 0.02), metal if k % 2 else dark
            )
    builder.limb(
        [(middle + 0.20 * base, 0.13, z + 0.05), (middle, 0.16, z - 0.12),
         (middle - 0.30 * base, 0.17, z - 0.10), (middle - 0.62 * base, 0.17, z - 0.02)],
        [0.025, 0.030, 0.050, 0.055], Material.RIM, sides=8,
    )  # fmt: skip


def _add_fork(
    builder: ShapeBuilder, foot: tuple[float, float], head: tuple[float, float], grip: float
) -> None:
    """Two legs from the axle to the bar, and the bar."""
    for sign in (-1.0, 1.0):
        y = sign * 0.10
        leg = [(foot[0], y, foot[1]), (head[0], y, head[1])]
        middle = tuple((np.array(leg[0]) + np.array(leg[1])) / 2)
        _tube(builder, leg[0], middle, 0.030, Material.METAL)
        _tube(builder, middle, leg[1], 0.022, Material.RIM)
    _tube(builder, (head[0], -grip, head[1]), (head[0], grip, head[1]), 0.016,
          Material.PLASTIC_DARK)  # fmt: skip


def _add_turn_signals(
    builder: ShapeBuilder, front: tuple[float, float], rear: tuple[float, float]
) -> None:
    """Blinkers on stalks, at ``x, z`` before and behind."""
    for sign, blinker in ((-1.0, Material.BLINKER_LEFT), (1.0, Material.BLINKER_RIGHT)):
        for (x, z), out in ((front, 0.17), (rear, 0.15)):
            _tube(builder, (x, sign * 0.05, z), (x, sign * out, z), 0.008, Material.PLASTIC_DARK)
            ends = sorted((sign * out, sign * (out + 0.05)))
            builder.box((x - 0.025, ends[0], z - 0.02), (x + 0.025, ends[1], z + 0.02), blinker)


def _add_fairing_side(
    builder: ShapeBuilder, sign: float, front: float, middle: float, radius: float, seat_z: float
) -> None:
    """One side of a fairing: from the lamp down to below the engine."""
    rows = [
        [(front - 0.10, 0.6, seat_z + 0.10), (front - 0.30, 1.0, seat_z + 0.12),
         (middle + 0.02, 0.9, seat_z - 0.02)],
        [(front - 0.14, 0.8, seat_z - 0.06), (front - 0.34, 1.25, seat_z - 0.10),
         (middle - 0.02, 1.1, radius * 1.4)],
        [(front - 0.36, 0.6, radius * 1.15), (middle + 0.10, 0.95, radius * 0.7),
         (middle - 0.16, 0.7, radius * 0.62)],
    ]  # fmt: skip
    points = np.array(rows) * np.array([1.0, sign * 0.16, 1.0])
    builder.grid(points, Material.PAINT, crease_deg=50)


def _add_nose(builder: ShapeBuilder, nose: float, seat_z: float) -> None:
    """The front of a fairing, its screen and two lamps."""
    paint = Material.PAINT
    builder.limb(
        [(nose - 0.34, 0, seat_z + 0.14), (nose - 0.16, 0, seat_z + 0.14),
         (nose, 0, seat_z + 0.04)],
        [0.16, 0.18, 0.07], paint, sides=10, squash=0.8,
    )  # fmt: skip
    screen = np.array([
        [(nose - 0.06, 0.09, seat_z + 0.12), (nose - 0.28, 0.13, seat_z + 0.30)],
        [(nose - 0.02, 0.0, seat_z + 0.14), (nose - 0.25, 0.0, seat_z + 0.35)],
        [(nose - 0.06, -0.09, seat_z + 0.12), (nose - 0.28, -0.13, seat_z + 0.30)],
    ])  # fmt: skip
    builder.grid(screen, Material.GLASS)
    for sign in (-1.0, 1.0):
        ends = [
            (nose - 0.03, sign * 0.11, seat_z + 0.07),
            (nose + 0.01, sign * 0.04, seat_z + 0.04),
        ]
        builder.limb(ends, [0.034, 0.034], Material.HEAD_LAMP, sides=8)


def _add_motorcycle(
    builder: ShapeBuilder, front: float, rear: float, radius: float, low: Vector, high: Vector
) -> tuple[Array, Array, Array]:
    """A sports machine with a fairing; returns the seat, the right grip and the pegs."""
    dark, paint = Material.PLASTIC_DARK, Material.PAINT
    for x, wide in ((front, 0.12), (rear, 0.17)):
        with builder.wheel():
            _cast_wheel(builder, x, radius, wide, dark)
    base = front - rear
    middle = rear + 0.5 * base
    seat_z = radius * 2 + 0.12
    _add_engine(builder, middle, base, radius, cylinders=False)
    for sign in (-1.0, 1.0):
        y = sign * 0.13
        _tube(builder, (rear, y, radius), (middle - 0.05, y, radius * 1.25), 0.030, Material.METAL)
        _add_fairing_side(builder, sign, front, middle, radius, seat_z)
    builder.limb(
        [(middle - 0.06, 0, seat_z + 0.02), (middle + 0.06, 0, seat_z + 0.12),
         (middle + 0.26, 0, seat_z + 0.13), (middle + 0.36, 0, seat_z + 0.04)],
        [0.10, 0.16, 0.17, 0.10], paint, sides=10, squash=0.75,
    )  # fmt: skip
    builder.limb(
        [(low[0] + 0.03, 0, seat_z + 0.14), (rear, 0, seat_z + 0.09), (middle - 0.16, 0, seat_z)],
        [0.04, 0.12, 0.13], paint, sides=8, squash=0.55,
    )  # fmt: skip
    builder.limb(
        [(rear - 0.02, 0, seat_z + 0.15), (rear + 0.20, 0, seat_z + 0.07),
         (middle - 0.06, 0, seat_z + 0.04)],
        [0.06, 0.12, 0.11], dark, sides=8, squash=0.45,
    )  # fmt: skip
    _add_nose(builder, front - 0.02, seat_z)
    _mudguard(builder, front, radius, 0.13, (10, 140), paint)
    head = (front - 0.24 * base, seat_z + 0.22)
    grip = min(0.33, high[1] - 0.04)
    _add_fork(builder, (front, radius), head, grip)
    builder.box((low[0] + 0.01, -0.07, seat_z + 0.12), (low[0] + 0.04, 0.07, seat_z + 0.16),
                Material.TAIL_LAMP)  # fmt: skip
    _add_turn_signals(builder, (front - 0.14, seat_z + 0.02), (rear - 0.16, seat_z + 0.04))
    return (
        _at(middle - 0.16 * base, 0.0, seat_z + 0.14),
        _at(head[0], grip - 0.06, head[1] + 0.02),
        _at(middle - 0.10 * base, 0.0, radius * 1.0),
    )


def _add_cruiser(
    builder: ShapeBuilder, front: float, rear: float, radius: float, low: Vector, high: Vector
) -> tuple[Array, Array, Array]:
    """A long machine with two cylinders and much chrome."""
    dark, paint = Material.PLASTIC_DARK, Material.PAINT
    radius -= 0.012
    with builder.wheel():
        _spoked_wheel(builder, front, radius, 0.13)
    with builder.wheel():
        _cast_wheel(builder, rear, radius, 0.17, Material.RIM)
    base = front - rear
    middle = rear + 0.48 * base
    seat_z = radius * 2 + 0.04
    _add_engine(builder, middle, base, radius, cylinders=True)
    for sign in (-1.0, 1.0):
        y = sign * 0.12
        _tube(builder, (rear, y, radius), (middle, y, radius * 0.9), 0.030, dark)
        _tube(builder, (rear + 0.06, y, radius), (rear + 0.16, y, seat_z - 0.02), 0.026,
              Material.RIM)  # fmt: skip
    builder.limb(
        [(middle - 0.06, 0, seat_z + 0.08), (middle + 0.08, 0, seat_z + 0.14),
         (middle + 0.28, 0, seat_z + 0.18), (middle + 0.42, 0, seat_z + 0.19)],
        [0.07, 0.15, 0.15, 0.07], paint, sides=10, squash=0.8,
    )  # fmt: skip
    builder.limb(
        [(rear - 0.02, 0, seat_z + 0.10), (rear + 0.20, 0, seat_z + 0.08),
         (middle - 0.06, 0, seat_z + 0.02), (middle + 0.02, 0, seat_z + 0.08)],
        [0.08, 0.14, 0.16, 0.10], dark, sides=8, squash=0.5,
    )  # fmt: skip
    _mudguard(builder, front, radius, 0.15, (15, 160), paint)
    _mudguard(builder, rear, radius, 0.19, (60, 195), paint)
    grip = min(0.36, high[1] - 0.02)
    head = (front - 0.30 * base, seat_z + 0.36)
    _add_fork(builder, (front, radius), head, grip)
    _lamp(builder, front - 0.17 * base, seat_z + 0.16, 0.09)
    builder.box((low[0] + 0.02, -0.06, seat_z - 0.06), (low[0] + 0.05, 0.06, seat_z),
                Material.TAIL_LAMP)  # fmt: skip
    _tube(builder, (rear - 0.10, 0, seat_z - 0.03), (low[0] + 0.03, 0, seat_z - 0.03), 0.02, dark)
    _add_turn_signals(builder, (front - 0.20 * base, seat_z + 0.06), (rear - 0.20, seat_z - 0.02))
    for sign in (-1.0, 1.0):
        bag = sorted((sign * 0.13, sign * 0.26))
        builder.box((rear - 0.18, bag[0], radius + 0.02), (rear + 0.18, bag[1], seat_z - 0.03),
                    dark)  # fmt: skip
    return (
        _at(middle - 0.16 * base, 0.0, seat_z + 0.16),
        _at(head[0], grip - 0.06, head[1] + 0.02),
        _at(middle + 0.16 * base, 0.0, radius * 0.85),
    )


def _add_scooter(
    builder: ShapeBuilder, front: float, rear: float, radius: float, low: Vector, high: Vector
) -> tuple[Array, Array, Array]:
    """Leg shield, floor and rear shell; returns the seat, the right grip and the floor."""
    for x in (front, rear):
        with builder.wheel():
            _cast_wheel(builder, x, radius, 0.10, Material.RIM)
    base = front - rear
    paint, dark = Material.PAINT, Material.PLASTIC_DARK
    seat_z = 0.74
    _mudguard(builder, front, radius, 0.16, (-5, 185), paint)
    _add_turn_signals(builder, (front - 0.10 * base, 0.62), (low[0] + 0.08, radius + 0.22))
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
    builder.limb(
        [(bar[0] - 0.08, 0, 0.98), (bar[0] + 0.02, 0, 1.0), (bar[0] + 0.07, 0, 0.98)],
        [0.09, 0.13, 0.08], paint, sides=10, squash=0.6,
    )  # fmt: skip
    _lamp(builder, bar[0] + 0.09, 0.98, 0.065)
    tail = low[0] + 0.02
    builder.box((tail, -0.06, radius + 0.2), (tail + 0.05, 0.06, radius + 0.28), Material.TAIL_LAMP)
    builder.limb(
        [(tail + 0.02, 0, radius + 0.20), (rear, 0, radius + 0.24)], [0.09, 0.19], paint, sides=8
    )
    return (
        _at(rear + 0.12 * base, 0.0, seat_z + 0.12),
        _at(bar[0], grip - 0.06, bar[2] + 0.02),
        _at(rear + 0.5 * base, 0.0, 0.34),
    )
