"""What the sides and ends of vans, camper buses and buses have besides windows."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.car_body import CarBody
from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.mesh import Material

_DARK = Material.PLASTIC_DARK
_BLINKERS = ((-1.0, Material.BLINKER_LEFT), (1.0, Material.BLINKER_RIGHT))
_HAIR = 0.012
"""Width of a joint, metres."""


def _joint(
    builder: ShapeBuilder, body: CarBody, x: float, z: tuple[float, float], sign: float
) -> None:
    """An upright joint in a side, at relative ``x``."""
    half = _HAIR / 2.0 / body.frame.half_length
    body.side_band(builder, (x - half, x + half), z, _DARK, raised=0.003, sides=(sign,), rows=3)


def add_side_markers(
    builder: ShapeBuilder, body: CarBody, places: tuple[float, ...], z: float
) -> None:
    """Add amber lamps along both sides, no more than 3 m apart (UN ECE R48)."""
    half = 0.055 / body.frame.half_length
    for sign, material in _BLINKERS:
        for x in places:
            body.side_band(
                builder, (x - half, x + half), (z, z + 0.035), material, raised=0.008,
                sides=(sign,), rows=1,
            )  # fmt: skip


def add_van_sides(builder: ShapeBuilder, body: CarBody) -> None:
    """Add a panel van's rub strip, sliding door, pressed panels and rear doors."""
    s, f = body.shape, body.frame
    belt, floor = body.belt(0.0), s.clearance * f.height
    strip = floor + 0.50 * (belt - floor)
    front, rear = s.side_glass[0], -0.97
    for first, last in ((rear, -0.80), (-0.44, 0.42)):
        body.side_band(builder, (first, last), (strip, strip + 0.085), _DARK, raised=0.012)
    middle = front - 0.42
    sill, lintel = floor + 0.10, 0.90 * f.height
    for x in (front, middle):
        _joint(builder, body, x, (sill, lintel), 1.0)
    _joint(builder, body, front, (sill, lintel), -1.0)
    # The rail in which the sliding door's arm runs.
    body.side_band(
        builder, (rear + 0.05, middle), (belt + 0.01, belt + 0.035), _DARK, sides=(1.0,), rows=1
    )
    _press(builder, body, ((rear + 0.06, middle - 0.03), (middle + 0.02, front - 0.02)), belt)
    grip = front - 0.10
    body.side_band(
        builder, (grip, grip + 0.18 / f.half_length), (belt - 0.12, belt - 0.085), _DARK,
        raised=0.02, sides=(1.0,), rows=1,
    )  # fmt: skip
    add_side_markers(builder, body, (-0.88, -0.20, 0.40), floor + 0.18)
    _add_rear_joints(builder, body)


def _press(
    builder: ShapeBuilder, body: CarBody, spans: tuple[tuple[float, float], ...], belt: float
) -> None:
    """Frames of the panels that stand where another van has windows."""
    f = body.frame
    low, high = belt + 0.07, 0.87 * f.height
    edge = 0.02
    for first, last in spans:
        for z in (low, high - edge):
            body.side_band(
                builder, (first, last), (z, z + edge), Material.PAINT_SILVER, raised=0.004, rows=1
            )
        for x in (first, last - edge / f.half_length):
            body.side_band(
                builder, (x, x + edge / f.half_length), (low, high), Material.PAINT_SILVER,
                raised=0.004,
            )  # fmt: skip


def _add_rear_joints(builder: ShapeBuilder, body: CarBody) -> None:
    """The joint between two rear doors, hinges, and a handle beside the plate."""
    s = body.shape
    top = 0.93
    half = 0.006
    joint = [(u, s.clearance + 0.10, top) for u in (-half, half)]
    body.panel(builder, -1.0, joint, _DARK, raised=0.012)
    for sign in (-1.0, 1.0):
        for z in (0.30, 0.55, 0.80):
            hinge = [(sign * u, z, z + 0.022) for u in (0.93, 1.0)]
            body.panel(builder, -1.0, hinge, _DARK, raised=0.016, rows=1)
    handle = [(u, 0.50, 0.52) for u in (0.03, 0.17)]
    body.panel(builder, -1.0, handle, _DARK, raised=0.020, rows=1)


def add_camper_trim(builder: ShapeBuilder, body: CarBody) -> None:
    """Add a camper bus's bumpers, waist line, sign and vents: bright on a plain face."""
    f = body.frame
    for end, low in ((1.0, body.floor(1.0)), (-1.0, body.floor(-1.0))):
        z = low / f.height + 0.01
        bar = [(u, z, z + 0.062) for u in (-1.3, -1.1, *np.linspace(-1.0, 1.0, 7), 1.1, 1.3)]
        body.panel(builder, end, bar, Material.RIM, raised=0.022, rows=1)
    belt = body.belt(0.0)
    for z, wide, material in (
        (belt - 0.10, 0.022, Material.RIM),
        (belt - 0.075, 0.05, Material.SIGN_WHITE),
    ):
        body.side_band(builder, (-0.95, 0.93), (z, z + wide), material, rows=1)
    waist = (belt - 0.10) / f.height
    line = [(u, waist - 0.16 * (1.0 - abs(u)), waist - 0.16 * (1.0 - abs(u)) + 0.011)
            for u in np.linspace(-0.98, 0.98, 9)]  # fmt: skip
    body.panel(builder, 1.0, line, Material.RIM, raised=0.007, rows=1)
    sign = (0.0, waist - 0.055)
    body.disc(builder, 1.0, sign, 0.15, Material.RIM, raised=0.010, sides=16)
    body.disc(builder, 1.0, sign, 0.125, Material.PAINT_BLACK, raised=0.014, sides=16)
    body.disc(builder, 1.0, sign, 0.075, Material.RIM, raised=0.020, sides=12)
    body.disc(builder, 1.0, sign, 0.055, Material.PAINT_BLACK, raised=0.024, sides=12)
    vent = [(u, waist + 0.015, waist + 0.04) for u in (-0.34, 0.0, 0.34)]
    body.panel(builder, 1.0, vent, _DARK, raised=0.008, rows=1)
    for k in range(3):
        z = belt - 0.24 - 0.05 * k
        body.side_band(builder, (-0.92, -0.74), (z, z + 0.02), _DARK, rows=1)


def add_bus_sides(builder: ShapeBuilder, body: CarBody) -> None:
    """Add a bus's flaps in its skirt, side markers, and a sign over the first window."""
    s, f = body.shape, body.frame
    floor, belt = s.clearance * f.height, body.belt(0.0)
    for sign in (-1.0, 1.0):
        for x in (-0.92, -0.72, -0.28, -0.12, 0.02, 0.30, 0.46):
            _joint(builder, body, x, (floor + 0.04, belt - 0.32), sign)
    skirt = floor + 0.02
    body.side_band(builder, (-0.96, 0.74), (skirt, skirt + 0.07), _DARK, raised=0.004, rows=1)
    add_side_markers(builder, body, (-0.84, -0.44, -0.06, 0.38, 0.72), belt - 0.42)
    top = 0.93 * f.height
    body.side_band(builder, (0.42, 0.68), (top - 0.17, top), Material.PAINT_BLACK, raised=0.010)
    body.side_band(
        builder, (0.45, 0.65), (top - 0.115, top - 0.06), Material.DISPLAY, raised=0.014, rows=1
    )
