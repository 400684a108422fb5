"""Lorries, fire engines, delivery vans and ambulances: a cab before what they carry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from carstage_sim.content.body_shape import Bars, BodyShape, Lamps
from carstage_sim.content.cabins import Cabin, add_cabin
from carstage_sim.content.car_body import CarBody
from carstage_sim.content.car_faces import add_front
from carstage_sim.content.car_trim import add_trim
from carstage_sim.content.lettering import add_text
from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.content.marks import add_light_bar, add_rear_text, add_side_text
from carstage_sim.content.vehicle_frame import VehicleFrame, add_wheels
from carstage_sim.content.vehicle_shapes import SHAPES, Build
from carstage_sim.mesh import Material

_BLINKERS = ((-1.0, Material.BLINKER_LEFT), (1.0, Material.BLINKER_RIGHT))
_Span = tuple[float, float]
_LIGHT_TYRE_M = 0.40
"""Radius of the tyres of a delivery lorry of 5 m, 7.50 R 16."""


def add_ambulance(builder: ShapeBuilder, build: Build, frame: VehicleFrame) -> None:
    """A van's cab before a box that is as wide and high as the bounding box."""
    half, top = frame.half_width, frame.high[2]
    shape = replace(SHAPES[Build.VAN], side_glass=(0.36, 0.74), rear_glass=None)
    body = frame.body(0.80, frame.low[0], frame.high[0], top * 0.88)
    car = CarBody(shape, body)
    car.add_to(builder)
    add_trim(builder, car)
    add_front(builder, car, frame.plate)
    add_cabin(builder, car, Cabin(rows=0, occupied=frame.occupied))
    front = frame.low[0] + 0.62 * (frame.high[0] - frame.low[0])
    wide, roof = half * 0.97, top - 0.11
    rear = frame.low[0] + 0.01
    floor = 0.36 * top
    builder.box((rear, -wide, floor), (front, wide, roof), Material.PAINT)
    for low, high, material in (
        (0.47, 0.55, Material.SIGN_RED),
        (0.56, 0.58, Material.SIGN_YELLOW),
        (0.36, 0.40, Material.SIGN_RED),
    ):
        _band(builder, (rear, front), wide, (low * top, high * top), material)
    middle = (rear + front) / 2
    add_side_text(
        builder, wide + 0.012, middle - 0.25, 0.70 * top, "AMBULANCE", 0.26, Material.SIGN_RED
    )
    for sign in (-1.0, 1.0):
        y = sorted((sign * wide, sign * (wide + 0.012)))
        pane = ((front - 1.0, y[0], 0.66 * top), (front - 0.3, y[1], 0.84 * top))
        builder.box(*pane, Material.GLASS_DARK)
        _add_cross(builder, sign * (wide + 0.013), rear + 0.30, 0.70 * top)
    _add_treatment_room(builder, wide, (rear, front), (floor, roof))
    for x in (front - 0.13, rear + 0.13):
        add_light_bar(builder, x, 0.92 * wide, roof, top)
    _add_rear_doors(builder, rear, wide, (floor + 0.02, roof - 0.04), glazed=True)
    _add_chevrons(builder, rear - 0.006, 0.98 * wide, (floor + 0.24, 0.58 * top))
    add_rear_text(builder, rear - 0.014, roof - 0.14, "AMBULANCE", 0.16, Material.SIGN_RED)
    _add_rear_lamps(builder, rear, wide, floor + 0.02, frame.plate)
    _add_step(builder, rear, wide, (0.13 * top, floor))
    add_wheels(builder, frame, body, 6)


def _add_treatment_room(builder: ShapeBuilder, wide: float, x: _Span, z: _Span) -> None:
    """What an ambulance's box has on its sides: doors, lamps at the top corners, dark edges."""
    (rear, front), (floor, roof) = x, z
    dark = Material.PLASTIC_DARK
    door = (front - 1.15, front - 0.18)
    for at in (*door, rear + 0.75):
        _band(builder, (at - 0.007, at + 0.007), wide + 0.004, (floor + 0.04, roof - 0.12), dark)
    _band(builder, (door[0] + 0.06, door[0] + 0.24), wide + 0.012, (floor + 0.50, floor + 0.55),
          dark)  # fmt: skip
    _band(builder, x, wide, (floor, floor + 0.05), Material.METAL)
    _band(builder, x, wide, (roof - 0.03, roof), Material.METAL)
    for at in (rear + 0.10, (rear + front) / 2, front - 0.35):
        _band(builder, (at, at + 0.22), wide + 0.010, (roof - 0.12, roof - 0.05),
              Material.LAMP_COVER)  # fmt: skip
    for sign, blinker in _BLINKERS:
        y = sorted((sign * wide, sign * (wide + 0.012)))
        for at in (rear + 1.6, front - 0.3):
            builder.box((at, y[0], floor + 0.06), (at + 0.12, y[1], floor + 0.10), blinker)


def _add_step(builder: ShapeBuilder, x: float, wide: float, z: _Span) -> None:
    """What is below a box at the rear: a bumper to step on, with a ribbed plate, before dark."""
    low, high = z
    edge = low + 0.5 * (high - low)
    builder.box((x - 0.002, -wide, edge), (x + 0.10, wide, high), Material.PLASTIC_DARK)
    builder.box((x - 0.008, -0.96 * wide, low), (x + 0.16, 0.96 * wide, edge), Material.PAINT_GREY)
    for share in (0.25, 0.5, 0.75):
        rib = low + share * (edge - low)
        builder.box((x - 0.010, -0.94 * wide, rib), (x, 0.94 * wide, rib + 0.012),
                    Material.PLASTIC_DARK)  # fmt: skip
    for sign in (-1.0, 1.0):
        at = sorted((sign * 0.80 * wide, sign * 0.92 * wide))
        builder.box((x - 0.010, at[0], edge - 0.06), (x, at[1], edge - 0.02), Material.SIGN_RED)


def _band(builder: ShapeBuilder, x: _Span, wide: float, z: _Span, material: int) -> None:
    """A strip along both sides of a box."""
    for sign in (-1.0, 1.0):
        y = sorted((sign * wide, sign * (wide + 0.006)))
        builder.box((x[0], y[0], z[0]), (x[1], y[1], z[1]), material)


def _add_cross(builder: ShapeBuilder, y: float, x: float, z: float) -> None:
    for wide, tall in ((0.075, 0.22), (0.22, 0.075)):
        builder.box((x - wide, y - 0.003, z - tall), (x + wide, y + 0.003, z + tall),
                    Material.SIGN_BLUE)  # fmt: skip


def _add_chevrons(builder: ShapeBuilder, x: float, wide: float, z: _Span) -> None:
    """Slanted stripes, yellow and red, that meet in the middle of a rear end."""
    low, high = z
    quad = [(0, 1, 2), (0, 2, 3)]
    base = [(x, -wide, low), (x, wide, low), (x, wide, high), (x, -wide, high)]
    builder.add(base, quad, Material.SIGN_YELLOW)
    step = 0.22
    for sign in (-1.0, 1.0):
        for k in range(-4, int(wide / step) + 1, 2):
            lean = high - low
            edges = np.array([k * step, (k + 1) * step])
            foot, head = np.clip(edges + lean, 0.0, wide), np.clip(edges, 0.0, wide)
            corners = [
                (x - 0.002, sign * y, at)
                for y, at in ((foot[0], low), (foot[1], low), (head[1], high), (head[0], high))
            ]
            builder.add(corners, quad, Material.SIGN_RED)


def _add_rear_doors(
    builder: ShapeBuilder, x: float, wide: float, z: _Span, *, glazed: bool
) -> None:
    """Two doors with a joint between them, hinges, and either windows or locking bars."""
    low, high = z
    for y in (-0.97 * wide, 0.0, 0.97 * wide):
        builder.box((x - 0.004, y - 0.008, low), (x, y + 0.008, high), Material.PLASTIC_DARK)
    for edge in (low, high - 0.016):
        builder.box((x - 0.004, -0.97 * wide, edge), (x, 0.97 * wide, edge + 0.016),
                    Material.PLASTIC_DARK)  # fmt: skip
    for sign in (-1.0, 1.0):
        if glazed:
            ends = sorted((sign * 0.12 * wide, sign * 0.86 * wide))
            sill, lintel = (low + share * (high - low) for share in (0.60, 0.84))
            builder.box((x - 0.006, ends[0], sill), (x, ends[1], lintel), Material.GLASS_DARK)
            continue
        for share in (0.16, 0.62):
            at = sign * share * wide
            builder.limb(
                [(x - 0.012, at, low + 0.03), (x - 0.012, at, high - 0.03)], [0.014, 0.014],
                Material.METAL, sides=5,
            )  # fmt: skip
            middle = low + 0.35 * (high - low)
            builder.box((x - 0.02, at - 0.10, middle), (x - 0.004, at + 0.10, middle + 0.05),
                        Material.METAL)  # fmt: skip


def _add_rear_lamps(builder: ShapeBuilder, x: float, wide: float, z: float, number: str) -> None:
    """Lamps, reflectors and plate on a flat rear end."""
    builder.box((x - 0.008, -0.26, z), (x, 0.26, z + 0.12), Material.LICENCE_PLATE)
    add_text(
        builder, number, 0.08,
        lambda along, up: np.stack([np.full_like(along, x - 0.010), along, z + 0.06 + up], axis=-1),
        Material.PAINT_BLACK,
    )  # fmt: skip
    for sign, blinker in _BLINKERS:
        case = sorted((sign * 0.68 * wide, sign * 0.995 * wide))
        builder.box((x - 0.004, case[0], z - 0.02), (x, case[1], z + 0.18), Material.PLASTIC_DARK)
        for y0, y1, material in (
            (0.70, 0.79, Material.REVERSE_LAMP),
            (0.80, 0.91, Material.TAIL_LAMP),
            (0.92, 0.985, blinker),
        ):
            y = sorted((sign * y0 * wide, sign * y1 * wide))
            builder.box((x - 0.010, y[0], z), (x, y[1], z + 0.16), material)


def _cab_shape(build: Build) -> BodyShape:
    """An upright cab whose engine is below it."""
    return replace(
        SHAPES[Build.CAMPER],
        rear_window=(-1.2, -1.1),
        side_glass=(-0.50, 0.80),
        pillars=() if build is not Build.FIRE_ENGINE else (0.0,),
        clearance=0.14,
        cladding=0.215,
        tail_round=0.02,
        nose_round=0.12,
        tall_mirrors=True,
        screen_foot=0.93,
        head_lamp=(0.58, 1.03, 0.20, 0.265),
        lamps=Lamps.SQUARE,
        grille=(0.30, 0.46, 0.70),
        bars=Bars.ACROSS,
        intake=(0.155, 0.185, 0.5),
        tumblehome=0.06,
        tail_lamp=(0.0, 0.01, 0.3, 0.31),
        top=(
            (-1.0, 0.96), (-0.9, 0.985), (-0.2, 1.0), (0.60, 0.995), (0.80, 0.97), (0.955, 0.60),
            (0.975, 0.56), (1.0, 0.52),
        ),
        windscreen=(0.79, 0.957),
        belt=((-1.0, 0.56), (0.85, 0.56), (0.95, 0.54), (1.0, 0.48)),
    )  # fmt: skip


def _add_cab(
    builder: ShapeBuilder, build: Build, frame: VehicleFrame, rear: float, share: float
) -> CarBody:
    """The cab with its lamps, inside, visor and steps."""
    height = {Build.LORRY: 0.90, Build.FIRE_ENGINE: 0.84, Build.DELIVERY: 0.96}[build]
    body = frame.body(share, rear, frame.high[0], height * frame.high[2])
    cab = CarBody(_cab_shape(build), body)
    cab.add_to(builder)
    add_trim(builder, cab)
    add_front(builder, cab, frame.plate)
    rows = 1 if build is Build.FIRE_ENGINE else 0
    add_cabin(builder, cab, Cabin(rows=rows, occupied=frame.occupied))
    top = cab.roof(0.80) - 0.02
    half = 0.80 * body.half_width
    y, z = np.meshgrid(np.linspace(-half, half, 5), np.linspace(top - 0.20, top, 2))
    builder.grid(cab.on_screen(y, z, 0.05), Material.PLASTIC_DARK)
    for sign in (-1.0, 1.0):
        outer = sign * body.half_width
        for step in (0.30, 0.52):
            spread = sorted((outer * 0.90, outer * 0.985))
            foot = frame.axles[0] - frame.wheel_radius * 1.25
            builder.box((foot - 0.42, spread[0], step), (foot, spread[1], step + 0.05),
                        Material.METAL)  # fmt: skip
    _add_cab_doors(builder, cab, build)
    return cab


def _add_cab_doors(builder: ShapeBuilder, cab: CarBody, build: Build) -> None:
    """Joints, handles, side lamps, and lamps over the windscreen."""
    f, dark = cab.frame, Material.PLASTIC_DARK
    low, high = (cab.shape.clearance + 0.03) * f.height, 0.93 * f.height
    half = 0.007 / f.half_length
    seams = (-0.5, 0.72) if build is not Build.FIRE_ENGINE else (-0.62, 0.0, 0.74)
    for x in seams:
        cab.side_band(builder, (x - half, x + half), (low, high), dark, raised=0.004, rows=4)
    for x in seams[:-1]:
        grip = (x + 0.05, x + 0.05 + 0.20 / f.half_length)
        z = cab.belt(0.0) - 0.16
        cab.side_band(builder, grip, (z, z + 0.05), dark, raised=0.02, rows=1)
    z = 0.36 * f.height
    for sign, blinker in _BLINKERS:
        cab.side_band(
            builder, (0.80, 0.80 + 0.10 / f.half_length), (z, z + 0.06), blinker, raised=0.012,
            sides=(sign,), rows=1,
        )  # fmt: skip
        for share in (0.45, 0.80):
            y = sorted((sign * share * f.half_width, sign * (share * f.half_width + 0.10)))
            top = cab.roof(0.62)
            x = f.center_x + 0.62 * f.half_length
            builder.box((x, y[0], top - 0.05), (x + 0.09, y[1], top + 0.012), Material.LAMP_COVER)


def add_truck(builder: ShapeBuilder, build: Build, frame: VehicleFrame) -> None:
    """Lorries: a cab over the front axle, a chassis, and what they carry."""
    if build is Build.DELIVERY:
        frame = replace(frame, wheel_radius=min(frame.wheel_radius, _LIGHT_TYRE_M))
    half = frame.half_width
    length = frame.high[0] - frame.low[0]
    share = 0.97 if build is Build.DELIVERY else 0.90
    wide = half * share
    cab_rear = frame.high[0] - (0.30 if build is not Build.FIRE_ENGINE else 0.36) * length
    cab = _add_cab(builder, build, frame, cab_rear, share)
    rear = frame.low[0] + 0.03
    floor = frame.wheel_radius * (2.15 if build is not Build.DELIVERY else 2.05)
    load_front = cab_rear - (0.12 if build is not Build.DELIVERY else -0.02)
    _add_chassis(builder, frame, wide, (rear, load_front), floor)
    load = {
        Build.LORRY: _add_goods, Build.FIRE_ENGINE: _add_fire_gear, Build.DELIVERY: _add_drinks,
    }[build]  # fmt: skip
    load(builder, frame, wide, (rear, load_front), floor)
    _add_marking(builder, wide, (rear, load_front), floor)
    if build is Build.LORRY:
        _add_deflector(builder, cab, 0.90 * wide, frame.high[2] - 0.012)
    if build is Build.FIRE_ENGINE:
        top = cab.roof(0.2)
        x = cab.frame.center_x + 0.2 * cab.frame.half_length
        add_light_bar(builder, x, 0.75 * wide, top, top + 0.17)
    _add_rear_lamps(builder, rear, wide, floor - 0.22, frame.plate)
    add_wheels(builder, frame, cab.frame, 0)


def _add_deflector(builder: ShapeBuilder, cab: CarBody, wide: float, high: float) -> None:
    """A shell on the cab's roof that leads the air over the load."""
    f = cab.frame
    share = np.linspace(0.0, 1.0, 6)
    rows = []
    for x, rise in ((0.55, 0.0), (0.1, 0.45), (-0.4, 0.82), (-0.95, 1.0)):
        top = cab.roof(x)
        z = top - 0.03 + rise * (high - top) * (1.0 - 0.10 * (2 * share - 1.0) ** 4)
        y = wide * (0.80 + 0.16 * rise) * (2 * share - 1.0)
        along = np.full_like(y, f.center_x + x * f.half_length)
        line = np.stack([along, y, z], axis=-1)
        ends = line[[0, -1]].copy()
        ends[:, 2] = top - 0.05
        rows.append(np.concatenate([ends[:1], line, ends[1:]]))
    builder.grid(np.array(rows), Material.PAINT)


def _add_chassis(
    builder: ShapeBuilder, frame: VehicleFrame, wide: float, load: _Span, floor: float
) -> None:
    """Two rails, a tank and a battery box, side guards, mudguards and an underrun bar."""
    radius, dark = frame.wheel_radius, Material.PLASTIC_DARK
    rear, front = load
    for sign in (-1.0, 1.0):
        y = sorted((sign * 0.28 * wide, sign * 0.40 * wide))
        builder.box((rear + 0.05, y[0], radius * 1.25), (front, y[1], floor), dark)
        # A mudguard over the rear wheel and a flap behind it.
        spread = sorted((sign * 0.66 * wide, sign * 0.985 * wide))
        axle = frame.axles[1]
        turn = np.linspace(np.radians(15), np.radians(165), 7)
        away = radius * 1.10
        arc = np.stack([axle + away * np.cos(turn), radius + away * np.sin(turn)], axis=-1)
        arc[:, 1] = np.minimum(arc[:, 1], floor - 0.005)
        points = np.stack([np.insert(arc, 1, y0, axis=1) for y0 in spread])
        builder.grid(points, dark)
        flap = axle - radius * 1.18
        if flap > rear + 0.02:
            builder.box((flap - 0.02, spread[0], 0.18), (flap, spread[1], radius * 1.3), dark)
        start, end = axle + radius * 1.35, front - 0.15
        if end - start > 0.4:
            for z in (radius * 0.85, radius * 1.35):
                bar = sorted((sign * 0.94 * wide, sign * 0.97 * wide))
                builder.box((start, bar[0], z), (end, bar[1], z + 0.10), Material.METAL)
            middle = start + 0.45 * (end - start)
            tank = [(middle, sign * 0.66 * wide, radius * 1.2), (end, sign * 0.66 * wide,
                    radius * 1.2)]  # fmt: skip
            builder.limb(tank, [0.26 * wide, 0.26 * wide], Material.METAL, sides=10)
    builder.box((rear, -0.92 * wide, 0.40), (rear + 0.10, 0.92 * wide, 0.52), Material.METAL)
    for arm in (-0.35 * wide, 0.35 * wide):
        builder.box((rear + 0.02, arm - 0.04, 0.45), (rear + 0.08, arm + 0.04, floor - 0.2), dark)
    # Between rails and load the lamps' beam.
    builder.box((rear, -wide, floor - 0.26), (rear + 0.08, wide, floor), dark)


def _load_box(
    builder: ShapeBuilder, frame: VehicleFrame, wide: float, load: _Span, floor: float,
    material: int,
) -> float:  # fmt: skip
    """The box on a chassis with a frame round its edges; its roof."""
    rear, front = load
    roof = frame.high[2] - 0.012
    builder.box((rear, -wide, floor), (front, wide, roof), material)
    for z in (floor, roof - 0.07):
        _band(builder, load, wide, (z, z + 0.07), Material.METAL)
    for x in (rear, front - 0.06):
        _band(builder, (x, x + 0.06), wide, (floor, roof), Material.METAL)
    return roof


def _add_marking(builder: ShapeBuilder, wide: float, load: _Span, floor: float) -> None:
    """Reflecting tape (UN ECE R104) and amber side lamps (R48) along the lower edge of a load."""
    rear, front = load
    for x in np.linspace(rear + 0.12, front - 0.92, 3):
        _band(builder, (x, x + 0.8), wide + 0.004, (floor + 0.012, floor + 0.062),
              Material.SIGN_YELLOW)  # fmt: skip
    for sign, blinker in _BLINKERS:
        y = sorted((sign * (wide - 0.03), sign * (wide + 0.012)))
        for x in np.linspace(rear + 0.4, front - 0.2, 3):
            builder.box((x, y[0], floor - 0.06), (x + 0.11, y[1], floor - 0.015), blinker)


def _add_goods(
    builder: ShapeBuilder, frame: VehicleFrame, wide: float, load: _Span, floor: float
) -> None:
    rear, front = load
    roof = _load_box(builder, frame, wide, load, floor, Material.SIGN_WHITE)
    for x in np.arange(rear + 0.55, front - 0.3, 0.55):
        _band(builder, (x, x + 0.02), wide, (floor + 0.07, roof - 0.07), Material.PAINT_SILVER)
    middle, tall = (rear + front) / 2, roof - floor
    add_side_text(
        builder, wide + 0.012, middle, floor + 0.60 * tall, "NORDLICHT", 0.20 * tall,
        Material.SIGN_BLUE,
    )  # fmt: skip
    add_side_text(
        builder, wide + 0.012, middle, floor + 0.38 * tall, "EUROPEAN FREIGHT", 0.07 * tall,
        Material.PAINT_GREY,
    )  # fmt: skip
    _band(builder, load, wide + 0.002, (floor + 0.16 * tall, floor + 0.22 * tall), Material.PAINT)
    _add_rear_doors(builder, rear, wide, (floor + 0.03, roof - 0.03), glazed=False)
    for sign in (-1.0, 1.0):
        # Boards of heavy vehicles (UN ECE R70): yellow in a red frame.
        y = sorted((sign * 0.50 * wide, sign * 0.94 * wide))
        low, high = floor + 0.07, floor + 0.21
        builder.box((rear - 0.012, y[0], low), (rear, y[1], high), Material.SIGN_RED)
        builder.box((rear - 0.016, y[0] + 0.04, low + 0.035), (rear, y[1] - 0.04, high - 0.035),
                    Material.SIGN_YELLOW)  # fmt: skip


def _add_drinks(
    builder: ShapeBuilder, frame: VehicleFrame, wide: float, load: _Span, floor: float
) -> None:
    rear, front = load
    roof = _load_box(builder, frame, wide, load, floor, Material.SIGN_RED)
    middle, tall = (rear + front) / 2, roof - floor
    _band(builder, load, wide + 0.001, (floor + 0.14 * tall, floor + 0.24 * tall),
          Material.SIGN_WHITE)  # fmt: skip
    # Doors of the bays roll up between posts.
    for x in np.linspace(rear, front, 9)[[1, 7]]:
        _band(builder, (x - 0.02, x + 0.02), wide + 0.001, (floor + 0.07, roof - 0.07),
              Material.METAL)  # fmt: skip
    for z in np.linspace(floor + 0.28 * tall, roof - 0.12, 6):
        _band(builder, load, wide + 0.001, (z, z + 0.012), Material.PAINT_RED)
    for size, z, text in ((0.22, 0.70, "FRESH"), (0.15, 0.44, "DRINKS")):
        add_side_text(
            builder, wide + 0.012, middle, floor + z * tall, text, size * tall, Material.SIGN_WHITE
        )
    _add_rear_doors(builder, rear, wide, (floor + 0.03, roof - 0.03), glazed=False)


def _add_fire_gear(
    builder: ShapeBuilder, frame: VehicleFrame, wide: float, load: _Span, floor: float
) -> None:
    rear, front = load
    roof = frame.high[2] - 0.26
    tall = roof - floor
    builder.box((rear, -wide, floor), (front, wide, roof), Material.PAINT)
    _band(builder, load, wide, (floor + 0.02, floor + 0.16 * tall), Material.SIGN_YELLOW)
    _band(builder, load, wide, (floor + 0.18 * tall, floor + 0.24 * tall), Material.SIGN_WHITE)
    _add_lockers(builder, frame, wide, load, floor)
    count = 4
    step = (front - rear) / count
    for k in range(count):
        x0, x1 = rear + k * step + 0.05, rear + (k + 1) * step - 0.05
        low, high = floor + 0.28 * tall, roof - 0.20 * tall
        _band(builder, (x0, x1), wide, (low, high), Material.METAL)
        for z in np.linspace(low, high, 8)[1:-1]:
            _band(builder, (x0, x1), wide + 0.002, (z, z + 0.012), Material.PAINT_GREY)
    add_side_text(
        builder, wide + 0.010, (rear + front) / 2, roof - 0.10 * tall, "FIRE RESCUE", 0.13 * tall,
        Material.SIGN_WHITE,
    )  # fmt: skip
    _add_ladder(builder, (rear + 0.05, front + 0.9), roof, frame.high[2])
    for y in (-0.8 * wide, 0.8 * wide):
        ends = sorted((y - 0.10, y + 0.10))
        builder.box((rear + 0.02, ends[0], roof), (rear + 0.20, ends[1], roof + 0.13),
                    Material.BEACON_BLUE)  # fmt: skip
    builder.box((rear - 0.004, -0.55 * wide, floor + 0.30 * tall),
                (rear, 0.55 * wide, roof - 0.20 * tall), Material.METAL)  # fmt: skip
    _add_chevrons(builder, rear - 0.006, 0.98 * wide, (floor + 0.02, floor + 0.28 * tall))
    add_rear_text(builder, rear - 0.008, roof - 0.10 * tall, "FIRE", 0.14 * tall,
                  Material.SIGN_WHITE)  # fmt: skip


def _add_lockers(
    builder: ShapeBuilder, frame: VehicleFrame, wide: float, load: _Span, floor: float
) -> None:
    """Boxes with doors between and behind the wheels, as far down as a step."""
    axle, radius = frame.axles[1], frame.wheel_radius
    spans = ((axle + 1.3 * radius, load[1]), (load[0] + 0.10, axle - 1.3 * radius))
    for first, last in spans:
        if last - first < 0.3:
            continue
        for sign in (-1.0, 1.0):
            y = sorted((sign * 0.70 * wide, sign * wide))
            builder.box((first, y[0], 0.42), (last, y[1], floor), Material.PAINT)
        _band(builder, (first + 0.06, last - 0.06), wide, (0.50, floor - 0.07), Material.METAL)
        middle = (first + last) / 2
        _band(builder, (middle - 0.1, middle + 0.1), wide + 0.004, (0.56, 0.60),
              Material.PLASTIC_DARK)  # fmt: skip


def _add_ladder(builder: ShapeBuilder, x: _Span, low: float, high: float) -> None:
    """Two pairs of rails with rungs, which lie on the roof."""
    for y in (-0.30, 0.30):
        for z in (low + 0.06, high - 0.05):
            builder.box((x[0], y - 0.03, z), (x[1], y + 0.03, z + 0.05), Material.METAL)
    for at in np.arange(x[0] + 0.1, x[1], 0.36):
        builder.box((at, -0.30, high - 0.04), (at + 0.04, 0.30, high - 0.01), Material.METAL)
