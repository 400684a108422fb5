"""Shapes for CARLA's static props, each inside its blueprint's box.

A prop is told by the stem of its name: ``bench01`` and ``bench02`` are both a bench.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh

Vector = tuple[float, float, float]
Shape = Callable[[ShapeBuilder, Vector], None]
"""Adds a prop of half sizes ``(3,)``, its origin in the middle of its base."""

_LEG_M = 0.05


def prop_mesh(type_id: str, extent: Vector) -> TriangleMesh:
    """A prop in its actor's frame, origin in the middle of its base; the box is its size.

    Args:
        type_id: blueprint id, ``static.prop.*``; an unknown one becomes a wooden box.
        extent: half sizes of the bounding box, metres.
    """
    stem = type_id.rpartition(".")[2].rstrip("0123456789_")
    builder = ShapeBuilder(CityObjectLabel.STATIC)
    _SHAPES.get(stem, _crate)(builder, extent)
    return builder.mesh()


def _crate(builder: ShapeBuilder, extent: Vector, material: Material = Material.WOOD) -> None:
    hx, hy, hz = extent
    builder.box((-hx, -hy, 0.0), (hx, hy, 2.0 * hz), material)


def _cabinet(
    builder: ShapeBuilder, extent: Vector, *, body: Material, front: Material = Material.GLASS_DARK
) -> None:
    """A machine or a kiosk: a body with a roof that overhangs and a front of another material."""
    hx, hy, hz = extent
    top = 2.0 * hz
    builder.box((-0.95 * hx, -0.95 * hy, 0.0), (0.93 * hx, 0.95 * hy, 0.94 * top), body)
    builder.box((0.93 * hx, -0.85 * hy, 0.3 * top), (0.97 * hx, 0.85 * hy, 0.88 * top), front)
    builder.box((-hx, -hy, 0.94 * top), (hx, hy, top), body)


def _cone(builder: ShapeBuilder, extent: Vector) -> None:
    hx, hy, hz = extent
    top = 2.0 * hz
    builder.box((-hx, -hy, 0.0), (hx, hy, 0.08 * top), Material.PLASTIC_DARK)
    for low, high, material in (
        (0.08, 0.40, Material.SIGN_RED),
        (0.40, 0.62, Material.SIGN_WHITE),
        (0.62, 1.00, Material.SIGN_RED),
    ):
        ends = [0.80 * hx * (1.0 - 0.85 * share) for share in (low, high)]
        builder.limb([(0, 0, low * top), (0, 0, high * top)], ends, material, sides=12)


def _drum(
    builder: ShapeBuilder,
    extent: Vector,
    material: Material = Material.METAL,
    outline: tuple[tuple[float, float], ...] = (
        (0.0, 0.86), (0.05, 0.9), (0.9, 1.0), (0.96, 1.0), (1.0, 0.7),
    ),
) -> None:  # fmt: skip
    """A round body; ``outline`` gives shares of its height and of its radius."""
    hx, hy, hz = extent
    wide = 0.98 * min(hx, hy)
    path = [(0, 0, share * 2.0 * hz) for share, _ in outline]
    builder.limb(path, [wide * share for _, share in outline], material, sides=14)


def _sack(builder: ShapeBuilder, extent: Vector, material: Material) -> None:
    outline = ((0.0, 0.7), (0.15, 0.95), (0.45, 1.0), (0.75, 0.7), (0.88, 0.25), (1.0, 0.3))
    _drum(builder, extent, material, outline)


def _heap(builder: ShapeBuilder, extent: Vector, material: Material) -> None:
    """Things thrown together: a low mound and pieces of other materials that stick out of it."""
    hx, hy, hz = extent
    top = 2.0 * hz
    outline = ((0.0, 1.0), (0.4, 0.8), (0.8, 0.45), (1.0, 0.1))
    _drum(builder, extent, material, outline)
    for number, piece in enumerate((Material.PLASTIC_DARK, Material.SIGN_WHITE, Material.WOOD)):
        x, y = ((0.5, 0.1), (-0.3, 0.5), (-0.2, -0.5))[number]
        low = (x * hx - 0.2 * hx, y * hy - 0.2 * hy, 0.0)
        builder.box(low, (low[0] + 0.4 * hx, low[1] + 0.4 * hy, (0.6 + 0.1 * number) * top), piece)


def _pot(builder: ShapeBuilder, extent: Vector) -> None:
    """A pot with a plant."""
    hx, hy, hz = extent
    outline = ((0.0, 0.6), (0.3, 0.8), (0.34, 0.8), (0.35, 0.4))
    _drum(builder, extent, Material.BRICK, outline)
    wide = 0.98 * min(hx, hy)
    path = [(0, 0, share * 2.0 * hz) for share in (0.35, 0.55, 0.8, 1.0)]
    builder.limb(path, [0.3 * wide, wide, 0.8 * wide, 0.15 * wide], Material.FOLIAGE, sides=9)


def _barrier(builder: ShapeBuilder, extent: Vector) -> None:
    """A board with red and white stripes on two legs."""
    hx, hy, hz = extent
    top = 2.0 * hz
    for sign in (-1.0, 1.0):
        foot = sorted((sign * 0.8 * hx, sign * 0.7 * hx))
        builder.box((foot[0], -hy, 0.0), (foot[1], hy, 0.06), Material.METAL)
        builder.box((foot[0], -0.03, 0.0), (foot[1], 0.03, top), Material.METAL)
    for k in range(8):
        x = -hx + k * hx / 4
        material = Material.SIGN_RED if k % 2 else Material.SIGN_WHITE
        builder.box((x, -0.02, 0.62 * top), (x + hx / 4, 0.02, 0.95 * top), material)


def _bench(builder: ShapeBuilder, extent: Vector) -> None:
    hx, hy, hz = extent
    top = 2.0 * hz
    for x, low, high in ((0.0, 0.50, 0.55), (-0.9 * hx, 0.55, 1.0)):
        half = 0.08 * hx if x else 0.9 * hx
        builder.box((x - half, -hy, low * top), (x + half, hy, high * top), Material.WOOD)
    for y in (-0.8 * hy, 0.8 * hy):
        builder.box((-0.8 * hx, y - 0.03, 0.0), (0.8 * hx, y + 0.03, 0.5 * top), Material.METAL)


def _legs(builder: ShapeBuilder, extent: Vector, height: float, material: Material) -> None:
    hx, hy, _ = extent
    thick = min(_LEG_M, 0.2 * hx, 0.2 * hy)
    for x in (-0.85 * hx, 0.85 * hx - thick):
        for y in (-0.85 * hy, 0.85 * hy - thick):
            builder.box((x, y, 0.0), (x + thick, y + thick, height), material)


def _table(builder: ShapeBuilder, extent: Vector, material: Material = Material.WOOD) -> None:
    hx, hy, hz = extent
    top = 2.0 * hz
    _legs(builder, extent, 0.94 * top, material)
    builder.box((-hx, -hy, 0.94 * top), (hx, hy, top), material)


def _chair(builder: ShapeBuilder, extent: Vector, material: Material) -> None:
    hx, hy, hz = extent
    top = 2.0 * hz
    _legs(builder, extent, 0.48 * top, material)
    builder.box((-hx, -hy, 0.48 * top), (hx, hy, 0.54 * top), material)
    builder.box((-hx, -hy, 0.54 * top), (-0.85 * hx, hy, top), material)


def _canopy(
    builder: ShapeBuilder, extent: Vector, *, roof: Material, back: Material | None = None
) -> None:
    """A roof on four posts, with a back wall if a material is given."""
    hx, hy, hz = extent
    top = 2.0 * hz
    _legs(builder, extent, 0.94 * top, Material.METAL)
    builder.box((-hx, -hy, 0.94 * top), (hx, hy, top), roof)
    if back is not None:
        wall = (-0.85 * hx, -0.8 * hy, 0.1 * top), (-0.8 * hx, 0.8 * hy, 0.9 * top)
        builder.box(*wall, back)
        builder.box((-0.78 * hx, -0.6 * hy, 0.18 * top), (-0.4 * hx, 0.6 * hy, 0.2 * top),
                    Material.WOOD)  # fmt: skip


def _board(builder: ShapeBuilder, extent: Vector, face: Material = Material.SIGN_WHITE) -> None:
    """A board on a pole, as of signs and advertisements."""
    hx, hy, hz = extent
    top = 2.0 * hz
    pole = min(0.06, hx, hy)
    builder.box((-pole, -pole, 0.0), (pole, pole, 0.6 * top), Material.METAL)
    builder.box((-hx, -hy, 0.55 * top), (hx, hy, top), Material.METAL)
    builder.box((0.6 * hx, -0.92 * hy, 0.58 * top), (hx, 0.92 * hy, 0.98 * top), face)


def _lamp(builder: ShapeBuilder, extent: Vector) -> None:
    hx, hy, hz = extent
    top = 2.0 * hz
    thick = 0.3 * min(hx, hy)
    builder.box((-thick, -thick, 0.0), (thick, thick, 0.8 * top), Material.METAL)
    builder.box((-hx, -hy, 0.8 * top), (hx, hy, 0.97 * top), Material.STREET_LAMP)
    builder.box((-hx, -hy, 0.97 * top), (hx, hy, top), Material.METAL)


def _fountain(builder: ShapeBuilder, extent: Vector) -> None:
    outline = ((0.0, 1.0), (0.25, 1.0), (0.26, 0.9), (0.27, 0.12), (0.7, 0.1), (0.72, 0.45),
               (0.8, 0.5), (0.81, 0.08), (1.0, 0.05))  # fmt: skip
    _drum(builder, extent, Material.CONCRETE, outline)


def _frame(builder: ShapeBuilder, extent: Vector, seat: Material = Material.WOOD) -> None:
    """Two posts, a beam and a seat between them, as of a swing."""
    hx, hy, hz = extent
    top = 2.0 * hz
    for y in (-0.95 * hy, 0.95 * hy):
        builder.limb([(-0.9 * hx, y, 0.03), (0.0, y, 0.97 * top)], [0.04, 0.04], Material.METAL)
        builder.limb([(0.9 * hx, y, 0.03), (0.0, y, 0.97 * top)], [0.04, 0.04], Material.METAL)
    builder.box((-0.05, -hy, 0.94 * top), (0.05, hy, top), Material.METAL)
    for y in (-0.4 * hy, 0.4 * hy):
        builder.box((-0.01, y - 0.01, 0.25 * top), (0.01, y + 0.01, 0.94 * top), Material.METAL)
    builder.box((-0.2 * hx, -0.45 * hy, 0.22 * top), (0.2 * hx, 0.45 * hy, 0.25 * top), seat)


def _slide(builder: ShapeBuilder, extent: Vector) -> None:
    hx, hy, hz = extent
    top = 2.0 * hz
    corners = [(0.95 * hx, -hy, 0.05 * top), (0.95 * hx, hy, 0.05 * top),
               (-0.4 * hx, hy, 0.75 * top), (-0.4 * hx, -hy, 0.75 * top)]  # fmt: skip
    builder.add(corners, [(0, 1, 2), (0, 2, 3), (0, 2, 1), (0, 3, 2)], Material.PAINT_RED)
    builder.box((-hx, -hy, 0.7 * top), (-0.4 * hx, hy, 0.75 * top), Material.METAL)
    for y in (-hy, hy - _LEG_M):
        builder.box((-hx, y, 0.0), (-hx + _LEG_M, y + _LEG_M, top), Material.METAL)


def _hoops(builder: ShapeBuilder, extent: Vector) -> None:
    """Hoops in a row, as for bicycles."""
    hx, hy, hz = extent
    top = 2.0 * hz
    thick = 0.025
    for share in (-0.9, -0.3, 0.3, 0.9):
        y = share * (hy - thick)
        for x in (-0.9 * hx, 0.9 * hx):
            builder.box((x - thick, y - thick, 0.0), (x + thick, y + thick, top), Material.METAL)
        builder.box((-0.9 * hx, y - thick, top - 2 * thick), (0.9 * hx, y + thick, top),
                    Material.METAL)  # fmt: skip


def _cart(builder: ShapeBuilder, extent: Vector, body: Material) -> None:
    """A basket on wheels with a handle."""
    hx, hy, hz = extent
    top = 2.0 * hz
    for x in (-0.7 * hx, 0.7 * hx):
        for y in (-0.8 * hy, 0.8 * hy):
            builder.box((x - 0.03, y - 0.02, 0.0), (x + 0.03, y + 0.02, 0.1 * top), Material.RUBBER)
    builder.box((-0.85 * hx, -hy, 0.1 * top), (hx, hy, 0.75 * top), body)
    builder.box((-hx, -hy, 0.75 * top), (-0.9 * hx, hy, top), Material.PLASTIC_DARK)


_BALL = ((0.0, 0.4), (0.2, 0.85), (0.5, 1.0), (0.8, 0.8), (1.0, 0.2))
_FIGURE = ((0.0, 0.9), (0.25, 1.0), (0.5, 0.7), (0.6, 0.6), (0.75, 0.65), (1.0, 0.05))
_CUSHION = ((0.0, 1.0), (0.75, 1.0), (0.8, 0.97), (1.0, 0.95))

_SHAPES: dict[str, Shape] = {
    "advertisement": _board,
    "atm": partial(_cabinet, body=Material.PAINT_BLUE),
    "barbeque": partial(_table, material=Material.METAL),
    "barrel": _drum,
    "bench": _bench,
    "bike helmet": partial(_drum, material=Material.PLASTIC_DARK, outline=_BALL),
    "bikeparking": _hoops,
    "bin": partial(_drum, material=Material.PLASTIC_DARK),
    "briefcase": partial(_crate, material=Material.PLASTIC_DARK),
    "brokentile": partial(_crate, material=Material.BRICK),
    "busstop": partial(_canopy, roof=Material.METAL, back=Material.GLASS),
    "busstoplb": partial(_canopy, roof=Material.METAL, back=Material.GLASS),
    "calibrator": _board,
    "chainbarrier": _barrier,
    "chainbarrierend": _barrier,
    "clothcontainer": partial(_cabinet, body=Material.PAINT_GREY, front=Material.SIGN_WHITE),
    "clothesline": _frame,
    "colacan": partial(_drum, material=Material.PAINT_RED),
    "constructioncone": _cone,
    "container": partial(_crate, material=Material.METAL),
    "creasedbox": _crate,
    "dirtdebris": partial(_heap, material=Material.SOIL),
    "doghouse": partial(_cabinet, body=Material.WOOD, front=Material.PLASTIC_DARK),
    "fountain": _fountain,
    "foodcart": partial(_canopy, roof=Material.PAINT_RED, back=Material.WOOD),
    "garbage": partial(_heap, material=Material.PLASTIC_DARK),
    "gardenlamp": _lamp,
    "glasscontainer": partial(_drum, material=Material.PAINT_BLUE),
    "gnome": partial(_drum, material=Material.PAINT_RED, outline=_FIGURE),
    "guitarcase": partial(_crate, material=Material.PLASTIC_DARK),
    "haybale": partial(_crate, material=Material.SOIL),
    "haybalelb": partial(_crate, material=Material.SOIL),
    "ironplank": partial(_crate, material=Material.METAL),
    "kiosk": partial(_cabinet, body=Material.WOOD),
    "mailbox": partial(_cabinet, body=Material.PAINT_BLUE, front=Material.SIGN_WHITE),
    "maptable": _board,
    "mobile": partial(_crate, material=Material.PLASTIC_DARK),
    "motorhelmet": partial(_drum, material=Material.PAINT_RED, outline=_BALL),
    "omri": _board,
    "pergola": partial(_canopy, roof=Material.WOOD),
    "plantpot": _pot,
    "plasticbag": partial(_sack, material=Material.PLASTIC_DARK),
    "plasticchair": partial(_chair, material=Material.PAINT_WHITE),
    "plastictable": partial(_table, material=Material.PAINT_WHITE),
    "platformgarbage": partial(_crate, material=Material.CONCRETE),
    "purse": partial(_sack, material=Material.PAINT_RED),
    "shop": partial(_cabinet, body=Material.PLASTER),
    "shoppingbag": partial(_sack, material=Material.SIGN_WHITE),
    "shoppingcart": partial(_cart, body=Material.METAL),
    "shoppingtrolley": partial(_cart, body=Material.PAINT_BLUE),
    "slide": _slide,
    "streetbarrier": _barrier,
    "streetfountain": _fountain,
    "streetsign": _board,
    "swing": _frame,
    "swingcouch": partial(_canopy, roof=Material.PLASTER, back=Material.WOOD),
    "table": _table,
    "trafficcone": _cone,
    "trafficwarning": _barrier,
    "trampoline": partial(_drum, material=Material.PLASTIC_DARK, outline=_CUSHION),
    "trashbag": partial(_sack, material=Material.PLASTIC_DARK),
    "trashcan": _drum,
    "travelcase": partial(_crate, material=Material.PAINT_BLUE),
    "vendingmachine": partial(_cabinet, body=Material.PAINT_RED),
    "warningaccident": _board,
    "warningconstruction": _barrier,
    "wateringcan": partial(_drum, material=Material.METAL),
}
