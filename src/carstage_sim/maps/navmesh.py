"""Writes walkways as the file that the client's pedestrian navigation loads.

The format is CARLA's container (``MSET``) around one Detour tile (``DNAV`` version 7, 32-bit
references), in Recast's axes: x, up, y. Detail triangles carry flags for the edges that lie on
their polygon's outline; without them the client's crowd simulation crashes.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.walkways import Walkways

SIDEWALK_FLAG, CROSSWALK_FLAG = 0x02, 0x04
SIDEWALK_AREA, CROSSWALK_AREA = 1, 2

SET_HEADER = struct.Struct("<iii3fffii")
"""Magic, version, tiles; origin, tile width and height, most tiles, most polygons per tile."""
TILE_HEADER = struct.Struct("<Ii")
"""Tile reference, bytes."""
MESH_HEADER = struct.Struct("<15i10f")
POLYGON = struct.Struct("<I6H6HHBB")
DETAIL_MESH = struct.Struct("<IIBBxx")
_SET_MAGIC, _SET_VERSION = 0x4D534554, 1
_TILE_MAGIC, _TILE_VERSION = 0x444E4156, 7
_LINK_BYTES = 12
_NO_LINK = 0xFFFFFFFF
_AGENT_HEIGHT_M, _AGENT_RADIUS_M, _AGENT_CLIMB_M = 1.8, 0.3, 0.3
_MOST_CORNERS = 6
_MOST_NUMBERS = 0xFFFF


def fits_in_a_tile(walk: Walkways) -> bool:
    """Whether points and polygons can be numbered with 16 bits."""
    return len(walk.points) <= _MOST_NUMBERS and len(walk.polygons) < _MOST_NUMBERS


def navigation_file(walk: Walkways) -> bytes:
    """The file's bytes.

    Raises:
        ValueError: if the walkways do not fit in one Detour tile.
    """
    if not fits_in_a_tile(walk):
        raise ValueError(f"{len(walk.points)} points do not fit in one navigation tile")
    points = walk.points[:, [0, 2, 1]].astype("<f4")
    low, high = points.min(axis=0), points.max(axis=0)
    # Room above and below, so that queries a little off the surface find it.
    low[1] -= 1.0
    high[1] += 1.0
    polygons = [_fan_order(polygon, walk.points[:, :2]) for polygon in walk.polygons]
    tile = _tile(points, polygons, walk.is_crosswalk, low, high)
    polygon_bits = max(1, (len(polygons) - 1).bit_length())
    header = SET_HEADER.pack(
        _SET_MAGIC, _SET_VERSION, 1, *low, high[0] - low[0], high[2] - low[2], 1, 1 << polygon_bits
    )
    # A reference is salt, tile, polygon; one tile takes no bits, and the first salt is 1.
    return header + TILE_HEADER.pack(1 << polygon_bits, len(tile)) + tile


def neighbours(polygons: list[tuple[int, ...]]) -> list[list[int]]:
    """Per polygon and edge (from corner k to k + 1) the polygon across it, -1 for none."""
    owner = {
        (polygon[k], polygon[(k + 1) % len(polygon)]): i
        for i, polygon in enumerate(polygons)
        for k in range(len(polygon))
    }
    return [[owner.get((p[(k + 1) % len(p)], p[k]), -1) for k in range(len(p))] for p in polygons]


def _tile(
    points: NDArray[np.float32],
    polygons: list[tuple[int, ...]],
    is_crosswalk: tuple[bool, ...],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
) -> bytes:
    corner_count = sum(len(polygon) for polygon in polygons)
    triangle_count = corner_count - 2 * len(polygons)
    header = MESH_HEADER.pack(
        _TILE_MAGIC, _TILE_VERSION,
        0, 0, 0, 0,  # x, y, layer, user id
        len(polygons), len(points),
        corner_count,  # links: at most one per edge
        len(polygons), 0, triangle_count,  # detail meshes, vertices, triangles
        0, 0, len(polygons),  # bounding volumes, off-mesh connections, first of those
        _AGENT_HEIGHT_M, _AGENT_RADIUS_M, _AGENT_CLIMB_M, *low, *high, 1.0,
    )  # fmt: skip
    body, details, triangles = bytearray(), bytearray(), bytearray()
    across = neighbours(polygons)
    for i, polygon in enumerate(polygons):
        padding = [0] * (_MOST_CORNERS - len(polygon))
        flag, area = (
            (CROSSWALK_FLAG, CROSSWALK_AREA) if is_crosswalk[i] else (SIDEWALK_FLAG, SIDEWALK_AREA)
        )
        body += POLYGON.pack(
            _NO_LINK, *polygon, *padding, *(n + 1 for n in across[i]), *padding, flag,
            len(polygon), area,
        )  # fmt: skip
        details += DETAIL_MESH.pack(0, len(triangles) // 4, 0, len(polygon) - 2)
        for k in range(1, len(polygon) - 1):
            first, last = k == 1, k == len(polygon) - 2
            triangles += bytes((0, k, k + 1, int(first) | 0x04 | (0x10 if last else 0)))
    links = bytes(_LINK_BYTES * corner_count)
    return header + points.tobytes() + body + links + details + triangles


def _fan_order(polygon: tuple[int, ...], points: NDArray[np.float64]) -> tuple[int, ...]:
    """The polygon begun at the corner whose fan has the least thin triangle."""

    def thinnest(order: tuple[int, ...]) -> float:
        rest = points[list(order[1:])] - points[order[0]]
        crosses = rest[:-1, 0] * rest[1:, 1] - rest[:-1, 1] * rest[1:, 0]
        return float(np.abs(crosses).min())

    turns = [polygon[k:] + polygon[:k] for k in range(len(polygon))]
    return max(turns, key=thinnest)
