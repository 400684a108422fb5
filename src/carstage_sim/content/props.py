"""Simple shapes for static props, inside their blueprint's box."""

from __future__ import annotations

from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh

Vector = tuple[float, float, float]

_STRIPES = {
    "trafficcone01": Material.SIGN_RED,
    "trafficcone02": Material.SIGN_RED,
    "constructioncone": Material.SIGN_RED,
}
_ROUND = {
    "barrel": Material.METAL,
    "bin": Material.PLASTIC_DARK,
    "trashcan01": Material.METAL,
    "plasticbag": Material.PLASTIC_DARK,
}
_BOARDS = ("chainbarrier", "streetbarrier", "trafficwarning", "warningconstruction")


def prop_mesh(type_id: str, extent: Vector) -> TriangleMesh:
    """A prop in its actor's frame, origin in the middle of its base; the box is its size.

    Args:
        type_id: blueprint id, ``static.prop.*``; an unknown one becomes a wooden box.
        extent: half sizes of the bounding box, metres.
    """
    name = type_id.rpartition(".")[2]
    hx, hy, hz = extent
    top = 2.0 * hz
    builder = ShapeBuilder(CityObjectLabel.STATIC)
    if name in _STRIPES:
        builder.box((-hx, -hy, 0.0), (hx, hy, 0.08 * top), Material.PLASTIC_DARK)
        for low, high, material in (
            (0.08, 0.40, _STRIPES[name]),
            (0.40, 0.62, Material.SIGN_WHITE),
            (0.62, 1.00, _STRIPES[name]),
        ):
            ends = [0.80 * hx * (1.0 - 0.85 * share) for share in (low, high)]
            builder.limb([(0, 0, low * top), (0, 0, high * top)], ends, material, sides=12)
    elif name in _ROUND:
        wide = 0.98 * min(hx, hy)
        path = [(0, 0, share * top) for share in (0.0, 0.05, 0.9, 0.96, 1.0)]
        radii = [wide * share for share in (0.86, 0.9, 1.0, 1.0, 0.7)]
        builder.limb(path, radii, _ROUND[name], sides=14)
    elif name in _BOARDS:
        for sign in (-1.0, 1.0):
            foot = sorted((sign * 0.8 * hx, sign * 0.7 * hx))
            builder.box((foot[0], -hy, 0.0), (foot[1], hy, 0.06), Material.METAL)
            builder.box((foot[0], -0.03, 0.0), (foot[1], 0.03, top), Material.METAL)
        for k in range(8):
            x = -hx + k * hx / 4
            material = Material.SIGN_RED if k % 2 else Material.SIGN_WHITE
            builder.box((x, -0.02, 0.62 * top), (x + hx / 4, 0.02, 0.95 * top), material)
    elif name == "bench01":
        for x, low, high in ((0.0, 0.50, 0.55), (-0.9 * hx, 0.55, 1.0)):
            builder.box(
                (x - (0.08 * hx if x else 0.9 * hx), -hy, low * top),
                (x + (0.08 * hx if x else 0.9 * hx), hy, high * top),
                Material.WOOD,
            )
        for sign in (-0.8, 0.8):
            builder.box(
                (-0.8 * hx, sign * hy - 0.03, 0.0), (0.8 * hx, sign * hy + 0.03, 0.5 * top),
                Material.METAL,
            )  # fmt: skip
    else:
        material = Material.METAL if name == "container" else Material.WOOD
        builder.box((-hx, -hy, 0.0), (hx, hy, top), material)
    return builder.mesh()
