"""Fronts and rears of lofted bodies: lamps with lenses, grilles, bumpers, plates, badges."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.body_shape import Bars, Lamps, Tails
from carstage_sim.content.car_body import CarBody, Outline
from carstage_sim.content.lettering import add_text
from carstage_sim.content.lofting import Array, ShapeBuilder, uniform
from carstage_sim.mesh import Material

_SIDES = ((-1.0, Material.BLINKER_LEFT), (1.0, Material.BLINKER_RIGHT))
PLATE_HALF_M = (0.26, 0.056)
"""Half width and half height of a number plate."""
_FRONT, _REAR = 1.0, -1.0
SPARE_M = 0.17
"""How far a spare wheel stands off a rear door."""
LEDGE_M = 0.05
"""How far a rear bumper stands out below the lid."""
_LEDGE = ((0.0, 0.25), (0.12, 0.80), (0.50, 1.0), (0.90, 0.95), (0.98, 0.80), (1.0, 0.0))
"""Its profile: share of its height, and of its depth."""


def add_front(builder: ShapeBuilder, body: CarBody, plate: str) -> None:
    """Add lamps, grille, bumper and number plate of the front."""
    s, f = body.shape, body.frame
    low, high, wide = s.intake
    dark = Material.PLASTIC_DARK
    mouth = [(u * wide, low + 0.012 * abs(u), high - 0.03 * abs(u) ** 3) for u in _even(9)]
    # The face is flat between its few rows there: it stands up to 12 mm before its curve.
    body.panel(builder, _FRONT, mouth, dark, raised=0.016)
    for share in (0.32, 0.62):
        z = low + share * (high - low)
        slat = [(u * wide * 0.94, z, z + 0.008) for u in _even(5)]
        body.panel(builder, _FRONT, slat, Material.PAINT_GREY, raised=0.019, rows=1)
    if s.rugged:
        _add_off_road_bumper(builder, body)
    else:
        lip = [(u, s.clearance + 0.012, s.clearance + 0.05) for u in _even(9)]
        body.panel(builder, _FRONT, lip, dark, raised=0.010, rows=1)
    if s.grille is not None:
        add_grille(builder, body, s.grille)
    add_head_lamps(builder, body)
    for sign in (-1.0, 1.0):
        fog = min(wide + 0.10, 0.86)
        z = low + 0.45 * (high - low)
        if fog > wide:
            body.disc(builder, _FRONT, (sign * fog, z), 0.058, dark, raised=0.006)
            body.disc(builder, _FRONT, (sign * fog, z), 0.042, Material.LAMP_COVER, raised=0.010)
    middle = (low + 0.55 * (high - low)) * f.height
    _add_plate(builder, body, _FRONT, middle, plate)


def _add_off_road_bumper(builder: ShapeBuilder, body: CarBody) -> None:
    """What SUVs have: a dark lower half round the corners, a bright skid plate, fog lamps in it."""
    s = body.shape
    low, high, wide = s.intake
    floor = body.floor(1.0) / body.frame.height
    lower = [(u, floor, low + 0.02) for u in (-1.25, *_even(9), 1.25)]
    body.panel(builder, _FRONT, lower, Material.PLASTIC_DARK, raised=0.005)
    skid = [(u * 0.42, floor + 0.008, low - 0.004 - 0.012 * abs(u)) for u in _even(5)]
    body.panel(builder, _FRONT, skid, Material.PAINT_SILVER, raised=0.014, rows=1)
    for sign in (-1.0, 1.0):
        pocket = [
            (sign * (wide + 0.05), low + 0.02, high),
            (sign * 0.90, low - 0.01, high + 0.025),
            (sign * 0.99, low - 0.01, high + 0.035),
        ]
        body.panel(builder, _FRONT, pocket, Material.PLASTIC_DARK, raised=0.007)
        bright = [(u, b - 0.012, b) for u, _, b in pocket]
        body.panel(builder, _FRONT, bright, Material.RIM, raised=0.012, rows=1)


def _even(count: int) -> list[float]:
    return [float(u) for u in np.linspace(-1.0, 1.0, count)]


def _rounded(wide: float, low: float, high: float) -> list[tuple[float, float, float]]:
    """An opening with rounded corners, narrower at its foot."""
    tall = high - low
    columns = []
    for u in (-1.0, -0.96, -0.88, -0.6, 0.0, 0.6, 0.88, 0.96, 1.0):
        cut = abs(u) ** 8
        columns.append((u * wide, low + 0.42 * tall * cut, high - 0.16 * tall * cut))
    return columns


def add_grille(builder: ShapeBuilder, body: CarBody, opening: tuple[float, float, float]) -> None:
    """Add a grille: ``opening`` is z from, z to (shares of the height), half width as a share."""
    low, high, wide = opening
    bars = body.shape.bars
    step = (high - low) / 7
    if bars is Bars.VEE:
        _add_vee(builder, body, opening)
        return
    if bars is Bars.SLOTS:
        _add_slots(builder, body, opening)
        return
    rim = _rounded(1.04 * wide, low - 0.008, high + 0.008)
    body.panel(builder, _FRONT, rim, Material.RIM, raised=0.005)
    hole = _rounded(wide, low, high)
    body.panel(builder, _FRONT, hole, Material.PLASTIC_DARK, raised=0.008)
    if bars is Bars.ACROSS:
        for k in (1, 3, 5):
            bar = [(u * wide, low + k * step, low + (k + 0.55) * step) for u in _even(5)]
            body.panel(builder, _FRONT, bar, Material.RIM, raised=0.013, rows=1)
    elif bars is Bars.UPRIGHT:
        for k in range(7):
            u = (k - 3) / 3.5 * wide
            bar = [(v, *_between(hole, v)) for v in (u - 0.035 * wide, u + 0.035 * wide)]
            body.panel(builder, _FRONT, bar, Material.RIM, raised=0.013)
    else:
        for k in range(1, 7):
            half = wide * (0.97 - 0.06 * abs(k - 3.5))
            bar = [(u * half, low + k * step, low + (k + 0.25) * step) for u in _even(5)]
            body.panel(builder, _FRONT, bar, Material.PAINT_BLACK, raised=0.011, rows=1)
    _add_badge(builder, body, low + 0.58 * (high - low), high - low)


def _add_slots(builder: ShapeBuilder, body: CarBody, opening: tuple[float, float, float]) -> None:
    """Seven upright openings with rounded ends in the painted sheet."""
    low, high, wide = opening
    tall = high - low
    for k in range(7):
        middle, half = (k - 3) / 3.5 * wide, 0.085 * wide
        slot = [
            (middle + u * half, low + 0.10 * tall * abs(u) ** 3, high - 0.10 * tall * abs(u) ** 3)
            for u in (-1.0, -0.7, 0.7, 1.0)
        ]
        body.panel(builder, _FRONT, slot, Material.PAINT_BLACK, raised=0.009)


def _add_badge(builder: ShapeBuilder, body: CarBody, z: float, tall: float) -> None:
    """A round badge in an opening whose height is a share ``tall`` of the body's."""
    radius = min(0.055, 0.42 * tall * body.frame.height)
    body.disc(builder, _FRONT, (0.0, z), radius, Material.RIM, raised=0.018)
    body.disc(builder, _FRONT, (0.0, z), 0.73 * radius, Material.PAINT_BLACK, raised=0.021)


def _add_vee(builder: ShapeBuilder, body: CarBody, opening: tuple[float, float, float]) -> None:
    """Slats from lamp to lamp, between two arms that run up and outwards from a bright foot."""
    low, high, wide = opening
    tall = high - low

    def rise(u: float) -> float:
        return low + tall * min(max((abs(u) / wide - 0.48) / 0.52, 0.0), 1.0)

    hole = [(u * wide, max(rise(u * wide) - 0.01, low), high) for u in _even(9)]
    body.panel(builder, _FRONT, hole, Material.PLASTIC_DARK, raised=0.008)
    for k in range(1, 6):
        z = low + tall * k / 6.0
        half = wide * (0.48 + 0.52 * k / 6.0) - 0.05
        slat = [(u * half, z, z + 0.10 * tall) for u in _even(5)]
        body.panel(builder, _FRONT, slat, Material.PAINT_GREY, raised=0.011, rows=1)
    for sign in (-1.0, 1.0):
        arm = [
            (sign * u * wide, rise(u * wide) - 0.012, min(rise(u * wide) + 0.024, high))
            for u in np.linspace(0.44, 1.0, 8)
        ]
        body.panel(builder, _FRONT, arm, Material.RIM, raised=0.016, rows=1)
    foot = [(u * 0.46 * wide, low - 0.012, low + 0.020) for u in _even(3)]
    body.panel(builder, _FRONT, foot, Material.RIM, raised=0.015, rows=1)
    _add_badge(builder, body, low + 0.62 * tall, tall)


def _lamp_outline(
    sign: float, box: tuple[float, float, float, float], swept: float
) -> list[tuple[float, float, float]]:
    """Columns from the inner end, which is narrow if ``swept``, to the outer one."""
    y0, y1, z0, z1 = box
    high = z1 - z0
    columns = []
    for share in (0.0, 0.3, 0.6, 0.85, 1.0):
        u = y0 + share * (y1 - y0)
        tip = 0.30 * swept * (1.0 - share) ** 2
        rise = 0.16 * swept * high * share
        close = 0.55 * swept * max(share - 0.6, 0.0) / 0.4
        columns.append((sign * u, z0 + high * (tip + close) + rise, z1 - high * tip + rise))
    return columns


def _slice(outline: Outline, low: float, high: float) -> list[tuple[float, float, float]]:
    """The same columns between two shares of their height."""
    return [(u, a + low * (b - a), a + high * (b - a)) for u, a, b in outline]


def add_head_lamps(builder: ShapeBuilder, body: CarBody) -> None:
    """Add the head lamps and the front's turn signals."""
    for sign, blinker in _SIDES:
        _add_head_lamp(builder, body, sign, blinker)


def _add_head_lamp(builder: ShapeBuilder, body: CarBody, sign: float, blinker: Material) -> None:
    s, f = body.shape, body.frame
    y0, y1, z0, z1 = s.head_lamp
    high = z1 - z0
    lens, cover = Material.HEAD_LAMP, Material.LAMP_COVER
    radius = high * f.height / 2
    if s.lamps is Lamps.ROUND:
        middle = (sign * (y0 + y1) / 2, (z0 + z1) / 2)
        body.disc(builder, _FRONT, middle, radius * 1.12, Material.RIM, raised=0.010, sides=18)
        body.disc(builder, _FRONT, middle, radius, lens, raised=0.016, sides=18)
        below = (middle[0], z0 - 0.045)
        body.disc(builder, _FRONT, below, radius * 0.42, blinker, raised=0.012)
        return
    if s.lamps is Lamps.STRIP:
        line = [(sign * u, z0, z1) for u in np.linspace(y0, y1, 6)]
        body.panel(builder, _FRONT, line, lens, raised=0.012, rows=1)
        edge = [(sign * u, z0 - 0.05, z0 - 0.012) for u in np.linspace(y1 - 0.25, y1, 3)]
        body.panel(builder, _FRONT, edge, blinker, raised=0.012, rows=1)
        return
    swept = 1.0 if s.lamps is Lamps.SWEPT else 0.0
    outline = _lamp_outline(sign, s.head_lamp, swept)
    grown = [(u, a - 0.006, b + 0.006) for u, a, b in outline]
    body.panel(builder, _FRONT, grown, Material.PLASTIC_DARK, raised=0.005)
    body.panel(builder, _FRONT, outline, cover, raised=0.009)
    body.panel(builder, _FRONT, _slice(outline, 0.02, 0.20), lens, raised=0.013, rows=1)
    turn = _lamp_outline(sign, (y1 - 0.18 * (y1 - y0), y1, z0, z1), 0.0)
    inside = [(u, *_between(outline, u)) for u, _, _ in turn]
    body.panel(builder, _FRONT, _slice(inside, 0.25, 0.80), blinker, raised=0.013, rows=1)
    last = min(y1 - 0.34 * (y1 - y0), 0.88)
    if swept:
        lenses = [(y0 + 0.42 * (last - y0), 0.55, 0.33), (last, 0.58, 0.42)]
    else:
        lenses = [((y0 + last) / 2, 0.72, 0.24), ((y0 + last) / 2, 0.40, 0.20)]
    for u, share, size in lenses:
        bottom, top = _between(outline, sign * u)
        place = (sign * u, bottom + share * (top - bottom))
        wide = (1.0 if swept else 2.0) * 0.20 * (last - y0) * f.half_width
        radius = min(size * high * f.height, max(wide, 0.04))
        body.disc(builder, _FRONT, place, radius * 1.16, Material.PAINT_BLACK, raised=0.012)
        body.disc(builder, _FRONT, place, radius, lens, raised=0.016)
        body.disc(builder, _FRONT, place, radius * 0.45, cover, raised=0.019, sides=8)


def _between(outline: Outline, u: float) -> tuple[float, float]:
    """Lower and upper edge of an outline at a share of the half width."""
    columns = sorted(outline)
    at = [column[0] for column in columns]
    return (
        float(np.interp(u, at, [column[1] for column in columns])),
        float(np.interp(u, at, [column[2] for column in columns])),
    )


def add_rear(builder: ShapeBuilder, body: CarBody, plate: str) -> None:
    """Add lamps, lid, bumper and number plate of the rear."""
    s, f = body.shape, body.frame
    dark = Material.PLASTIC_DARK
    y0, _, z0, _ = s.tail_lamp
    add_rear_glass(builder, body)
    floor = body.floor(-1.0) / f.height
    bumper = max(s.clearance + 0.17, floor + 0.115)
    ledge = LEDGE_M if s.bumper else 0.0
    below = 0.10 if s.boot else 0.15 if s.tails is Tails.STRIP else 0.02
    under_plate = max(z0 - below, bumper + (0.07 if s.boot else 0.08))
    if s.spare:
        under_plate = floor + 0.045
    lid_from = bumper
    if s.bumper:
        lid_from = under_plate - 0.062
        _add_ledge(builder, body, floor, lid_from)
    if not s.rugged:
        valance = [(u * 0.9, floor + 0.004, floor + 0.07) for u in _even(9)]
        body.panel(builder, _REAR, valance, dark, raised=0.010 + ledge)
        if not s.bumper:
            crease = [(u, bumper, bumper + 0.008) for u in (-1.2, -1.05, *_even(9), 1.05, 1.2)]
            body.panel(builder, _REAR, crease, dark, raised=0.004, rows=1)
    recess = [(u * 0.40, under_plate - 0.055, under_plate + 0.062) for u in _even(3)]
    body.panel(builder, _REAR, recess, Material.PAINT_GREY, raised=0.003)
    _add_plate(builder, body, _REAR, under_plate * f.height, plate)
    if not s.spare:
        bright = [(u * 0.34, under_plate + 0.058, under_plate + 0.070) for u in _even(3)]
        body.panel(builder, _REAR, bright, Material.RIM, raised=0.012, rows=1)
        badge = under_plate + 0.068 + 0.045
        if s.tails is not Tails.STRIP:
            body.disc(builder, _REAR, (0.0, badge), 0.042, Material.RIM, raised=0.012)
    add_tail_lamps(builder, body)
    for sign in (-1.0, 1.0):
        seam = (y0 + 0.03 if y0 else 0.64) if s.boot else 0.93
        lid = [(sign * seam, lid_from, z0)]
        lid.append((sign * (seam + 0.012), *lid[0][1:]))
        body.panel(builder, _REAR, lid, dark, raised=0.004)
        glint = [(sign * u, bumper - 0.045, bumper - 0.020) for u in (0.66, 0.86)]
        body.panel(builder, _REAR, glint, Material.SIGN_RED, raised=0.008 + ledge, rows=1)
        if s.boot or s.cladding:
            tip = (sign * 0.58, floor + 0.03)
            body.disc(builder, _REAR, tip, 0.042, Material.RIM, raised=0.016 + ledge)
            body.disc(builder, _REAR, tip, 0.032, Material.PAINT_BLACK, raised=0.019 + ledge)
    if s.rugged:
        _add_tailgate(builder, body, under_plate)


def _add_ledge(builder: ShapeBuilder, body: CarBody, floor: float, top: float) -> None:
    """A rear bumper between two shares of the height: it stands out and goes round the corners."""
    columns = np.array([-1.36, -1.26, -1.14, -1.06, -1.0, -0.92, *np.linspace(-0.75, 0.75, 7)])
    columns = np.concatenate([columns, -columns[5::-1]])
    share, depth = np.array(_LEDGE).T
    z = (floor + share * (top - floor)) * body.frame.height
    beyond = np.maximum(np.abs(columns) - 1.0, 0.0)
    fade = np.clip((0.36 - beyond) / 0.32, 0.0, 1.0)
    points = np.empty((len(z), len(columns), 3))
    for k, u in enumerate(columns):
        x = -1.0 + beyond[k] * body.frame.half_width / body.frame.half_length
        y = np.clip(u, -1.0, 1.0) * body.across(float(x), z)
        points[:, k] = body.place(np.full_like(y, x), y, z)
        side = np.clip((abs(u) - 0.85) / 0.15, 0.0, 1.0) * np.sign(u)
        points[:, k, 1] += side * 0.01 * depth * fade[k]
    points[..., 0] -= LEDGE_M * depth[:, None] * fade
    builder.grid(points, Material.PAINT, crease_deg=30.0)


def add_rear_glass(builder: ShapeBuilder, body: CarBody) -> None:
    """Add the frame of the window in an upright rear face, where the shape has one."""
    s = body.shape
    if s.rear_glass is None:
        return
    sill, lintel, wide = s.rear_glass
    outer = (sill - 0.02, lintel + 0.02)
    for low, high in ((outer[0], sill), (lintel, outer[1])):
        strip = [(u * wide, low, high) for u in _even(7)]
        body.panel(builder, _REAR, strip, Material.PLASTIC_DARK, raised=0.004, rows=1)
    for sign in (-1.0, 1.0):
        strip = [(sign * u, *outer) for u in (wide, wide + 0.03)]
        body.panel(builder, _REAR, strip, Material.PLASTIC_DARK, raised=0.004)


def add_tail_lamps(builder: ShapeBuilder, body: CarBody) -> None:
    """Add the lamps at the rear's sides and the brake lamp above."""
    for sign, blinker in _SIDES:
        _add_tail_lamp(builder, body, sign, blinker)
    _add_high_brake_lamp(builder, body)


def _add_tailgate(builder: ShapeBuilder, body: CarBody, plate: float) -> None:
    """What is on a tall rear door and below it: a spare wheel, or a bright strip."""
    s, f = body.shape, body.frame
    floor = body.floor(-1.0) / f.height
    ledge = LEDGE_M if s.bumper else 0.0
    bumper = [(u, floor, s.cladding + 0.03) for u in (-1.25, *_even(9), 1.25)]
    body.panel(builder, _REAR, bumper, Material.PLASTIC_DARK, raised=0.003 + ledge)
    if s.spare:
        center = (f.center_x - f.half_length - 0.085, 0.0, 0.49 * f.height)
        add_spare(builder, center, 0.88 * f.wheel_radius)
        return
    skid = [(u * 0.40, floor - 0.002, floor + 0.045) for u in _even(5)]
    body.panel(builder, _REAR, skid, Material.PAINT_GREY, raised=0.014 + ledge, rows=1)
    if s.tails is not Tails.STRIP:
        strip = [(u * (s.tail_lamp[0] - 0.01), plate + 0.075, plate + 0.10) for u in _even(5)]
        body.panel(builder, _REAR, strip, Material.RIM, raised=0.013, rows=1)


def add_spare(builder: ShapeBuilder, center: tuple[float, float, float], radius: float) -> None:
    """A wheel on the rear door, its outer side to the rear."""
    half = SPARE_M / 2.0 - 0.005
    profile = [
        (0.001, 0.55), (0.30, 0.55), (0.34, 0.25), (0.58, 0.25), (0.66, 0.90), (0.90, 1.0),
        (1.0, 0.65), (1.0, -1.0),
    ]  # fmt: skip
    turn = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    points = np.array(
        [
            [(-share * half, away * radius * np.cos(a), away * radius * np.sin(a)) for a in turn]
            for away, share in profile
        ]
    )
    rows = uniform(Material.RUBBER, len(profile) - 1, len(turn))
    rows[0], rows[1:3], rows[3] = Material.METAL, Material.RIM, Material.PLASTIC_DARK
    builder.grid(points + np.array(center), rows, closed=True, crease_deg=35)


def _add_high_brake_lamp(builder: ShapeBuilder, body: CarBody) -> None:
    """A bar of red light at the upper edge of the rear window."""
    s = body.shape
    if s.rear_glass is not None:
        top = s.rear_glass[1] + 0.022
        bar = [(u * 0.2, top, top + 0.018) for u in _even(3)]
        body.panel(builder, _REAR, bar, Material.BRAKE_LAMP, raised=0.010, rows=1)
        return
    edge = s.rear_window[1] - 0.05 * (s.rear_window[1] - s.rear_window[0])
    path = [(edge, c) for c in (12.72, 13.0)]
    body.ribbon(builder, path, Material.BRAKE_LAMP, wide=0.03, raised=0.012)


def _add_tail_lamp(builder: ShapeBuilder, body: CarBody, sign: float, blinker: Material) -> None:
    s = body.shape
    y0, y1, z0, z1 = s.tail_lamp
    tail, back = Material.TAIL_LAMP, Material.REVERSE_LAMP
    if s.tails is Tails.STRIP:
        around = [(sign * u, z0 - 0.009, z1 + 0.009) for u in np.linspace(y0, y1, 6)]
        body.panel(builder, _REAR, around, Material.PLASTIC_DARK, raised=0.005)
        line = [(sign * u, z0, z1) for u in np.linspace(y0, y1, 6)]
        body.panel(builder, _REAR, line, tail, raised=0.012, rows=1)
        for first, last, material in ((0.66, 0.80, back), (0.82, 0.98, blinker)):
            edge = [(sign * u, z0 - 0.032, z0 - 0.013) for u in (first, last)]
            body.panel(builder, _REAR, edge, material, raised=0.012, rows=1)
        return
    swept = 0.6 if s.tails is Tails.SWEPT else 0.0
    outline = _lamp_outline(sign, s.tail_lamp, swept)
    grown = [(u, a - 0.010, b + 0.010) for u, a, b in outline]
    body.panel(builder, _REAR, grown, Material.PLASTIC_DARK, raised=0.005)
    body.panel(builder, _REAR, outline, tail, raised=0.010)
    if s.tails is Tails.SWEPT:
        inner = [(sign * u, *_between(outline, sign * u)) for u in (y0 + 0.03, y0 + 0.14)]
        body.panel(builder, _REAR, _slice(inner, 0.20, 0.46), back, raised=0.014, rows=1)
        spans = [(0.32, 0.44)]
    else:
        body.panel(builder, _REAR, _slice(outline[:3], 0.10, 0.22), back, raised=0.014, rows=1)
        spans = [(0.44, 0.54)]
    for low, high in spans:
        first = 1 if s.tails is Tails.SWEPT else 0
        body.panel(
            builder, _REAR, _slice(outline[first:], low, high), blinker, raised=0.014, rows=1
        )
    body.panel(
        builder, _REAR, _slice(outline, 0.66, 0.70), Material.PLASTIC_DARK, raised=0.013, rows=1
    )


def _add_plate(builder: ShapeBuilder, body: CarBody, end: float, z: float, number: str) -> None:
    """A plate in the middle of a face."""
    # Plates are flat: they stand where the face does in its middle, before bars and within the box.
    f = body.frame
    x = float(body.on_face(end, np.zeros(1), np.array([z]), 0.034 if end > 0 else 0.022)[0, 0])
    most = f.center_x + end * (f.half_length - 0.006)
    add_number_plate(builder, min(x, most) if end > 0 else x, end, z, number)


def add_number_plate(builder: ShapeBuilder, x: float, end: float, z: float, number: str) -> None:
    """Add an upright plate with its number and a coloured end.

    Args:
        builder: receives it.
        x, z: of its middle, metres.
        end: where it looks to, 1 ahead and -1 behind.
        number: what it says.
    """
    half, tall = PLATE_HALF_M

    def place(along: Array, up: Array) -> Array:
        return np.stack([np.full_like(along, x), -end * along, z + up], axis=-1)

    corners = np.array([(-half, -tall), (half, -tall), (half, tall), (-half, tall)])
    quad = [(0, 1, 2), (0, 2, 3)]
    builder.add(place(*corners.T), quad, Material.LICENCE_PLATE)

    def before(along: Array, up: Array) -> Array:
        points = place(along, up)
        points[:, 0] += end * 0.002
        return points

    band = np.array([(-half, -tall), (-half + 0.04, -tall), (-half + 0.04, tall), (-half, tall)])
    builder.add(before(*band.T), quad, Material.SIGN_BLUE)
    if builder.coarse:
        return
    add_text(
        builder, number, 0.075, lambda along, up: before(along + 0.02, up), Material.PAINT_BLACK
    )
