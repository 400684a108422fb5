"""A small off-road car as its maker's pictures show it: a narrow tub between flat wings.

What makes its outline is not the tub but what stands off it: wings over wheels that are outside
the sheet metal, bumpers of bare plastic before and behind it, and a spare wheel on the rear door.
"""

from __future__ import annotations

import numpy as np

from carstage_sim.content.car_body import CarBody
from carstage_sim.content.car_faces import (
    PLATE_HALF_M,
    SPARE_M,
    add_grille,
    add_head_lamps,
    add_number_plate,
    add_rear_glass,
    add_spare,
    add_tail_lamps,
)
from carstage_sim.content.car_trim import add_trim
from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.content.vehicle_frame import VehicleFrame
from carstage_sim.content.vehicle_shapes import shape_of
from carstage_sim.mesh import Material

_TUB = 0.84
"""Width of the tub, as a share of the car's over its wings."""
_BUMPER_M = 0.20
"""How far the front bumper stands before the grille."""
_BUMPER_HEIGHT = (0.235, 0.345)
"""Lower and upper edge of the bumpers, as shares of the height."""
_WING = ((-1.55, 0.62), (-1.34, 1.10), (-1.02, 1.24), (0.92, 1.24), (1.22, 1.10), (1.42, 0.80))
"""Profile of a wing: x from the axle and height over the axle, in wheel radii."""
_SHEET_M = 0.05
_DARK = Material.PLASTIC_DARK


def add_offroader(builder: ShapeBuilder, frame: VehicleFrame, half_width: float) -> CarBody:
    """Add the body of an off-road car with its wings and bumpers.

    Args:
        builder: receives it.
        frame: measures of the car.
        half_width: of the car over its wings, metres.

    Returns:
        The tub, which is narrower than the car.
    """
    share = _TUB * half_width / frame.half_width
    rear, front = frame.low[0] + SPARE_M, frame.high[0] - _BUMPER_M
    tub = CarBody(shape_of(frame.type_id), frame.body(share, rear, front, frame.high[2]))
    tub.add_to(builder)
    add_trim(builder, tub)
    if tub.shape.grille is not None:
        add_grille(builder, tub, tub.shape.grille)
    add_head_lamps(builder, tub)
    add_rear_glass(builder, tub)
    add_tail_lamps(builder, tub)
    _add_bumpers(builder, frame, half_width)
    add_spare(
        builder, (rear - SPARE_M / 2, 0.0, 0.49 * tub.frame.height), 0.88 * frame.wheel_radius
    )
    for axle in frame.axles:
        for sign in (-1.0, 1.0):
            _add_wing(builder, frame, axle, sign, (0.70 * half_width, half_width))
        _add_axle(builder, frame, axle, 0.85 * half_width)
    return tub


def _add_axle(builder: ShapeBuilder, frame: VehicleFrame, x: float, half: float) -> None:
    """A rigid axle with its gear, seen under a body that stands high, and what hangs above it."""
    z = frame.wheel_radius
    builder.limb([(x, -half, z), (x, half, z)], [0.045, 0.045], _DARK, sides=6)
    builder.box((x - 0.13, -0.02, z - 0.14), (x + 0.13, 0.26, z + 0.14), _DARK)
    builder.box((x - 0.30, -0.52, z + 0.10), (x + 0.42, 0.52, z + 0.28), _DARK)


def _add_wing(
    builder: ShapeBuilder, frame: VehicleFrame, axle: float, sign: float, y: tuple[float, float]
) -> None:
    """A flat sheet over a wheel, its ends bent down."""
    radius = frame.wheel_radius
    x, up = np.array(_WING).T * radius
    x, z = np.clip(axle + x, frame.low[0] + SPARE_M, frame.high[0]), up + radius
    inner, outer = y
    ring = [
        (inner, 0.0),
        (outer - 0.02, 0.0),
        (outer, -0.02),
        (outer, -_SHEET_M),
        (inner, -_SHEET_M),
    ]
    points = np.array(
        [[(px, sign * py, pz + down) for py, down in ring] for px, pz in zip(x, z, strict=True)]
    )
    builder.grid(points if sign < 0 else points[:, ::-1], _DARK, closed=True, crease_deg=25)


def _add_bumpers(builder: ShapeBuilder, frame: VehicleFrame, half_width: float) -> None:
    """Beams across the front and the rear, with fog lamps, a winch's plate and number plates."""
    low, high = (share * frame.high[2] for share in _BUMPER_HEIGHT)
    middle, front, rear = (low + high) / 2, frame.high[0], frame.low[0] + SPARE_M
    wide = 0.90 * half_width
    builder.box((front - _BUMPER_M - 0.06, -wide, low), (front - 0.012, wide, high), _DARK)
    builder.box((rear - 0.09, -wide, low), (rear + 0.10, wide, high), _DARK)
    for sign in (-1.0, 1.0):
        y = sign * 0.62 * half_width
        fog = ((0.075, Material.PAINT_BLACK, 0.003), (0.058, Material.LAMP_COVER, 0.006))
        for radius, material, raised in fog:
            _add_disc(builder, (front - 0.012 + raised, y, middle), radius, material)
        hook = (front - 0.03, sign * 0.40 * half_width - 0.035, high)
        builder.box(hook, (front - 0.012, hook[1] + 0.07, high + 0.07), Material.SIGN_RED)
        step = sorted((sign * 0.80 * half_width, sign * 0.88 * half_width))
        reach = 1.45 * frame.wheel_radius
        ends = (frame.axles[1] + reach, frame.axles[0] - reach)
        builder.box((ends[0], step[0], low - 0.06), (ends[1], step[1], low), _DARK)
        glint = sorted((sign * 0.62 * half_width, sign * 0.80 * half_width))
        z = middle + 0.02
        builder.box(
            (rear - 0.096, glint[0], z), (rear - 0.09, glint[1], z + 0.05), Material.SIGN_RED
        )
    add_number_plate(builder, front - 0.008, 1.0, middle, frame.plate)
    # The spare wheel hangs down to the middle of the bumper.
    below = low + PLATE_HALF_M[1]
    add_number_plate(builder, rear - 0.094, -1.0, below, frame.plate)


def _add_disc(
    builder: ShapeBuilder, center: tuple[float, float, float], radius: float, material: int
) -> None:
    """A round plate that looks ahead."""
    turn = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    x, y, z = center
    ring = np.stack([np.full(12, x), y + radius * np.cos(turn), z + radius * np.sin(turn)], axis=1)
    k = np.arange(12)
    fan = np.stack([np.full(12, 12), k, (k + 1) % 12], axis=1)
    builder.add(np.concatenate([ring, [center]]), fan, material)
