"""Bounding volume hierarchies: binned surface-area splits, best collapsed to eight children a node.

A hierarchy is built over boxes alone, so that the same code serves triangles (leaves of up to
eight, one block of :mod:`carstage_sim.render.simd`) and instances (leaves of one).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import builder, device
from carstage_sim.render.vector_code import LANES

_BINS = 16
_LEAF_COST, _BOX_COST = np.float32(1.5), np.float32(0.15)
"""Cost of a leaf, and of each of its boxes, in units of a node's."""
_EMPTY = np.int32(np.iinfo(np.int32).min)


@dataclass(frozen=True, slots=True)
class WideTree:
    """A hierarchy with eight children per node; node 0 is the root.

    Attributes:
        planes: ``(N, 6, 8)`` float32: lowest x, y, z and highest x, y, z of each child's box;
            children that do not exist have their lowest above their highest.
        children: ``(N, 8)`` int32: a node's number, or ``-1 - leaf``.
        leaf_first: ``(L,)`` int32 first entry of ``order`` of each leaf.
        leaf_count: ``(L,)`` int32 entries of each leaf.
        order: ``(P,)`` int32: the boxes' numbers, leaf after leaf.
    """

    planes: NDArray[np.float32]
    children: NDArray[np.int32]
    leaf_first: NDArray[np.int32]
    leaf_count: NDArray[np.int32]
    order: NDArray[np.int32]


@device
def _half_area(low, high):  # type: ignore[no-untyped-def]
    x, y, z = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    return x * y + y * z + z * x


@device
def _split_place(low, high, order, start, end, leaf_size, bin_low, bin_high, bin_count, right_cost):  # type: ignore[no-untyped-def]
    """Axis and centroid below which a range of boxes is best split; axis -1 for none.

    What counts is how many leaves each part takes: a leaf's boxes are all tested at once.
    """
    best_cost = np.inf
    best_axis = -1
    best_place = 0.0
    for axis in range(3):
        c_low, c_high = np.inf, -np.inf
        for i in range(start, end):
            c = low[order[i], axis] + high[order[i], axis]
            c_low, c_high = min(c_low, c), max(c_high, c)
        if not c_high > c_low:
            continue
        scale = _BINS * 0.999999 / (c_high - c_low)
        bin_low[:] = np.inf
        bin_high[:] = -np.inf
        bin_count[:] = 0
        for i in range(start, end):
            p = order[i]
            b = int((low[p, axis] + high[p, axis] - c_low) * scale)
            bin_count[b] += 1
            for k in range(3):
                bin_low[b, k] = min(bin_low[b, k], low[p, k])
                bin_high[b, k] = max(bin_high[b, k], high[p, k])
        count = 0
        for b in range(_BINS - 1, 0, -1):
            count += bin_count[b]
            for k in range(3):
                bin_low[_BINS, k] = min(bin_low[_BINS, k], bin_low[b, k])
                bin_high[_BINS, k] = max(bin_high[_BINS, k], bin_high[b, k])
            leaves = -(-count // leaf_size)
            right_cost[b] = _half_area(bin_low[_BINS], bin_high[_BINS]) * leaves if count else 0.0
        bin_low[_BINS] = np.inf
        bin_high[_BINS] = -np.inf
        count = 0
        for b in range(_BINS - 1):
            count += bin_count[b]
            for k in range(3):
                bin_low[_BINS, k] = min(bin_low[_BINS, k], bin_low[b, k])
                bin_high[_BINS, k] = max(bin_high[_BINS, k], bin_high[b, k])
            if count == 0 or count == end - start:
                continue
            leaves = -(-count // leaf_size)
            cost = _half_area(bin_low[_BINS], bin_high[_BINS]) * leaves + right_cost[b + 1]
            if cost < best_cost:
                best_cost, best_axis = cost, axis
                best_place = c_low + (b + 1) / scale
    return best_axis, best_place


@builder
def _binary_tree(low, high, leaf_size):  # type: ignore[no-untyped-def]
    """Binary hierarchy: order, node boxes, first child (-1: leaf; the second follows), ranges."""
    count = low.shape[0]
    order = np.arange(count).astype(np.int32)
    box = np.empty((2 * count, 2, 3), np.float32)
    left = np.full(2 * count, -1, np.int32)
    spans = np.empty((2 * count, 2), np.int32)
    bin_low = np.empty((_BINS + 1, 3), np.float32)
    bin_high = np.empty((_BINS + 1, 3), np.float32)
    bin_count = np.empty(_BINS, np.int64)
    right_cost = np.empty(_BINS, np.float64)
    spans[0, 0], spans[0, 1] = 0, count
    used = 1
    node = 0
    while node < used:
        start, end = spans[node, 0], spans[node, 1]
        for k in range(3):
            box[node, 0, k], box[node, 1, k] = np.inf, -np.inf
        for i in range(start, end):
            for k in range(3):
                box[node, 0, k] = min(box[node, 0, k], low[order[i], k])
                box[node, 1, k] = max(box[node, 1, k], high[order[i], k])
        if end - start > leaf_size:
            axis, place = _split_place(
                low, high, order, start, end, leaf_size, bin_low, bin_high, bin_count, right_cost
            )
            middle = start
            if axis >= 0:
                i, j = start, end - 1
                while i <= j:
                    p = order[i]
                    if low[p, axis] + high[p, axis] < place:
                        i += 1
                    else:
                        order[i], order[j] = order[j], p
                        j -= 1
                middle = i
            if middle in (start, end):
                middle = (start + end) // 2
            left[node] = used
            spans[used, 0], spans[used, 1] = start, middle
            spans[used + 1, 0], spans[used + 1, 1] = middle, end
            used += 2
        node += 1
    return order, box[:used], left[:used], spans[:used]


@builder
def _best_ways(box, left, spans, leaf_size):  # type: ignore[no-untyped-def]
    """How nodes of a binary hierarchy are best put into wide nodes.

    The least expected cost is found from the leaves up, for each number of children that a node may
    become (Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed
    Wide BVHs", HPG 2017).

    Returns:
        ``(N, 8)`` int8: how many of ``k + 1`` children that a node becomes its first half gets, 0
        where it stays one child. At ``k = 0`` the same of the eight children that it has as a wide
        node, 0 where it is a leaf.
    """
    count = left.shape[0]
    cost = np.empty((count, LANES), np.float32)
    way = np.zeros((count, LANES), np.int8)
    for node in range(count - 1, -1, -1):
        area = _half_area(box[node, 0], box[node, 1])
        held = spans[node, 1] - spans[node, 0]
        alone = area * (_LEAF_COST + _BOX_COST * held)
        first = left[node]
        if first >= 0:
            for k in range(1, LANES):
                least, taken = np.float32(np.inf), 1
                for one in range(k):
                    both = cost[first, one] + cost[first + 1, k - 1 - one]
                    if both < least:
                        least, taken = both, one + 1
                cost[node, k], way[node, k] = least, taken
            if held > leaf_size or cost[node, LANES - 1] + area < alone:
                alone = cost[node, LANES - 1] + area
                way[node, 0] = way[node, LANES - 1]
        cost[node, 0] = alone
        for k in range(1, LANES):
            if first < 0 or alone <= cost[node, k]:
                cost[node, k], way[node, k] = alone, 0
    return way


@builder
def _widen(box, left, spans, way):  # type: ignore[no-untyped-def]
    """Collapse a binary hierarchy as :func:`_best_ways` says."""
    count = left.shape[0]
    planes = np.empty((count, 6, LANES), np.float32)
    children = np.empty((count, LANES), np.int32)
    leaf_first = np.empty(count, np.int32)
    leaf_count = np.empty(count, np.int32)
    source = np.empty(count, np.int32)
    members = np.empty(LANES, np.int32)
    rooms = np.empty(LANES, np.int32)
    source[0] = 0
    used, leaves, wide = 1, 0, 0
    while wide < used:
        root = source[wide]
        members[0] = root
        held, k = 1, 0
        if way[root, 0]:
            members[0], rooms[0] = left[root], way[root, 0] - 1
            members[1], rooms[1] = left[root] + 1, LANES - 1 - way[root, 0]
            held = 2
        while k < held:
            member, room = members[k], rooms[k]
            if held == 1 or room == 0 or not way[member, room]:
                k += 1
                continue
            members[k], rooms[k] = left[member], way[member, room] - 1
            members[held], rooms[held] = left[member] + 1, room - way[member, room]
            held += 1
        for k in range(LANES):
            if k >= held:
                children[wide, k] = _EMPTY
                for axis in range(3):
                    planes[wide, axis, k] = np.inf
                    planes[wide, axis + 3, k] = -np.inf
                continue
            member = members[k]
            for axis in range(3):
                planes[wide, axis, k] = box[member, 0, axis]
                planes[wide, axis + 3, k] = box[member, 1, axis]
            if way[member, 0]:
                children[wide, k] = used
                source[used] = member
                used += 1
            else:
                children[wide, k] = -1 - leaves
                leaf_first[leaves] = spans[member, 0]
                leaf_count[leaves] = spans[member, 1] - spans[member, 0]
                leaves += 1
        wide += 1
    return planes[:used], children[:used], leaf_first[:leaves], leaf_count[:leaves]


def build_tree(low: NDArray[np.float32], high: NDArray[np.float32], leaf_size: int) -> WideTree:
    """Hierarchy over ``(P, 3)`` float32 boxes, P > 0, with at most ``leaf_size`` in a leaf."""
    if not len(low):
        raise ValueError("a hierarchy needs at least one box")
    order, box, left, spans = _binary_tree(
        np.ascontiguousarray(low, np.float32), np.ascontiguousarray(high, np.float32), leaf_size
    )
    way = _best_ways(box, left, spans, leaf_size)
    planes, children, first, count = _widen(box, left, spans, way)
    return WideTree(planes.copy(), children.copy(), first.copy(), count.copy(), order)


@builder
def _refit(planes, children, leaf_first, leaf_count, order, low, high):  # type: ignore[no-untyped-def]
    """Give each child its box anew, the deepest first: children have higher numbers."""
    for node in range(len(children) - 1, -1, -1):
        for k in range(LANES):
            child = children[node, k]
            if child == _EMPTY:
                continue
            for axis in range(3):
                least, most = np.float32(np.inf), np.float32(-np.inf)
                if child >= 0:
                    for lane in range(LANES):
                        least = min(least, planes[child, axis, lane])
                        most = max(most, planes[child, axis + 3, lane])
                else:
                    leaf = -1 - child
                    for i in range(leaf_first[leaf], leaf_first[leaf] + leaf_count[leaf]):
                        least = min(least, low[order[i], axis])
                        most = max(most, high[order[i], axis])
                planes[node, axis, k] = least
                planes[node, axis + 3, k] = most


def refitted_tree(tree: WideTree, low: NDArray[np.float32], high: NDArray[np.float32]) -> WideTree:
    """The same hierarchy over boxes that have moved a little: quicker than a new one.

    Args:
        tree: a hierarchy over as many boxes.
        low, high: ``(P, 3)`` float32, where they are now.
    """
    if len(low) != len(tree.order):
        raise ValueError(f"a hierarchy over {len(tree.order)} boxes cannot hold {len(low)}")
    planes = tree.planes.copy()
    _refit(
        planes, tree.children, tree.leaf_first, tree.leaf_count, tree.order,
        np.ascontiguousarray(low, np.float32), np.ascontiguousarray(high, np.float32),
    )  # fmt: skip
    return replace(tree, planes=planes)


def triangle_blocks(
    tree: WideTree, corners: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Leaf blocks of a tree over triangles.

    Args:
        tree: built with a leaf size of at most eight.
        corners: ``(T, 3, 3)`` float32 corners of each triangle.

    Returns:
        ``(L, 9, 8)`` float32 corner coordinates, coordinate after coordinate, and ``(L, 8)`` int32
        triangle numbers, -1 where a block is not full (its corners are all zero there).
    """
    lane = np.arange(LANES, dtype=np.int32)
    used = lane < tree.leaf_count[:, None]
    place = np.where(used, tree.leaf_first[:, None] + lane, 0)
    numbers = np.where(used, tree.order[place], np.int32(-1)).astype(np.int32)
    # Lanes run fastest; each block's numbers are sorted so that ties need no search.
    numbers = np.where(numbers < 0, np.int32(np.iinfo(np.int32).max), numbers)
    numbers.sort(axis=1)
    used = numbers < np.iinfo(np.int32).max
    numbers[~used] = -1
    blocks = corners[np.where(used, numbers, 0)].reshape(-1, LANES, 9)
    blocks = np.where(used[:, :, None], blocks, np.float32(0))
    return np.ascontiguousarray(blocks.transpose(0, 2, 1), dtype=np.float32), numbers
