"""Triangle meshes and their materials: what maps and content give to the renderer."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class Material(IntEnum):
    """What a triangle is made of. How each looks is one table in ``carstage_sim.render``."""

    DEFAULT = 0
    ASPHALT = 1
    LANE_MARKING_WHITE = 2
    LANE_MARKING_YELLOW = 3
    SIDEWALK = 4
    KERB = 5
    GRASS = 6
    SOIL = 7
    CONCRETE = 8
    BRICK = 9
    PLASTER = 10
    FACADE_WINDOW = 11
    ROOF = 12
    METAL = 13
    WOOD = 14
    BARK = 15
    FOLIAGE = 16
    PAINT = 17
    """Coloured by the instance's paint colour."""
    GLASS = 18
    RUBBER = 19
    RIM = 20
    PLASTIC_DARK = 21
    HEAD_LAMP = 22
    TAIL_LAMP = 23
    BLINKER_LEFT = 24
    BLINKER_RIGHT = 25
    REVERSE_LAMP = 26
    SKIN = 27
    CLOTH_UPPER = 28
    """Coloured by the instance's paint colour."""
    CLOTH_LOWER = 29
    HAIR = 30
    LIGHT_RED = 31
    LIGHT_YELLOW = 32
    LIGHT_GREEN = 33
    STREET_LAMP = 34
    SIGN_WHITE = 35
    SIGN_RED = 36
    LICENCE_PLATE = 37
    CROSSWALK_WHITE = 38
    SHOE = 39
    PAINT_WHITE = 40
    """Paints of parked vehicles, which are no instances."""
    PAINT_SILVER = 41
    PAINT_GREY = 42
    PAINT_BLACK = 43
    PAINT_BLUE = 44
    PAINT_RED = 45
    LAMP_COVER = 46
    """Clear cover of a lamp that is off."""
    BRAKE_LAMP = 47
    """Lit by the brakes only."""
    BEACON_BLUE = 48
    """Flashes with the special lights of emergency vehicles."""
    BEACON_RED = 49
    SEAT = 50
    SIGN_BLUE = 51
    SIGN_YELLOW = 52
    DISPLAY = 53
    """Letters of light, as a bus shows its destination."""
    GLASS_DARK = 54
    """Glass before a dark room, which nobody sees through."""
    CLOTH_ACCENT = 55
    """Second colour of what covers the trunk: a pattern, or the shirt below a jacket."""
    BAG = 56
    """Bags and hats."""
    LIPS = 57
    SOLE = 58
    LEAVES = 59
    """Cards of leaves with gaps between them, this one and those below; see ``LEAF_CELLS``."""
    LEAVES_LIGHT = 60
    LEAVES_DARK = 61
    LEAVES_SMALL = 62
    LEAVES_YELLOW = 63
    LEAVES_RED = 64
    NEEDLES = 65
    BLADES = 66
    """Of grass."""
    BARK_PALE = 67
    WOODS = 68
    PICTURE = 69
    """Hills with trees, from afar."""
    SHOP_WINDOW = 70
    HOUSE_DOOR = 71
    GUTTER = 72
    """Beside a road, of stones in a row."""
    TACTILE = 73
    """Studded stones where a sidewalk is lowered for a crossing."""
    TAR = 74
    """Poured into cracks and along the rims of repairs."""
    ASPHALT_NEW = 75
    """Repairs."""
    COVER = 76
    """Of a manhole or a gully."""
    GLASS_TINTED = 77
    """Privacy glass of cars, behind the front doors."""


LEAF_CELLS: dict[Material, tuple[int, int]] = {
    Material.LEAVES: (8, 8),
    Material.LEAVES_LIGHT: (8, 8),
    Material.LEAVES_DARK: (8, 8),
    Material.LEAVES_SMALL: (10, 10),
    Material.LEAVES_YELLOW: (8, 8),
    Material.LEAVES_RED: (8, 8),
    Material.NEEDLES: (4, 15),
    Material.BLADES: (3, 15),
}
"""Leaves along the first and the second side of a triangle, 15 at most; the rest of it is gaps."""


@dataclass(frozen=True, slots=True)
class TriangleMesh:
    """Triangles with their attributes, in one frame (CARLA axes, metres).

    Attributes:
        vertices: ``(V, 3)`` float32.
        triangles: ``(T, 3)`` int32 indices into ``vertices``; counter-clockwise seen from outside
            in a right-handed drawing is not relied on: shading uses the side that the ray meets.
        normals: ``(T, 3, 3)`` float32 unit normals per corner (equal corners = flat shading).
        material: ``(T,)`` uint8, values of :class:`Material`.
        tag: ``(T,)`` uint8, values of :class:`carstage_sim.labels.CityObjectLabel`.
        object_id: ``(T,)`` uint32; static geometry: index into the town's level objects + 1, with
            0 for none; actor meshes: 0.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    normals: NDArray[np.float32]
    material: NDArray[np.uint8]
    tag: NDArray[np.uint8]
    object_id: NDArray[np.uint32]

    def __post_init__(self) -> None:
        count = len(self.triangles)
        for field in fields(self)[2:]:
            if len(getattr(self, field.name)) != count:
                raise ValueError(f"{field.name} has not one row per triangle ({count})")

    @property
    def bounds(self) -> NDArray[np.float32]:
        """``(2, 3)`` lowest and highest corner of the vertices."""
        along = self.vertices.T  # by axis: several times as fast as numpy's own minima of rows
        return np.array([[axis.min() for axis in along], [axis.max() for axis in along]])


def build_mesh(
    vertices: NDArray[np.floating],
    triangles: NDArray[np.integer],
    material: Material | NDArray[np.integer],
    tag: int | NDArray[np.integer],
    *,
    normals: NDArray[np.floating] | None = None,
    object_id: int | NDArray[np.integer] = 0,
) -> TriangleMesh:
    """A mesh from arrays; scalars are spread over the triangles, normals default to flat ones."""
    points = np.ascontiguousarray(vertices, dtype=np.float32)
    index = np.ascontiguousarray(triangles, dtype=np.int32).reshape(-1, 3)
    count = len(index)
    if normals is None:
        a, b, c = (points[index[:, k]].astype(np.float64) for k in range(3))
        flat = np.cross(b - a, c - a)
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
        normals = np.repeat(flat[:, None, :], 3, axis=1)
    return TriangleMesh(
        vertices=points,
        triangles=index,
        normals=np.ascontiguousarray(normals, dtype=np.float32),
        material=np.broadcast_to(np.asarray(material, dtype=np.uint8), (count,)).copy(),
        tag=np.broadcast_to(np.asarray(tag, dtype=np.uint8), (count,)).copy(),
        object_id=np.broadcast_to(np.asarray(object_id, dtype=np.uint32), (count,)).copy(),
    )


def merge_meshes(meshes: list[TriangleMesh]) -> TriangleMesh:
    """One mesh that holds all triangles of ``meshes``, in their order."""
    if not meshes:
        raise ValueError("nothing to merge")
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    return TriangleMesh(
        vertices=np.concatenate([m.vertices for m in meshes]),
        triangles=np.concatenate(
            [m.triangles + np.int32(o) for m, o in zip(meshes, offsets, strict=True)]
        ),
        normals=np.concatenate([m.normals for m in meshes]),
        material=np.concatenate([m.material for m in meshes]),
        tag=np.concatenate([m.tag for m in meshes]),
        object_id=np.concatenate([m.object_id for m in meshes]),
    )
