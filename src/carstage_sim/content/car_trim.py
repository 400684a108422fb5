"""What stands on a lofted body's skin: joints of doors and lids, wipers, strips, rails, mirrors."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.car_body import COWL, CarBody
from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.mesh import Material

_OFF_SKIN_M = 0.005
"""How far joints of doors lie before the skin: it is flat between sections, they are not."""
_BORDER_M = 0.05
"""Width of the black print round a screen."""
_BORDER_STEP_M = 0.15
"""Longest quad of that print."""


def add_trim(builder: ShapeBuilder, body: CarBody) -> None:
    """Add all that stands on the skin of a body whose skin is there already."""
    s = body.shape
    _add_doors(builder, body)
    _add_lids(builder, body)
    if not s.faceted:
        _add_window_strips(builder, body)
        _add_screen_borders(builder, body)
    if s.rails:
        _add_rails(builder, body)
    if s.tall_mirrors:
        _add_tall_mirrors(builder, body)
    elif s.mirrors:
        _add_mirrors(builder, body)


def _add_doors(builder: ShapeBuilder, body: CarBody) -> None:
    """Seams below the pillars and at the windows' ends, and a handle before each seam."""
    s, f = body.shape, body.frame
    seams = [s.side_glass[1] - 0.03, *s.pillars]
    for number, seam in enumerate(sorted(seams)):
        half = body.section(seam)[body.SILL : body.BELT + 1]
        # A rear door ends on the arch; ahead of the front one is no door.
        over_arch = half[0, 1] > (s.clearance + 0.08) * f.height
        if over_arch and seam > 0.0:
            continue
        for sign in (-1.0, 1.0):
            y = sign * (half[:, 0] + _OFF_SKIN_M)
            line = [
                body.place(np.full(len(y), seam + shift / f.half_length), y, half[:, 1])
                for shift in (-0.005, 0.005)
            ]
            builder.grid(np.stack(line), Material.PLASTIC_DARK)
            if number == len(seams) - 1:
                continue
            grip = body.belt(seam) - 0.09
            skin = float(body.across(seam, np.array(grip)))
            side = sorted((sign * (skin - 0.02), sign * (skin + 0.016)))
            x = f.center_x + seam * f.half_length + 0.06
            builder.box(
                (x, side[0], grip - 0.012), (x + 0.17, side[1], grip + 0.012), Material.PAINT
            )


def _add_lids(builder: ShapeBuilder, body: CarBody) -> None:
    """Seams of the bonnet and the boot, wipers, door handles' line."""
    s = body.shape
    dark = Material.PLASTIC_DARK
    foot = s.windscreen[1] + COWL
    shoulder = body.GLASS + 0.05
    if foot < 0.92:
        # A line follows the skin where it has its corners: on sections and columns.
        stations = body.stations()
        # Its front edge is where it bends down: who looks along a line sees dashes.
        end = float(stations[stations < 0.99][-1])
        sides = [(x, shoulder) for x in (foot, *stations[(stations > foot) & (stations < end)])]
        lid = [(end, c) for c in (shoulder, *range(body.GLASS + 1, body.MIDDLE + 1))]
        body.ribbon(builder, [*sides, *lid], dark, wide=0.014, raised=0.008)
    if s.boot:
        start = s.rear_window[0] - 0.01
        stations = body.stations()
        inner = stations[(stations > -0.985) & (stations < start)][::-1]
        sides = [(x, shoulder) for x in (start, *inner, -0.985)]
        body.ribbon(builder, sides, dark)
    low, high = s.windscreen[1], s.windscreen[0]
    for first, last, sign in ((0.10, 0.80, 1.0), (0.55, 0.05, -1.0)):
        # The blade rests along the foot of the pane.
        x0, x1 = (low - share * 0.16 * (low - high) for share in (0.2, 1.0))
        columns = body.MIDDLE - (body.MIDDLE - body.ROOF) * np.array([first, last])
        blade = [(x0, float(columns[0])), (x1, float(columns[1]))]
        body.ribbon(builder, blade, dark, wide=0.025, raised=0.012, sides=(sign,))


def _add_mirrors(builder: ShapeBuilder, body: CarBody) -> None:
    """Two mirrors at the front end of the side windows, out to the box's sides."""
    s, f = body.shape, body.frame
    x = f.center_x + (s.side_glass[1] - 0.05) * f.half_length
    z = body.belt(s.side_glass[1]) + 0.07
    door = body.beside(s.side_glass[1]) * 0.93
    out = max(f.reach - 0.005, door + 0.08)
    wide = min(0.24, out - door)
    for sign in (-1.0, 1.0):
        builder.limb(
            [
                (x, sign * (out - wide), z),
                (x, sign * (out - wide * 0.8), z + 0.01),
                (x, sign * (out - wide * 0.25), z + 0.012),
                (x, sign * out, z + 0.005),
            ],
            [0.03, 0.085, 0.085, 0.04],
            Material.PAINT,
            squash=0.75,
        )


def _add_window_strips(builder: ShapeBuilder, body: CarBody) -> None:
    """Strips below and above the side windows; an SUV's lower one is bright."""
    s = body.shape
    first, last = s.side_glass
    bright = Material.RIM if s.rails else Material.PLASTIC_DARK
    for column, material in ((body.BELT + 0.5, bright), (body.RAIL, Material.PLASTIC_DARK)):
        line = [(x, column) for x in np.linspace(first, last, 6)]
        body.ribbon(builder, line, material, wide=0.022, raised=0.004)


def _add_screen_borders(builder: ShapeBuilder, body: CarBody) -> None:
    """The black print along the edges of windscreen and rear window that hides their glue."""
    s, length = body.shape, body.frame.half_length
    half = _BORDER_M / 2.0 / length
    for lower, upper in ((s.windscreen[1], s.windscreen[0]), s.rear_window):
        if abs(lower) > 1.0:
            continue
        towards = half if upper < lower else -half
        count = 2 + int(abs(upper - lower) * length / _BORDER_STEP_M)
        edge = [(x, body.ROOF + 0.05) for x in np.linspace(lower, upper + towards, count)]
        top = [(upper + towards, c) for c in np.linspace(body.ROOF + 0.05, body.MIDDLE, 5)]
        body.ribbon(builder, [*edge, *top[1:]], Material.PLASTIC_DARK, wide=_BORDER_M, raised=0.006)


def _add_rails(builder: ShapeBuilder, body: CarBody) -> None:
    """Rails along the roof's edges."""
    s = body.shape
    first = s.side_glass[0]
    x = np.linspace(first + 0.06, s.windscreen[0] - 0.06, 5)
    line = body.skin(x, np.full(len(x), body.ROOF - 0.35))
    line[1:-1, 2] += 0.024
    radii = [0.018, 0.02, 0.02, 0.02, 0.018]
    for sign in (-1.0, 1.0):
        builder.limb(line * np.array([1.0, sign, 1.0]), radii, Material.RIM, sides=4)


def _add_tall_mirrors(builder: ShapeBuilder, body: CarBody) -> None:
    """Upright mirrors on arms before the windscreen's upper corners, within the box."""
    s, f = body.shape, body.frame
    top = body.roof(s.windscreen[0]) - 0.05 * f.height
    low = top - 0.24 * f.height
    for sign in (-1.0, 1.0):
        edge = body.skin(np.array([s.windscreen[0]]), np.array([float(body.ROOF)]))[0]
        out = sign * (f.reach - 0.005)
        across = sorted((out, out - sign * min(0.22, 0.12 * f.half_width)))
        x = edge[0] + 0.10
        case = ((x, across[0], low), (x + 0.09, across[1], top))
        builder.box(*case, Material.PLASTIC_DARK)
        arm = [(edge[0] - 0.05, sign * edge[1], top - 0.02), (x + 0.05, out * 0.97, top - 0.02)]
        builder.limb(arm, [0.022, 0.022], Material.PLASTIC_DARK, sides=5)
