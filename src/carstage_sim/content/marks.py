"""Marks that tell what a vehicle is for: light bars, words on its sides, signs, displays."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.car_body import CarBody
from carstage_sim.content.lettering import add_text, text_width
from carstage_sim.content.lofting import Array, ShapeBuilder
from carstage_sim.mesh import Material

LIGHT_BAR_M = 0.10
"""How much lower than its box the roof of a vehicle with a light bar or a sign is."""


def add_light_bar(builder: ShapeBuilder, x: float, wide: float, low: float, high: float) -> None:
    """Add a bar of beacons across a roof: blue on the left, red on the right."""
    foot = low + 0.25 * (high - low)
    builder.box((x - 0.10, -wide, low - 0.05), (x + 0.10, wide, foot), Material.PLASTIC_DARK)
    builder.box((x - 0.09, -0.12 * wide, foot), (x + 0.09, 0.12 * wide, high), Material.SIGN_WHITE)
    for sign, material in ((-1.0, Material.BEACON_BLUE), (1.0, Material.BEACON_RED)):
        for first, last in ((0.14, 0.54), (0.58, 0.98)):
            y = sorted((sign * first * wide, sign * last * wide))
            builder.box((x - 0.11, y[0], foot), (x + 0.11, y[1], high), material)


def add_roof_sign(builder: ShapeBuilder, x: float, text: str, low: float, high: float) -> None:
    """Add a lit sign across a roof that is read from before and behind."""
    wide = text_width(text, 0.6 * (high - low)) / 2 + 0.06
    builder.box((x - 0.07, -wide, low - 0.05), (x + 0.07, wide, high), Material.SIGN_WHITE)
    for end in (-1.0, 1.0):

        def place(along: Array, up: Array, end: float = end) -> Array:
            z = (low + high) / 2 + up
            return np.stack([np.full_like(along, x + end * 0.072), -end * along, z], axis=-1)

        add_text(builder, text, 0.6 * (high - low), place, Material.PAINT_BLACK)


def add_side_text(
    builder: ShapeBuilder, y: float, x: float, z: float, text: str, height: float, material: int
) -> None:
    """Add a line of text on both flat sides, its middle at ``x`` and ``z``."""
    for sign in (-1.0, 1.0):

        def place(along: Array, up: Array, sign: float = sign) -> Array:
            return np.stack([x + sign * along, np.full_like(along, sign * y), z + up], axis=-1)

        add_text(builder, text, height, place, material)


def add_rear_text(
    builder: ShapeBuilder, x: float, z: float, text: str, height: float, material: int
) -> None:
    """Add a line of text on a flat rear end."""

    def place(along: Array, up: Array) -> Array:
        return np.stack([np.full_like(along, x), along, z + up], axis=-1)

    add_text(builder, text, height, place, material)


def add_door_text(
    builder: ShapeBuilder, body: CarBody, at: float, z: float, text: str, height: float,
    material: int,
) -> None:  # fmt: skip
    """Add a line of text on both sides of a lofted body, at relative ``at`` and height ``z``."""
    f = body.frame
    middle = f.center_x + at * f.half_length
    for sign in (-1.0, 1.0):

        def place(along: Array, up: Array, sign: float = sign) -> Array:
            y = sign * (body.across(at, z + up) + 0.014)
            return np.stack([middle + sign * along, y, z + up], axis=-1)

        add_text(builder, text, height, place, material)


def add_police(builder: ShapeBuilder, body: CarBody) -> None:
    """Add a police car's light bar, stripe, words and push bar."""
    f, s = body.frame, body.shape
    top = body.roof(0.0)
    add_light_bar(builder, f.center_x - 0.1, 0.62 * f.half_width, top, top + LIGHT_BAR_M)
    low = body.belt(0.0) - 0.27
    body.side_band(builder, (-0.38, 0.42), (low, low + 0.20), Material.SIGN_BLUE)
    add_door_text(builder, body, 0.16, low + 0.10, "POLICE", 0.14, Material.SIGN_YELLOW)
    rear = s.tail_lamp[2] * f.height - 0.02
    _on_rear(builder, body, rear + 0.16, "POLICE", 0.075, Material.SIGN_BLUE)
    _add_push_bar(builder, body)


def _on_rear(
    builder: ShapeBuilder, body: CarBody, z: float, text: str, height: float, material: int
) -> None:
    add_text(
        builder, text, height,
        lambda along, up: body.on_face(-1.0, along, z + up, 0.014), material,
    )  # fmt: skip


def _add_push_bar(builder: ShapeBuilder, body: CarBody) -> None:
    f, s = body.frame, body.shape
    x = f.center_x + f.half_length - 0.03
    low, high = (s.clearance + 0.05) * f.height, (s.head_lamp[3] - 0.02) * f.height
    for y in (-0.36, 0.36):
        builder.box((x - 0.10, y - 0.03, low), (x + 0.03, y + 0.03, high), Material.PLASTIC_DARK)
    for z in (high - 0.05, low + 0.45 * (high - low)):
        builder.box((x - 0.02, -0.36, z), (x + 0.025, 0.36, z + 0.045), Material.PLASTIC_DARK)


def add_taxi(builder: ShapeBuilder, body: CarBody) -> None:
    """Add a taxi's roof sign and a band of checks."""
    f = body.frame
    top = body.roof(0.0)
    add_roof_sign(builder, f.center_x, "TAXI", top, top + LIGHT_BAR_M)
    low = body.belt(0.0) - 0.26
    for row in range(2):
        for k in range(row, 14, 2):
            first, z = -0.44 + 0.065 * k, low + 0.045 * row
            body.side_band(
                builder, (first, first + 0.065), (z, z + 0.045), Material.PAINT_BLACK, rows=1
            )


def add_bus_marks(builder: ShapeBuilder, body: CarBody) -> None:
    """Add a bus's destination signs and its doors, which are on the right."""
    f = body.frame
    high = body.roof(body.shape.windscreen[0]) - 0.11
    half = 0.66 * f.half_width
    y, z = np.meshgrid(np.linspace(-half, half, 7), np.linspace(high - 0.34, high, 4))
    builder.grid(body.on_screen(y, z, 0.015), Material.PAINT_BLACK)
    add_text(
        builder, "12 HARBOUR", 0.21,
        lambda along, up: body.on_screen(-along, high - 0.17 + up, 0.022), Material.DISPLAY,
    )  # fmt: skip
    rear = body.shape.rear_glass
    if rear is not None:
        top = rear[1] * f.height - 0.20
        plate = [(u, rear[1] - 0.115, rear[1] - 0.01) for u in (-0.30, 0.0, 0.30)]
        body.panel(builder, -1.0, plate, Material.PAINT_BLACK, raised=0.012)
        _on_rear(builder, body, top, "12", 0.22, Material.DISPLAY)
    for first, last in ((0.76, 0.925), (0.06, 0.26)):
        _add_bus_door(builder, body, first, last)
    vents = [(u, 0.20, 0.33) for u in (-0.6, 0.0, 0.6)]
    body.panel(builder, -1.0, vents, Material.PLASTIC_DARK, raised=0.006)
    for k in range(4):
        slat = [(u, 0.215 + 0.03 * k, 0.225 + 0.03 * k) for u in (-0.56, 0.0, 0.56)]
        body.panel(builder, -1.0, slat, Material.PAINT_GREY, raised=0.010, rows=1)
    low = body.belt(0.0)
    body.side_band(builder, (-0.96, 0.92), (low - 0.30, low - 0.12), Material.SIGN_WHITE)


def _add_bus_door(builder: ShapeBuilder, body: CarBody, first: float, last: float) -> None:
    """Two leaves of glass in dark frames."""
    f = body.frame
    low, high = (body.shape.clearance + 0.015) * f.height, 0.90 * f.height
    middle = (first + last) / 2
    edge = 0.03 / f.half_length
    for x0, x1, inset, raised, material in (
        (first, last, 0.0, 0.010, Material.PLASTIC_DARK),
        (first + 2 * edge, middle - edge, 0.07, 0.018, Material.GLASS),
        (middle + edge, last - 2 * edge, 0.07, 0.018, Material.GLASS),
    ):
        body.side_band(
            builder, (x0, x1), (low + inset, high - inset), material, raised=raised,
            sides=(1.0,), rows=4,
        )  # fmt: skip
