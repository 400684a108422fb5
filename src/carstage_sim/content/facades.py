"""Facades: a grammar of floors and bays that fills a wall with windows, shops, doors, balconies.

A facade is drawn on a plane: u runs along the wall, v up, and the third number is how far a piece
stands out of it (m). :class:`Quads` takes such pieces and puts them on the walls of a building.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.signwriting import written
from carstage_sim.content.solids import quad_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh

_SHOPS = (
    "ORLANE", "CAFE MIRO", "TAVENA", "BOOKS", "MODA VELA", "FLORA", "BISTRO 21", "OPTIK", "PIZZA",
    "BAKERY", "KIOSK", "SHOES", "NORDEN", "HAIR", "PHARMACY", "TEA HOUSE", "FRUIT", "RADIO",
    "LUMARA", "CAFE ANIS", "VINTEO", "PAPER", "KORVELLE", "GALERIA", "SPORT 7", "TAILOR",
)  # fmt: skip
"""Invented names and plain words."""

_CURTAIN_WALL = 0.7
"""Glazing from which a facade has no windows of its own, but glass from bay to bay."""
_EYE_M = 1.6
_PLINTH_M = 0.6
"""As high as nothing else on a facade: shading knows plinths by it."""

UVN = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Wall:
    """A vertical plane: where its lower left corner is and where u and its outside point."""

    corner: tuple[float, float]
    along: tuple[float, float]
    outward: tuple[float, float]
    length_m: float


@dataclass(slots=True)
class Quads:
    """Collects quads of one building."""

    corners: list[tuple[UVN, UVN, UVN, UVN]] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)

    def add(self, material: Material, a: UVN, b: UVN, c: UVN, d: UVN) -> None:
        """One quad by its corners in the building's frame."""
        self.corners.append((a, b, c, d))
        self.materials.append(material)

    def mesh(self, tag: CityObjectLabel = CityObjectLabel.BUILDINGS) -> TriangleMesh:
        """All quads as a mesh."""
        return quad_mesh(np.array(self.corners), np.array(self.materials), tag)


@dataclass(slots=True)
class WallDrawing:
    """Draws on one wall, in u, v and out."""

    wall: Wall
    quads: Quads

    def place(self, u: float, v: float, out: float) -> UVN:
        """A point of the wall's drawing in the building's frame."""
        (x, y), (ax, ay), (nx, ny) = self.wall.corner, self.wall.along, self.wall.outward
        return (x + u * ax + out * nx, y + u * ay + out * ny, v)

    def panel(
        self, material: Material, u0: float, u1: float, v0: float, v1: float, out: float = 0.0
    ) -> None:
        """A rectangle parallel to the wall."""
        p = self.place
        self.quads.add(material, p(u0, v0, out), p(u1, v0, out), p(u1, v1, out), p(u0, v1, out))

    def slab(
        self,
        material: Material,
        u: tuple[float, float],
        v: tuple[float, float],
        out: tuple[float, float],
    ) -> None:
        """A box on the wall, without the face that touches it."""
        p, (u0, u1), (v0, v1), (o0, o1) = self.place, u, v, out
        self.panel(material, u0, u1, v0, v1, o1)
        for at in (v0, v1):
            self.quads.add(material, p(u0, at, o0), p(u1, at, o0), p(u1, at, o1), p(u0, at, o1))
        for at in (u0, u1):
            self.quads.add(material, p(at, v0, o0), p(at, v1, o0), p(at, v1, o1), p(at, v0, o1))

    def opening(
        self,
        pane: Material,
        reveal: Material,
        u: tuple[float, float],
        v: tuple[float, float],
        depth_m: float,
    ) -> None:
        """A pane set back into the wall, with the four sides of the hole; flat without depth."""
        (u0, u1), (v0, v1), p = u, v, self.place
        self.panel(pane, u0, u1, v0, v1, -depth_m)
        if depth_m == 0.0:
            return
        for at in (v0, v1):
            self.quads.add(
                reveal, p(u0, at, 0), p(u1, at, 0), p(u1, at, -depth_m), p(u0, at, -depth_m)
            )
        for at in (u0, u1):
            self.quads.add(
                reveal, p(at, v0, 0), p(at, v1, 0), p(at, v1, -depth_m), p(at, v0, -depth_m)
            )

    def sloped(
        self,
        material: Material,
        u: tuple[float, float],
        low: tuple[float, float],
        high: tuple[float, float],
    ) -> None:
        """A slanted plate such as an awning, between two (v, out) lines."""
        p = self.place
        self.quads.add(
            material,
            p(u[0], *low), p(u[1], *low), p(u[1], *high), p(u[0], *high),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class FacadeStyle:
    """What a building looks like.

    Attributes:
        wall, trim: materials of the walls and of sills, courses and cornices.
        bay_m: wished width of a bay; the real one divides the wall evenly.
        glazing: part of a bay's width that is window.
        floor_m, ground_floor_m: storey heights.
        sill_m, head_m: lower and upper edge of a window above its floor.
        recess_m: depth of the windows of the front.
        balcony_every: every n-th bay of the front has balconies, 0 for none.
        shops: the ground floor is shop windows.
        roof: ``flat``, ``gable`` or ``hip``.
    """

    wall: Material
    trim: Material
    bay_m: float
    glazing: float
    floor_m: float
    ground_floor_m: float
    sill_m: float
    head_m: float
    recess_m: float
    balcony_every: int
    shops: bool
    roof: str


def draw_front(
    drawing: WallDrawing, style: FacadeStyle, floors: int, rng: np.random.Generator
) -> None:
    """The facade to the street with a downpipe, from the ground to the top of the last storey."""
    length = drawing.wall.length_m
    if style.shops:
        _shops(drawing, style, rng)
    else:
        _entrance_floor(drawing, style)
    _storeys(drawing, style, floors, style.recess_m, framed=True)
    _course(drawing, style, style.ground_floor_m - 0.12, 0.24, 0.1)
    if style.wall == Material.PLASTER:
        for floor in range(1, floors - 1):
            _course(drawing, style, style.ground_floor_m + floor * style.floor_m, 0.1, 0.05)
    if style.balcony_every:
        _balconies(drawing, style, floors)
    top = style.ground_floor_m + (floors - 1) * style.floor_m
    drawing.slab(Material.METAL, (0.1, 0.2), (0.0, top - 0.2), (0.02, 0.13))
    if style.roof == "flat":
        drawing.slab(style.trim, (0.0, length), (top - 0.2, top + 0.25), (0.0, 0.3))
        drawing.slab(style.trim, (0.0, length), (top - 0.42, top - 0.2), (0.0, 0.12))
    else:
        drawing.slab(style.trim, (0.0, length), (top - 0.5, top - 0.32), (0.0, 0.14))
        drawing.slab(Material.METAL, (0.0, length), (top - 0.3, top - 0.16), (0.34, 0.5))


def draw_plain(drawing: WallDrawing, style: FacadeStyle, floors: int, *, windows: bool) -> None:
    """A wall to the side or the court: flush windows, or none towards a neighbour."""
    length = drawing.wall.length_m
    top = style.ground_floor_m + (floors - 1) * style.floor_m
    if style.wall in (Material.PLASTER, Material.BRICK, Material.CONCRETE):
        drawing.panel(Material.CONCRETE, 0.0, length, 0.0, _PLINTH_M, 0.03)
        drawing.quads.add(
            Material.CONCRETE,
            drawing.place(0.0, _PLINTH_M, 0.03), drawing.place(length, _PLINTH_M, 0.03),
            drawing.place(length, _PLINTH_M, 0.0), drawing.place(0.0, _PLINTH_M, 0.0),
        )  # fmt: skip
    if not windows or length < 4.0:
        drawing.panel(style.wall, 0.0, length, 0.0, top)
        return
    v = (1.0, max(2.4, style.ground_floor_m - 1.0))
    drawing.panel(style.wall, 0.0, length, 0.0, v[0])
    _row(drawing, style, _windows(length, style), v, 0.0, framed=False)
    drawing.panel(style.wall, 0.0, length, v[1], style.ground_floor_m)
    _storeys(drawing, style, floors, 0.0, framed=False)


def _bays(length_m: float, style: FacadeStyle) -> NDArray[np.float64]:
    """Edges of the bays along a wall; a pier is left at both ends."""
    pier_m = min(0.6, length_m * 0.05)
    count = max(1, round((length_m - 2 * pier_m) / style.bay_m))
    return np.linspace(pier_m, length_m - pier_m, count + 1)


def _windows(length_m: float, style: FacadeStyle) -> list[tuple[float, float]]:
    """Left and right edge of the window of each bay."""
    edges = _bays(length_m, style)
    margin = (edges[1] - edges[0]) * (1.0 - style.glazing) / 2
    return [(float(a + margin), float(b - margin)) for a, b in pairwise(edges)]


def _storeys(
    drawing: WallDrawing, style: FacadeStyle, floors: int, recess_m: float, *, framed: bool
) -> None:
    length = drawing.wall.length_m
    windows = _windows(length, style)
    below = style.ground_floor_m
    for floor in range(floors - 1):
        base = style.ground_floor_m + floor * style.floor_m
        sill, head = base + style.sill_m, base + style.head_m
        drawing.panel(style.wall, 0.0, length, below, sill)
        _row(drawing, style, windows, (sill, head), recess_m, framed=framed)
        below = head
    top = style.ground_floor_m + (floors - 1) * style.floor_m
    drawing.panel(style.wall, 0.0, length, below, top)


def _row(
    drawing: WallDrawing,
    style: FacadeStyle,
    windows: list[tuple[float, float]],
    v: tuple[float, float],
    recess_m: float,
    *,
    framed: bool,
) -> None:
    """One row of windows and the piers between them."""
    if style.glazing > _CURTAIN_WALL and recess_m > 0.0:
        _ribbon(drawing, style, windows, v, recess_m)
        return
    left = 0.0
    for u0, u1 in windows:
        drawing.panel(style.wall, left, u0, *v)
        drawing.opening(Material.FACADE_WINDOW, style.trim, (u0, u1), v, recess_m)
        if framed:
            _surround(drawing, style, (u0, u1), v)
        left = u1
    drawing.panel(style.wall, left, drawing.wall.length_m, *v)


def _ribbon(
    drawing: WallDrawing,
    style: FacadeStyle,
    windows: list[tuple[float, float]],
    v: tuple[float, float],
    recess_m: float,
) -> None:
    """Glass from bay to bay behind mullions, with one reveal around all of it."""
    length, p = drawing.wall.length_m, drawing.place
    u0, u1 = windows[0][0], windows[-1][1]
    drawing.panel(style.wall, 0.0, u0, *v)
    drawing.panel(style.wall, u1, length, *v)
    for at in v:
        ends = (p(u0, at, 0), p(u1, at, 0), p(u1, at, -recess_m), p(u0, at, -recess_m))
        drawing.quads.add(style.trim, *ends)
    for at in (u0, u1):
        ends = (p(at, v[0], 0), p(at, v[1], 0), p(at, v[1], -recess_m), p(at, v[0], -recess_m))
        drawing.quads.add(style.trim, *ends)
    joints = [(a[1] + b[0]) / 2 for a, b in pairwise(windows)]
    for a, b in pairwise([u0, *joints, u1]):
        drawing.panel(Material.FACADE_WINDOW, a, b, *v, -recess_m)
    for (_, a), (b, _) in pairwise(windows):
        drawing.panel(style.wall, a, b, *v)


def _surround(
    drawing: WallDrawing, style: FacadeStyle, u: tuple[float, float], v: tuple[float, float]
) -> None:
    """A sill that sheds the rain and, on old houses, a lintel: what is seen from the street."""
    if style.glazing > _CURTAIN_WALL:
        return
    p, (u0, u1), (low, high) = drawing.place, (u[0] - 0.09, u[1] + 0.09), (v[0] - 0.09, v[0])
    drawing.panel(style.trim, u0, u1, low, high, 0.12)
    below = (p(u0, low, 0.0), p(u1, low, 0.0), p(u1, low, 0.12), p(u0, low, 0.12))
    above = (p(u0, high, 0.0), p(u1, high, 0.0), p(u1, high, 0.12), p(u0, high, 0.12))
    drawing.quads.add(style.trim, *(below if low > _EYE_M else above))
    if style.wall != Material.CONCRETE:
        drawing.panel(style.trim, u[0] - 0.14, u[1] + 0.14, v[1], v[1] + 0.16, 0.015)


def _shops(drawing: WallDrawing, style: FacadeStyle, rng: np.random.Generator) -> None:
    """Shop windows between piers, a sign band above, an awning here and there, doors."""
    length, top = drawing.wall.length_m, style.ground_floor_m
    count = max(1, round(length / 6.0))
    edges = np.linspace(0.0, length, count + 1)
    drawing.panel(style.wall, 0.0, length, 3.1, top)
    left = 0.0
    (names,) = rng.spawn(1)
    for a, b in pairwise(edges):
        u0, u1 = float(a) + 0.35, float(b) - 0.35
        door = u0 + 1.1
        drawing.panel(style.trim, left, u0, 0.0, 3.1)
        drawing.opening(Material.SHOP_WINDOW, style.trim, (u0, door), (0.0, 3.1), 0.5)
        drawing.panel(style.trim, door, u1, 0.0, 0.45)
        drawing.opening(Material.SHOP_WINDOW, style.trim, (door, u1), (0.45, 3.1), 0.18)
        band = (Material.SIGN_RED, Material.PLASTIC_DARK, Material.WOOD, Material.SIGN_WHITE)
        sign = band[int(rng.integers(len(band)))]
        drawing.slab(sign, (u0, u1), (3.15, 3.75), (0.0, 0.12))
        _shop_name(drawing, (u0 + u1) / 2, sign, names)
        if rng.random() < 0.4:
            awning = (Material.SIGN_RED, Material.SIGN_WHITE, Material.CLOTH_LOWER)
            cloth = awning[int(rng.integers(len(awning)))]
            drawing.sloped(cloth, (door - 0.1, u1), (2.5, 1.15), (3.1, 0.02))
            drawing.panel(cloth, door - 0.1, u1, 2.3, 2.5, 1.15)
        left = u1
    drawing.panel(style.trim, left, length, 0.0, 3.1)


def _shop_name(
    drawing: WallDrawing, middle: float, sign: Material, rng: np.random.Generator
) -> None:
    """What a shop is called, on its sign; from the street u runs to the left."""
    name = _SHOPS[int(rng.integers(len(_SHOPS)))]
    bright = sign == Material.SIGN_WHITE
    letters = Material.PLASTIC_DARK if bright else Material.SIGN_WHITE
    at, weight, wide = (
        (3.15 + 3.75) / 2,
        float(rng.uniform(1.5, 2.5)),
        float(rng.uniform(0.85, 1.2)),
    )
    for quad in written(name, 0.32, weight=weight, wide=wide):
        a, b, c, d = (drawing.place(middle - along, at + up, 0.125) for along, up in quad)
        drawing.quads.add(letters, a, b, c, d)


def _entrance_floor(drawing: WallDrawing, style: FacadeStyle) -> None:
    """A residential ground floor: windows on a plinth, a door with a canopy in the middle bay."""
    length, top = drawing.wall.length_m, style.ground_floor_m
    edges = _bays(length, style)
    door_bay = (len(edges) - 1) // 2
    sill, head = 1.0, min(top - 0.6, 2.6)
    drawing.panel(style.wall, 0.0, length, head, top)
    margin = (edges[1] - edges[0]) * (1.0 - style.glazing) / 2
    left = 0.0
    for number, (a, b) in enumerate(pairwise(edges)):
        u0, u1 = float(a + margin), float(b - margin)
        if number == door_bay:
            middle = (u0 + u1) / 2
            u0, u1 = middle - 0.65, middle + 0.65
        drawing.panel(style.wall, left, u0, 0.0, head)
        if number == door_bay:
            drawing.opening(Material.HOUSE_DOOR, style.trim, (u0, u1), (0.0, head), 0.3)
            drawing.slab(style.trim, (u0 - 0.4, u1 + 0.4), (head + 0.1, head + 0.25), (0.0, 1.0))
        else:
            drawing.panel(style.wall, u0, u1, 0.0, sill)
            drawing.opening(
                Material.FACADE_WINDOW, style.trim, (u0, u1), (sill, head), style.recess_m
            )
            _surround(drawing, style, (u0, u1), (sill, head))
        left = u1
    drawing.panel(style.wall, left, length, 0.0, head)
    drawing.slab(style.trim, (0.0, length), (0.0, _PLINTH_M), (0.0, 0.06))


def _course(
    drawing: WallDrawing, style: FacadeStyle, v: float, height_m: float, out_m: float
) -> None:
    drawing.slab(style.trim, (0.0, drawing.wall.length_m), (v, v + height_m), (0.0, out_m))


def _balconies(drawing: WallDrawing, style: FacadeStyle, floors: int) -> None:
    edges = _bays(drawing.wall.length_m, style)
    for bay in range(style.balcony_every // 2, len(edges) - 1, style.balcony_every):
        u0, u1 = float(edges[bay]) + 0.15, float(edges[bay + 1]) - 0.15
        for floor in range(floors - 1):
            base = style.ground_floor_m + floor * style.floor_m
            drawing.slab(Material.CONCRETE, (u0, u1), (base - 0.08, base + 0.1), (0.0, 1.1))
            drawing.panel(Material.GLASS, u0, u1, base + 0.1, base + 0.92, 1.06)
            drawing.slab(Material.METAL, (u0, u1), (base + 0.92, base + 1.0), (1.02, 1.1))
