"""Bounding volume hierarchies: binned surface-area splits, collapsed to eight children per node.

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
def _split_place(low, high, order, start, end, bin_low, bin_high, bin_count, right_cost):  # type: ignore[no-untyped-def]
    """Axis and centroid below which a range of boxes is best split; axis -1 for none."""
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
            right_cost[b] = _half_area(bin_low[_BINS], bin_high[_BINS]) * count if count else 0.0
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
            cost = _half_area(bin_low[_BINS], bin_high[_BINS]) * count + right_cost[b + 1]
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
                low, high, order, start, end, bin_low, bin_high, bin_count, right_cost
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
def _widen(box, left, spans):  # type: ignore[no-untyped-def]
    """Collapse a binary hierarchy: each wide node takes in the largest of its grandchildren."""
    count = left.shape[0]
    planes = np.empty((count, 6, LANES), np.float32)
    children = np.empty((count, LANES), np.int32)
    leaf_first = np.empty(count, np.int32)
    leaf_count = np.empty(count, np.int32)
    source = np.empty(count, np.int32)
    members = np.empty(LANES, np.int32)
    source[0] = 0
    used, leaves, wide = 1, 0, 0
    while wide < used:
        root = source[wide]
        held = 1
        members[0] = root
        while held < LANES:
            chosen, largest = -1, -1.0
            for k in range(held):
                if left[members[k]] >= 0:
                    area = _half_area(box[members[k], 0], box[members[k], 1])
                    if area > largest:
                        chosen, largest = k, area
            if chosen < 0:
                break
            first = left[members[chosen]]
            members[chosen] = first
            members[held] = first + 1
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
            if left[member] >= 0:
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
    planes, children, first, count = _widen(box, left, spans)
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
