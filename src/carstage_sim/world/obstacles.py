"""What of the town stops a vehicle or a walker: its outlines at bumper height.

Everything of the scenery that is neither ground nor foliage is cut by a few planes above the ground
that it stands on. Things as small as a pole become their convex hull; of larger ones the cuts that
lie on one line are joined, so that a wall is one segment and nothing slides into a seam.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely import MultiPoint

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.cell_index import CellIndex
from carstage_sim.maps.ground import Ground
from carstage_sim.mesh import Material, TriangleMesh
from carstage_sim.world.contacts import TOWN, Contact, axes_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_CUTS_M = (0.3, 0.7, 1.2)
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
        self._cells = CellIndex(corners, _CELL_M)

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
        axes = axes_of(yaw_rad[rows])
        reach = np.einsum("nak,na->nk", np.abs(axes), half_size[rows])
        middle = center[rows, :2]
        box, segment = self._cells.within(middle - reach, middle + reach)
        near = np.abs(center[rows[box], 2] - self.level[segment]) < _SAME_LEVEL_M
        near &= self._shown[segment]
        box, segment = box[near], segment[near]
        if not len(box):
            return []
        depth, normal, point = _box_meets_segment(
            np.einsum("pak,pk->pa", axes[box], self.start[segment] - middle[box]),
            np.einsum("pak,pk->pa", axes[box], self.end[segment] - middle[box]),
            half_size[rows[box]],
        )
        touching = np.flatnonzero(depth > 0.0)
        deepest: dict[tuple[int, int, int], int] = {}
        for k in touching[np.argsort(-depth[touching], kind="stable")].tolist():
            piece = int(segment[k])
            key = (
                int(box[k]),
                int(self.object_id[piece]),
                piece if not self.object_id[piece] else 0,
            )
            deepest.setdefault(key, k)
        return [
            Contact(
                int(rows[box[k]]),
                TOWN,
                normal[k] @ axes[box[k]],
                float(depth[k]),
                middle[box[k]] + point[k] @ axes[box[k]],
                int(self.object_id[segment[k]]),
                int(self.label[segment[k]]),
            )
            for _, k in sorted(deepest.items())
        ]


def _box_meets_segment(
    start: FloatArray, end: FloatArray, half_size: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Boxes around the origin and segments in their frames, ``(P, 2)`` each.

    Returns:
        ``(P,)`` depth, not positive where they do not touch; ``(P, 2)`` normal towards the segment;
        ``(P, 2)`` middle of the part of the segment that is in the box.
    """
    along = end - start
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1) / length[:, None]
    distance = np.einsum("pk,pk->p", across, start)
    across *= np.where(distance < 0.0, -1.0, 1.0)[:, None]
    reach = np.einsum("pk,pk->p", np.abs(across), half_size)
    depths = [reach - np.abs(distance)]
    normals = [across]
    low, high = np.minimum(start, end), np.maximum(start, end)
    for axis in range(2):
        ahead = half_size[:, axis] - low[:, axis]
        behind = half_size[:, axis] + high[:, axis]
        normal = np.zeros_like(start)
        normal[:, axis] = np.where(ahead <= behind, 1.0, -1.0)
        depths.append(np.minimum(ahead, behind))
        normals.append(normal)
    depth = np.stack(depths)
    best = depth.argmin(axis=0)
    pairs = np.arange(len(start))

    # The part of the segment within the box (Liang and Barsky).
    with np.errstate(divide="ignore", invalid="ignore"):
        entry = (np.where(along > 0.0, -half_size, half_size) - start) / along
        leave = (np.where(along > 0.0, half_size, -half_size) - start) / along
    still = along == 0.0
    enters = np.clip(np.where(still, 0.0, entry).max(axis=1), 0.0, 1.0)
    leaves = np.clip(np.where(still, 1.0, leave).min(axis=1), 0.0, 1.0)
    point = start + (0.5 * (enters + leaves))[:, None] * along
    return depth[best, pairs], np.stack(normals)[best, pairs], point


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


def _cuts(mesh: TriangleMesh, ground: Ground) -> _Outlines:
    """Where the planes above the ground cut the hard triangles, piece by piece."""
    hard = ~np.isin(mesh.tag, _SOFT_LABELS) & (mesh.material != Material.FOLIAGE)
    hard = np.flatnonzero(hard)
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
