"""What is seen through the windows of a body: dashboard, steering wheel, seats, people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carstage_sim.content.car_body import CarBody
from carstage_sim.content.lofting import Array, ShapeBuilder
from carstage_sim.content.solids import quads_to_triangles
from carstage_sim.mesh import Material

_BEHIND_SCREEN_M = 0.98
_ROW_M = 0.86
_FROM_SKIN_M = 0.04
_BOX_QUADS = np.array(
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
)


@dataclass(frozen=True, slots=True)
class Cabin:
    """What is in a cabin.

    Attributes:
        rows: of seats behind the first one, at most.
        occupied: whether somebody drives.
        passengers: every n-th seat behind is taken; 0 for none.
    """

    rows: int = 1
    occupied: bool = True
    passengers: int = 0


def add_cabin(builder: ShapeBuilder, body: CarBody, cabin: Cabin) -> None:
    """Add the inside of a body, all of it within its skin."""
    parts = ShapeBuilder(0)
    _furnish(parts, body, cabin)
    mesh = parts.mesh()
    points = body.inside(mesh.vertices.astype(np.float64), _FROM_SKIN_M)
    builder.add(points, mesh.triangles, mesh.material)


def _furnish(builder: ShapeBuilder, body: CarBody, cabin: Cabin) -> None:
    s, f = body.shape, body.frame
    # An upright screen has its whole height over its foot.
    screen = s.windscreen[1] if s.windscreen[1] < 0.95 else s.windscreen[0] - 0.01
    foot = f.center_x + screen * f.half_length
    seat_x = foot - min(_BEHIND_SCREEN_M, max(0.55, 0.30 * f.half_length))
    relative = (seat_x - f.center_x) / f.half_length
    head = min(body.roof(relative) - 0.19, body.belt(relative) + 0.36)
    room = float(body.across(relative, np.array(head - 0.05))) - 0.06
    half = min(0.23, 0.46 * room)
    aside = min(0.40 * f.half_width, room - half)
    _add_dashboard(builder, body, foot, seat_x, head)
    _add_wheel(builder, (seat_x + 0.40, -aside, head - 0.34))
    for sign in (-1.0, 1.0):
        _add_seat(builder, seat_x, sign * aside, head, half)
    if cabin.occupied:
        _add_person(builder, seat_x, -aside, head, hands=(seat_x + 0.36, head - 0.30))
    end = f.center_x + max(s.side_glass[0], -0.97) * f.half_length + 0.30
    for row in range(cabin.rows):
        x = seat_x - _ROW_M * (row + 1)
        if x < end:
            break
        top = min(head, body.roof((x - f.center_x) / f.half_length) - 0.20)
        for place, sign in enumerate((-1.0, 1.0)):
            _add_seat(builder, x, sign * aside, top, half * 1.2)
            number = 2 * row + place
            if cabin.passengers and number % cabin.passengers == 1:
                _add_person(builder, x, sign * aside, top - 0.02, hands=None)


def _slab(
    builder: ShapeBuilder,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    half: tuple[float, float],
    material: int,
) -> None:
    """A leaning block between two middles; ``half``: its width and thickness."""
    wide, thick = half
    corners = [
        (x + sx * thick, y + sy * wide, z)
        for x, y, z in (low, high)
        for sy in (-1.0, 1.0)
        for sx in (-1.0, 1.0)
    ]
    builder.add(corners, quads_to_triangles(_BOX_QUADS), material, crease_deg=10)


def _add_seat(builder: ShapeBuilder, x: float, y: float, head: float, half: float) -> None:
    """Cushion, back and head rest of a seat whose user's head is at height ``head``."""
    seat = head - 0.72
    _slab(builder, (x + 0.12, y, seat - 0.10), (x + 0.14, y, seat), (half, 0.24), Material.SEAT)
    _slab(
        builder, (x - 0.13, y, seat), (x - 0.24, y, head - 0.17), (half * 0.95, 0.06), Material.SEAT
    )
    _slab(
        builder, (x - 0.25, y, head - 0.12), (x - 0.26, y, head + 0.07), (half * 0.55, 0.045),
        Material.SEAT,
    )  # fmt: skip


def _add_dashboard(
    builder: ShapeBuilder, body: CarBody, foot: float, seat_x: float, head: float
) -> None:
    f = body.frame
    top = min(body.roof((foot - f.center_x) / f.half_length) - 0.05, head - 0.24)
    front, rear = foot - 0.06, max(foot - 0.55, seat_x + 0.44)
    if front - rear < 0.05:
        front = rear + 0.05
    wide = 0.80 * f.half_width
    middle, half = (front + rear) / 2, (front - rear) / 2
    _slab(
        builder, (middle, 0.0, top - 0.30), (middle, 0.0, top), (wide, half), Material.PLASTIC_DARK
    )
    # The hood over the instruments, and a screen.
    aside = 0.40 * f.half_width
    _slab(
        builder, (rear + 0.05, -aside, top), (rear + 0.07, -aside, top + 0.05), (0.17, 0.05),
        Material.PLASTIC_DARK,
    )  # fmt: skip
    _slab(
        builder, (rear - 0.01, 0.0, top - 0.16), (rear, 0.0, top + 0.01), (0.13, 0.01),
        Material.GLASS_DARK,
    )  # fmt: skip


def _add_wheel(builder: ShapeBuilder, center: tuple[float, float, float]) -> None:
    """A steering wheel that leans towards the driver."""
    turn = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)[:, None]
    ring = np.linspace(0.0, 2 * np.pi, 4, endpoint=False)[None, :]
    away = 0.185 + 0.016 * np.cos(ring)
    across, up = away * np.sin(turn), away * np.cos(turn)
    out = 0.016 * np.sin(ring) + 0 * turn
    lean = np.radians(28.0)
    points = np.stack(
        [
            center[0] + up * np.sin(lean) + out * np.cos(lean),
            center[1] + across,
            center[2] + up * np.cos(lean) - out * np.sin(lean),
        ],
        axis=-1,
    )
    points = np.concatenate([points, points[:1]])
    builder.grid(points, Material.PLASTIC_DARK, closed=True)
    x, y, z = center
    _slab(builder, (x, y, z - 0.05), (x + 0.02, y, z + 0.03), (0.17, 0.012), Material.PLASTIC_DARK)


def _add_person(
    builder: ShapeBuilder,
    x: float,
    y: float,
    head: float,
    *,
    hands: tuple[float, float] | None,
) -> None:
    """Somebody in a seat, seen from the waist up; ``hands``: x and height of a steering wheel.

    Without one the arms lie in the lap, where no window shows them.
    """
    trunk = np.array(
        [(x - 0.04, y, head - 0.66), (x - 0.09, y, head - 0.42), (x - 0.12, y, head - 0.24),
         (x - 0.12, y, head - 0.17)]
    )  # fmt: skip
    builder.limb(trunk, [0.16, 0.19, 0.20, 0.07], Material.CLOTH_UPPER, sides=8, squash=0.6)
    neck = np.array([(x - 0.12, y, head - 0.20), (x - 0.10, y, head - 0.08)])
    builder.limb(neck, [0.055, 0.052], Material.SKIN, sides=6)
    skull = np.array([x - 0.08, y, head]) + np.array([-0.11, -0.06, 0.02, 0.08, 0.11])[:, None] * (
        np.array([0.0, 0.0, 1.0])
    )
    builder.limb(skull, [0.035, 0.065, 0.077, 0.056, 0.02], Material.SKIN, sides=8, squash=1.15)
    hair = np.array([(x - 0.10, y, head), (x - 0.095, y, head + 0.06), (x - 0.09, y, head + 0.12)])
    builder.limb(hair, [0.080, 0.080, 0.03], Material.HAIR, sides=8, squash=1.12)
    if hands is None:
        return
    for sign in (-1.0, 1.0):
        shoulder = np.array([x - 0.12, y + sign * 0.18, head - 0.27])
        hand = np.array([hands[0], y + sign * 0.16, hands[1]])
        _add_arm(builder, shoulder, hand, sign)


def _add_arm(builder: ShapeBuilder, shoulder: Array, hand: Array, sign: float) -> None:
    elbow = (shoulder + hand) / 2 + np.array([-0.04, sign * 0.06, -0.10])
    builder.limb([shoulder, elbow], [0.05, 0.042], Material.CLOTH_UPPER, sides=5)
    wrist = elbow + (hand - elbow) * 0.8
    builder.limb([elbow, wrist], [0.042, 0.032], Material.CLOTH_UPPER, sides=5)
    builder.limb([wrist, hand], [0.032, 0.038], Material.SKIN, sides=5)
