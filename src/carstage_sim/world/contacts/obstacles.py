"""What of the town stops a vehicle or a walker: its outlines at bumper height.

Everything of the scenery that is neither ground nor foliage is cut by a few planes above the ground
that it stands on. Things as small as a pole become their convex hull; of larger ones the cuts that
lie on one line are joined, so that a wall is one segment and nothing slides into a seam.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from shapely import MultiPoint

from carstage_sim.kernels import brief_kernel, device
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.cell_index import cell_grid
from carstage_sim.maps.ground import Ground
from carstage_sim.mesh import LEAF_CELLS, Material, TriangleMesh
from carstage_sim.world.columns import Touch
from carstage_sim.world.contacts.boxes import TOWN, Contact
from carstage_sim.world.contacts.cell_walk import cells_along

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_NORMAL_X, _NORMAL_Y, _DEPTH, _POINT_X, _POINT_Y = map(int, Touch)
_CUTS_M = (0.3, 0.7, 1.2)
_SOFT_MATERIALS = (Material.FOLIAGE, *LEAF_CELLS)
_SOFT_LABELS = (
    CityObjectLabel.NONE,
    CityObjectLabel.ROADS,
    CityObjectLabel.SIDEWALKS,
    CityObjectLabel.TERRAIN,
    CityObjectLabel.SKY,
    CityObjectLabel.WATER,
    CityObjectLabel.ROAD_LINES,
    CityObjectLabel.GROUND,
    CityObjectLabel.RAIL_TRACK,
)
_CELL_M = 4.0
_SMALL_M = 1.5
_SAME_LEVEL_M = 1.5
_ANGLE_STEP = 1e-3  # rad; cuts whose lines differ by less are one wall
_OFFSET_STEP_M = 0.01
_GAP_M = 0.05


class Obstacles:
    """The outlines of a town's scenery.

    Args:
        mesh: the scenery.
        ground: what it stands on.

    Attributes:
        start, end: ``(S, 2)`` ends of the segments, metres.
        level: ``(S,)`` height of the ground below each.
        object_id: ``(S,)`` level objects, 0 for what is none.
        label: ``(S,)`` semantic labels.
    """

    def __init__(self, mesh: TriangleMesh, ground: Ground) -> None:
        cuts = _cuts(mesh, ground)
        small = _small(cuts)
        outlines = _joined(cuts.where(~small)).with_hulls(cuts.where(small))
        self.start, self.end = outlines.start, outlines.end
        self.level, self.object_id, self.label = outlines.level, outlines.object_id, outlines.label
        self._shown: BoolArray = np.ones(len(self.start), np.bool_)
        corners = np.stack([self.start, self.end, self.end], axis=1)
        self._grid = cell_grid(corners, _CELL_M)

    def hide(self, object_ids: frozenset[int]) -> None:
        """Let nothing touch these objects; all others are touchable again."""
        hidden = np.fromiter(object_ids, np.int64, len(object_ids))
        self._shown = ~np.isin(self.object_id, hidden)

    def contacts(
        self, rows: IntArray, center: FloatArray, half_size: FloatArray, yaw_rad: FloatArray
    ) -> list[Contact]:
        """Contacts of boxes with the town: of each box and object the deepest one.

        Args:
            rows: ``(M,)`` which boxes to look at.
            center, half_size, yaw_rad: ``(N, 3)``, ``(N, 2)``, ``(N,)`` of all boxes.
        """
        if not len(rows) or not len(self.start):
            return []
        capacity = 4 * len(rows)
        while True:
            pairs, shapes = np.empty((capacity, 2), np.int64), np.empty((capacity, 5))
            count = _touching(
                rows, center, half_size, np.cos(yaw_rad[rows]), np.sin(yaw_rad[rows]),
                self.start, self.end, self.level, self._shown, self._grid, pairs, shapes,
            )  # fmt: skip
            if count <= capacity:
                break
            capacity = count
        deepest: dict[tuple[int, int, int], int] = {}
        for k in np.argsort(-shapes[:count, Touch.DEPTH], kind="stable").tolist():
            box, segment = pairs[k].tolist()
            object_id = int(self.object_id[segment])
            deepest.setdefault((box, object_id, 0 if object_id else segment), k)
        return [
            Contact(
                int(rows[box]),
                TOWN,
                shapes[k, : Touch.DEPTH],
                float(shapes[k, Touch.DEPTH]),
                shapes[k, Touch.POINT_X :],
                object_id,
                int(self.label[pairs[k, 1]]),
            )
            for (box, object_id, _), k in sorted(deepest.items())
        ]


@brief_kernel
def _touching(  # type: ignore[no-untyped-def]
    rows, center, half_size, cosine, sine, start, end, level, shown, grid, pairs, shapes
):
    """Writes boxes and segments that touch, as far as there is room; returns how many there are.

    A segment that reaches into several cells under a box comes several times.

    Args:
        cosine, sine: ``(M,)`` of the headings of the boxes that ``rows`` names.
        grid: the cells of the segments.
        pairs: ``(C, 2)`` index in ``rows`` and segment.
        shapes: ``(C, 5)`` normal towards the segment, depth, point; world.
    """
    count = 0
    for box in range(rows.shape[0]):
        row = rows[box]
        length, width = half_size[row, 0], half_size[row, 1]
        c, s = cosine[box], sine[box]
        x, y, z = center[row, 0], center[row, 1], center[row, 2]
        reach_x = length * abs(c) + width * abs(s)
        reach_y = length * abs(s) + width * abs(c)
        first_x, last_x = cells_along(grid, 0, x - reach_x, x + reach_x)
        first_y, last_y = cells_along(grid, 1, y - reach_y, y + reach_y)
        for cell_x in range(first_x, last_x + 1):
            for cell_y in range(first_y, last_y + 1):
                cell = cell_x * grid.shape[1] + cell_y
                for entry in range(grid.start[cell], grid.start[cell + 1]):
                    piece = grid.entries[entry]
                    if not shown[piece] or abs(z - level[piece]) >= _SAME_LEVEL_M:
                        continue
                    x0, y0 = start[piece, 0] - x, start[piece, 1] - y
                    x1, y1 = end[piece, 0] - x, end[piece, 1] - y
                    depth, normal_x, normal_y, point_x, point_y = _box_meets_segment(
                        x0 * c + y0 * s, y0 * c - x0 * s, x1 * c + y1 * s, y1 * c - x1 * s,
                        length, width,
                    )  # fmt: skip
                    if not depth > 0.0:
                        continue
                    if count < pairs.shape[0]:
                        pairs[count, 0], pairs[count, 1] = box, piece
                        shapes[count, _NORMAL_X] = normal_x * c - normal_y * s
                        shapes[count, _NORMAL_Y] = normal_x * s + normal_y * c
                        shapes[count, _DEPTH] = depth
                        shapes[count, _POINT_X] = x + point_x * c - point_y * s
                        shapes[count, _POINT_Y] = y + point_x * s + point_y * c
                    count += 1
    return count


@device
def _box_meets_segment(x0, y0, x1, y1, length, width):  # type: ignore[no-untyped-def]
    """A box of half ``length`` and ``width`` around the origin and a segment in its frame.

    Returns:
        Depth, not positive where they do not touch; normal towards the segment (x, y); middle of
        the part of the segment that is in the box (x, y).
    """
    ahead, behind = length - min(x0, x1), length + max(x0, x1)
    right, left = width - min(y0, y1), width + max(y0, y1)
    if min(min(ahead, behind), min(right, left)) <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    along_x, along_y = x1 - x0, y1 - y0
    norm = max(np.sqrt(along_x * along_x + along_y * along_y), 1e-9)
    normal_x, normal_y = -along_y / norm, along_x / norm
    distance = normal_x * x0 + normal_y * y0
    if distance < 0.0:
        normal_x, normal_y = -normal_x, -normal_y
    depth = length * abs(normal_x) + width * abs(normal_y) - abs(distance)
    if min(ahead, behind) < depth:
        depth, normal_x, normal_y = min(ahead, behind), 1.0 if ahead <= behind else -1.0, 0.0
    if min(right, left) < depth:
        depth, normal_x, normal_y = min(right, left), 0.0, 1.0 if right <= left else -1.0

    # The part of the segment within the box (Liang and Barsky).
    enters, leaves = 0.0, 1.0
    if along_x != 0.0:
        one, other = (-length - x0) / along_x, (length - x0) / along_x
        enters, leaves = max(enters, min(one, other)), min(leaves, max(one, other))
    if along_y != 0.0:
        one, other = (-width - y0) / along_y, (width - y0) / along_y
        enters, leaves = max(enters, min(one, other)), min(leaves, max(one, other))
    middle = 0.5 * (min(enters, 1.0) + max(leaves, 0.0))
    return depth, normal_x, normal_y, x0 + middle * along_x, y0 + middle * along_y


class _Outlines:
    """Segments with what they belong to."""

    def __init__(
        self,
        start: FloatArray,
        end: FloatArray,
        level: FloatArray,
        object_id: IntArray,
        label: IntArray,
    ) -> None:
        self.start, self.end, self.level = start, end, level
        self.object_id, self.label = object_id, label

    def where(self, rows: NDArray[np.generic]) -> _Outlines:
        """Some of the segments."""
        return _Outlines(
            self.start[rows],
            self.end[rows],
            self.level[rows],
            self.object_id[rows],
            self.label[rows],
        )

    def with_hulls(self, small: _Outlines) -> _Outlines:
        """These segments, and after them the convex hulls of small objects."""
        starts, ends, rows = [self.start], [self.end], []
        order = np.argsort(small.object_id, kind="stable")
        ids, first = np.unique(small.object_id[order], return_index=True)
        for members in np.split(order, first[1:]) if len(ids) else []:
            points = np.concatenate([small.start[members], small.end[members]])
            hull = MultiPoint(points).convex_hull
            ring = np.asarray(getattr(hull, "exterior", hull).coords)
            starts.append(ring[:-1])
            ends.append(ring[1:])
            rows.extend([int(members[0])] * (len(ring) - 1))
        kept = small.where(np.array(rows, np.int64))
        return _Outlines(
            np.concatenate(starts),
            np.concatenate(ends),
            np.concatenate([self.level, kept.level]),
            np.concatenate([self.object_id, kept.object_id]),
            np.concatenate([self.label, kept.label]),
        )


def _among(numbers: Sequence[int]) -> BoolArray:
    """``(256,)``: which bytes are one of these; a look-up is faster than ``np.isin``."""
    table: BoolArray = np.isin(np.arange(256), numbers)
    return table


def _cuts(mesh: TriangleMesh, ground: Ground) -> _Outlines:
    """Where the planes above the ground cut the hard triangles, piece by piece."""
    is_hard = ~_among(_SOFT_LABELS)[mesh.tag] & ~_among(_SOFT_MATERIALS)[mesh.material]
    hard = np.flatnonzero(is_hard)
    a, b, c = mesh.vertices[:, 2][mesh.triangles[hard].T]
    # Most of a town is higher than any plane.
    hard = hard[np.minimum(np.minimum(a, b), c) <= ground.top_m + max(_CUTS_M)]
    corners = mesh.vertices[mesh.triangles[hard]].astype(np.float64)
    foot = corners.mean(axis=1)
    level = ground.height_below(foot)
    above = corners[..., 2] - level[:, None]
    starts, ends, rows = [], [], []
    for height in _CUTS_M:
        over = above > height
        crossing = np.flatnonzero(over.any(axis=1) & ~over.all(axis=1) & ~np.isnan(level))
        sides = over[crossing]
        # The corner that is alone on its side, then the two others.
        lone = np.where(sides.sum(axis=1) == 1, sides.argmax(axis=1), (~sides).argmax(axis=1))
        a = corners[crossing, lone]
        z_a = above[crossing, lone]
        ends_of = []
        for step in (1, 2):
            other = (lone + step) % 3
            share = (height - z_a) / (above[crossing, other] - z_a)
            ends_of.append(a + share[:, None] * (corners[crossing, other] - a))
        starts.append(ends_of[0][:, :2])
        ends.append(ends_of[1][:, :2])
        rows.append(crossing)
    row = np.concatenate(rows)
    return _Outlines(
        np.concatenate(starts),
        np.concatenate(ends),
        level[row],
        mesh.object_id[hard[row]].astype(np.int64),
        mesh.tag[hard[row]].astype(np.int64),
    )


def _small(cuts: _Outlines) -> BoolArray:
    """Which cuts belong to objects that are small all round."""
    count = int(cuts.object_id.max(initial=0)) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    for ends in (cuts.start, cuts.end):
        np.minimum.at(low, cuts.object_id, ends)
        np.maximum.at(high, cuts.object_id, ends)
    is_small = ((high - low) < _SMALL_M).all(axis=1)
    is_small[0] = False
    return np.asarray(is_small[cuts.object_id])


def _joined(cuts: _Outlines) -> _Outlines:
    """Cuts of one object that lie on one line and touch, as one segment each."""
    along = cuts.end - cuts.start
    length = np.linalg.norm(along, axis=1)
    cuts, along = cuts.where(length > 1e-3), along[length > 1e-3]
    angle = np.round(np.arctan2(along[:, 1], along[:, 0]) % np.pi / _ANGLE_STEP)
    angle = angle % np.round(np.pi / _ANGLE_STEP)
    direction = np.stack([np.cos(angle * _ANGLE_STEP), np.sin(angle * _ANGLE_STEP)], axis=-1)
    # Offsets from a place near by: far from the origin a step of the angle is a large one.
    anchor = np.round(cuts.start / 64.0) * 64.0
    local_start, local_end = cuts.start - anchor, cuts.end - anchor
    offset = np.round(
        (local_start[:, 1] * direction[:, 0] - local_start[:, 0] * direction[:, 1]) / _OFFSET_STEP_M
    )
    t0 = np.einsum("nk,nk->n", local_start, direction)
    t1 = np.einsum("nk,nk->n", local_end, direction)
    t0, t1 = np.minimum(t0, t1), np.maximum(t0, t1)
    keys = (cuts.object_id, cuts.label, anchor[:, 0], anchor[:, 1], angle, offset)
    order = np.lexsort((t0, *reversed(keys)))
    if not len(order):
        return cuts
    changes = np.zeros(len(order), np.bool_)
    changes[0] = True
    for key in keys:
        changes[1:] |= np.diff(key[order]) != 0
    group = np.cumsum(changes)
    spread = 1e4 * group  # groups one after the other on one axis
    low, high = t0[order] + spread, t1[order] + spread
    reached = np.maximum.accumulate(high)
    begins = np.ones(len(order), np.bool_)
    begins[1:] = low[1:] > reached[:-1] + _GAP_M
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(order)) - 1
    lead = order[first]
    across = np.stack([-direction[lead, 1], direction[lead, 0]], axis=-1)
    line = anchor[lead] + across * (offset[lead] * _OFFSET_STEP_M)[:, None]
    from_m, to_m = low[first] - spread[first], reached[last] - spread[first]
    joined = cuts.where(lead)
    joined.start = line + direction[lead] * from_m[:, None]
    joined.end = line + direction[lead] * to_m[:, None]
    return joined
