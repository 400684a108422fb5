"""Buildings: a box with facades, a roof, and what stands on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from carstage_sim.content.facades import (
    FacadeStyle,
    Quads,
    Wall,
    WallDrawing,
    draw_front,
    draw_plain,
)
from carstage_sim.content.solids import box
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, merge_meshes

_PARAPET_M = 0.8
_PARAPET_WIDTH_M = 0.3
_EAVES_M = 0.5


@dataclass(frozen=True, slots=True)
class BuildingKind:
    """A style and the heights that it is built in."""

    name: str
    style: FacadeStyle
    floors: tuple[int, int]
    """Fewest and most, the ground floor included."""


BUILDING_KINDS: tuple[BuildingKind, ...] = (
    BuildingKind(
        "BrickHouse",
        FacadeStyle(
            Material.BRICK, Material.CONCRETE, 2.9, 0.46, 3.3, 4.2, 0.9, 2.7, 0.18, 0, True, "flat"
        ),
        (3, 6),
    ),
    BuildingKind(
        "PlasterHouse",
        FacadeStyle(
            Material.PLASTER, Material.CONCRETE, 3.0, 0.42, 3.1, 3.4, 0.9, 2.5, 0.15, 3, False,
            "gable",
        ),
        (3, 5),
    ),
    BuildingKind(
        "CornerShop",
        FacadeStyle(
            Material.PLASTER, Material.WOOD, 2.6, 0.44, 3.2, 4.0, 0.7, 2.5, 0.16, 0, True, "hip"
        ),
        (2, 4),
    ),
    BuildingKind(
        "Office",
        FacadeStyle(
            Material.CONCRETE, Material.METAL, 3.6, 0.82, 3.5, 4.5, 0.8, 2.9, 0.12, 0, True, "flat"
        ),
        (4, 8),
    ),
    BuildingKind(
        "BrickFlats",
        FacadeStyle(
            Material.BRICK, Material.PLASTER, 3.2, 0.5, 3.0, 3.2, 0.6, 2.4, 0.2, 2, False, "flat"
        ),
        (4, 7),
    ),
    BuildingKind(
        "GlassTower",
        FacadeStyle(
            Material.METAL, Material.PLASTIC_DARK, 2.4, 0.92, 3.6, 5.0, 0.35, 3.4, 0.06, 0, True,
            "flat",
        ),
        (8, 13),
    ),
)  # fmt: skip


def building_mesh(
    kind: BuildingKind,
    width_m: float,
    depth_m: float,
    floors: int,
    rng: np.random.Generator,
    *,
    detached: bool = True,
    distant: bool = False,
) -> TriangleMesh:
    """A building.

    Args:
        kind: style.
        width_m: length of the front.
        depth_m: from the front to the back.
        floors: storeys, the ground floor included.
        rng: draws shop signs and roof equipment.
        detached: with windows to the sides.
        distant: only ever seen from afar: wide flush windows on all sides.

    Returns:
        A mesh whose origin is the middle of the front's foot; the front looks along +x, and the
        building lies on the side of negative x.
    """
    style, quads, half = kind.style, Quads(), width_m / 2
    if distant:
        style = replace(style, bay_m=2.2 * style.bay_m)
    front = Wall((0.0, -half), (0.0, 1.0), (1.0, 0.0), width_m)
    right = Wall((0.0, half), (-1.0, 0.0), (0.0, 1.0), depth_m)
    back = Wall((-depth_m, half), (0.0, -1.0), (-1.0, 0.0), width_m)
    left = Wall((-depth_m, -half), (1.0, 0.0), (0.0, -1.0), depth_m)
    if distant:
        draw_plain(WallDrawing(front, quads), style, floors, windows=True)
    else:
        draw_front(WallDrawing(front, quads), style, floors, rng)
    draw_plain(WallDrawing(right, quads), style, floors, windows=detached)
    draw_plain(WallDrawing(left, quads), style, floors, windows=detached)
    draw_plain(WallDrawing(back, quads), style, floors, windows=True)
    top = style.ground_floor_m + (floors - 1) * style.floor_m
    parts: list[TriangleMesh] = []
    if style.roof == "flat":
        _flat_roof(quads, style, width_m, depth_m, top)
        parts = _roof_equipment(width_m, depth_m, top, rng)
    else:
        _pitched_roof(quads, style, width_m, depth_m, top)
        parts = [_chimney(width_m, depth_m, top, rng)]
    return merge_meshes([quads.mesh(), *parts])


def _flat_roof(
    quads: Quads, style: FacadeStyle, width_m: float, depth_m: float, top: float
) -> None:
    """A parapet around a deck."""
    outer = [(0.0, -width_m / 2), (0.0, width_m / 2), (-depth_m, width_m / 2)]
    outer.append((-depth_m, -width_m / 2))
    w = _PARAPET_WIDTH_M
    inner = [(-w, -width_m / 2 + w), (-w, width_m / 2 - w), (-depth_m + w, width_m / 2 - w)]
    inner.append((-depth_m + w, -width_m / 2 + w))
    rim = top + _PARAPET_M
    for i in range(4):
        (ax, ay), (bx, by) = outer[i], outer[(i + 1) % 4]
        (cx, cy), (dx, dy) = inner[(i + 1) % 4], inner[i]
        quads.add(style.wall, (ax, ay, top), (bx, by, top), (bx, by, rim), (ax, ay, rim))
        quads.add(style.trim, (ax, ay, rim), (bx, by, rim), (cx, cy, rim), (dx, dy, rim))
        quads.add(style.wall, (cx, cy, top), (dx, dy, top), (dx, dy, rim), (cx, cy, rim))
    a, b, c, d = ((x, y, top) for x, y in inner)
    quads.add(Material.ROOF, a, b, c, d)


def _pitched_roof(
    quads: Quads, style: FacadeStyle, width_m: float, depth_m: float, top: float
) -> None:
    """A gable or hip roof whose ridge runs along the front."""
    half, e = width_m / 2, _EAVES_M
    ridge = top + min(0.35 * depth_m, 4.5)
    drop = (ridge - top) * e / (depth_m / 2)
    inset = 0.0 if style.roof == "gable" else min(depth_m / 2, half * 0.8)
    x = -depth_m / 2
    low = top - drop
    end = e if style.roof == "hip" else 0.3
    ridge_end = half + end - inset if style.roof == "hip" else half + end
    a, b = (e, -half - end, low), (e, half + end, low)
    c, d = (-depth_m - e, half + end, low), (-depth_m - e, -half - end, low)
    r0, r1 = (x, -ridge_end, ridge), (x, ridge_end, ridge)
    quads.add(Material.ROOF, a, b, r1, r0)
    quads.add(Material.ROOF, c, d, r0, r1)
    if style.roof == "hip":
        quads.add(Material.ROOF, b, c, r1, r1)
        quads.add(Material.ROOF, d, a, r0, r0)
        quads.add(style.trim, a, b, c, d)
        return
    for y in (-half, half):
        quads.add(style.wall, (0.0, y, top), (-depth_m, y, top), (x, y, ridge), (x, y, ridge))
    # Undersides of the eaves, so that nobody looks into the roof from the street.
    quads.add(style.trim, a, b, (0.0, half + end, low), (0.0, -half - end, low))
    quads.add(style.trim, c, d, (-depth_m, -half - end, low), (-depth_m, half + end, low))


def _roof_equipment(
    width_m: float, depth_m: float, top: float, rng: np.random.Generator
) -> list[TriangleMesh]:
    """A stair head and some machines, clear of the parapet."""
    tag = CityObjectLabel.BUILDINGS
    parts = [
        box(
            (-depth_m * 0.6, float(rng.uniform(-0.2, 0.2)) * width_m, top + 1.4),
            (1.8, 1.5, 1.4),
            Material.CONCRETE,
            tag,
        )
    ]
    for _ in range(int(rng.integers(1, 4))):
        place = (
            -float(rng.uniform(0.2, 0.45)) * depth_m,
            float(rng.uniform(-0.35, 0.35)) * width_m,
            top + 0.55,
        )
        parts.append(box(place, (0.8, 0.6, 0.55), Material.METAL, tag))
    return parts


def _chimney(width_m: float, depth_m: float, top: float, rng: np.random.Generator) -> TriangleMesh:
    ridge = top + min(0.35 * depth_m, 4.5)
    y = float(rng.uniform(-0.3, 0.3)) * width_m
    return box(
        (-depth_m * 0.42, y, (top + ridge + 0.9) / 2),
        (0.35, 0.5, (ridge + 0.9 - top) / 2),
        Material.BRICK,
        CityObjectLabel.BUILDINGS,
    )
