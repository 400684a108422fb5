"""Hierarchies for cards: two children per node, made from those with eight.

A card tests one ray per lane; there, deciding between two boxes costs less than sorting eight.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import builder
from carstage_sim.render.cast import Geometry
from carstage_sim.render.vector_code import LANES

_COUNT_BITS = 4
"""A leaf's reference is ``-1 - (first triangle << 4 | triangles)``."""


_MOST_IN_LEAF = 2


class BinaryTree(NamedTuple):
    """Hierarchies with two children per node.

    Attributes:
        boxes: ``(M, 2, 2, 3)`` float32 lowest and highest corner of each child.
        children: ``(M, 2)`` int32: a node, or ``-1 - leaf``; leaf -1 does not exist.
        first: ``(N,)`` int32 node that each node of the wide tree became.
        depth: levels of the deepest.
    """

    boxes: NDArray[np.float32]
    children: NDArray[np.int32]
    first: NDArray[np.int32]
    depth: int


@builder
def _cut(members, count, low, high, order):  # type: ignore[no-untyped-def]
    """Sort ``members`` so that a cut is good, and return how many stand before it."""
    best, best_axis, best_at = np.inf, 0, 1
    for axis in range(4):
        along = axis if axis < 3 else best_axis
        for i in range(1, count):
            m = members[i]
            key = low[m, along] + high[m, along]
            j = i
            while j > 0 and low[members[j - 1], along] + high[members[j - 1], along] > key:
                members[j] = members[j - 1]
                j -= 1
            members[j] = m
        if axis == 3:
            break
        for at in range(1, count):
            cost = 0.0
            for side in range(2):
                start, end = (0, at) if side == 0 else (at, count)
                area, last = 0.0, 0.0
                for k in range(4):
                    least, most = np.inf, -np.inf
                    for i in range(start, end):
                        least = min(least, low[members[i], k % 3])
                        most = max(most, high[members[i], k % 3])
                    if k:
                        area += last * (most - least)
                    last = most - least
                cost += area * (end - start)
            if cost < best:
                best, best_axis, best_at = cost, axis, at
    return best_at


@builder
def _binary(planes, children):  # type: ignore[no-untyped-def]
    """Boxes, children, first nodes, and the deepest level, of wide trees."""
    wide = planes.shape[0]
    first = np.empty(wide, np.int32)
    held = np.empty(wide, np.int32)
    total = 0
    for w in range(wide):
        count = 0
        for k in range(LANES):
            if planes[w, 0, k] <= planes[w, 3, k]:
                count += 1
        first[w], held[w] = total, count
        total += max(count - 1, 1)
    boxes = np.zeros((total, 2, 2, 3), np.float32)
    pairs = np.zeros((total, 2), np.int32)
    low, high = np.empty((LANES, 3), np.float32), np.empty((LANES, 3), np.float32)
    members, child = np.empty(LANES, np.int32), np.empty(LANES, np.int32)
    spans = np.empty((LANES, 3), np.int32)
    level = np.zeros(total, np.int32)
    deepest = 1
    for w in range(wide):
        count = 0
        for k in range(LANES):
            if planes[w, 0, k] <= planes[w, 3, k]:
                for axis in range(3):
                    low[count, axis] = planes[w, axis, k]
                    high[count, axis] = planes[w, axis + 3, k]
                child[count], members[count] = children[w, k], count
                count += 1
        used = first[w] + 1
        waiting = 1
        spans[0, 0], spans[0, 1], spans[0, 2] = first[w], 0, count
        while waiting:
            waiting -= 1
            node, start, end = spans[waiting, 0], spans[waiting, 1], spans[waiting, 2]
            cut = start + 1
            if end - start > 2:
                cut = start + _cut(members[start:end], end - start, low, high, members)
            for side in range(2):
                a, b = (start, cut) if side == 0 else (cut, end)
                if a >= b:
                    pairs[node, side] = 0
                    continue
                for axis in range(3):
                    boxes[node, side, 0, axis] = low[members[a], axis]
                    boxes[node, side, 1, axis] = high[members[a], axis]
                    for i in range(a + 1, b):
                        m = members[i]
                        boxes[node, side, 0, axis] = min(boxes[node, side, 0, axis], low[m, axis])
                        boxes[node, side, 1, axis] = max(boxes[node, side, 1, axis], high[m, axis])
                below = -1
                if b - a > 1:
                    below = used
                    spans[waiting, 0], spans[waiting, 1], spans[waiting, 2] = used, a, b
                    waiting += 1
                    used += 1
                    pairs[node, side] = below
                else:
                    target = child[members[a]]
                    if target >= 0:
                        below = first[target]
                        pairs[node, side] = below
                    else:
                        pairs[node, side] = target
                if below >= 0:
                    level[below] = level[node] + 1
                    deepest = max(deepest, level[below] + 1)
    return boxes, pairs, first, deepest


@builder
def _split(corners, leaves, most):  # type: ignore[no-untyped-def]
    """Nodes over the triangles of each leaf that has too many, and the order of the triangles.

    Returns:
        Boxes, children, what each leaf became (a node, or ``-1 - leaf``), the new leaves, the order
        of all triangles, and the levels of the deepest.
    """
    nodes = 0
    for k in range(len(leaves)):
        if leaves[k] & 15 > most:
            nodes += (leaves[k] & 15) - 1
    boxes = np.zeros((nodes, 2, 2, 3), np.float32)
    pairs = np.zeros((nodes, 2), np.int32)
    level = np.zeros(nodes, np.int32)
    became = np.empty(len(leaves), np.int32)
    made = np.empty(len(corners), np.int32)
    order = np.arange(len(corners))
    low, high = np.empty((16, 3), np.float32), np.empty((16, 3), np.float32)
    members = np.empty(16, np.int32)
    spans = np.empty((16, 3), np.int32)
    used, count, deepest = 0, 0, 0
    for k in range(len(leaves)):
        begin, held = leaves[k] >> 4, leaves[k] & 15
        if held <= most:
            became[k] = -1 - count
            made[count] = leaves[k]
            count += 1
            continue
        for i in range(held):
            members[i] = i
            for axis in range(3):
                a, b = corners[begin + i, 0, axis], corners[begin + i, 1, axis]
                c = corners[begin + i, 2, axis]
                low[i, axis], high[i, axis] = min(a, b, c), max(a, b, c)
        became[k] = used
        spans[0, 0], spans[0, 1], spans[0, 2] = used, 0, held
        level[used] = 1
        used += 1
        waiting = 1
        while waiting:
            waiting -= 1
            node, start, end = spans[waiting, 0], spans[waiting, 1], spans[waiting, 2]
            deepest = max(deepest, level[node])
            cut = start + _cut(members[start:end], end - start, low, high, members)
            for side in range(2):
                first, last = (start, cut) if side == 0 else (cut, end)
                for axis in range(3):
                    boxes[node, side, 0, axis] = np.inf
                    boxes[node, side, 1, axis] = -np.inf
                    for i in range(first, last):
                        m = members[i]
                        boxes[node, side, 0, axis] = min(boxes[node, side, 0, axis], low[m, axis])
                        boxes[node, side, 1, axis] = max(boxes[node, side, 1, axis], high[m, axis])
                if last - first > most:
                    pairs[node, side] = used
                    level[used] = level[node] + 1
                    spans[waiting, 0], spans[waiting, 1], spans[waiting, 2] = used, first, last
                    waiting += 1
                    used += 1
                else:
                    pairs[node, side] = -1 - count
                    made[count] = (begin + first) << 4 | (last - first)
                    count += 1
        for i in range(held):
            order[begin + i] = begin + members[i]
    return boxes[:used], pairs[:used], became, made[:count], order, deepest


def with_small_leaves(
    tree: BinaryTree, triangles: NDArray[np.float32], leaves: NDArray[np.int32]
) -> tuple[BinaryTree, NDArray[np.float32], NDArray[np.int32]]:
    """Hierarchies whose leaves have two triangles at most, the triangles, and the leaves.

    On a CPU a leaf's eight triangles are tested at once, on a card one after the other.

    Args:
        tree: from :func:`binary_tree`.
        triangles, leaves: from :func:`leaf_triangles`.
    """
    if not len(leaves):
        return tree, triangles, leaves
    boxes, pairs, became, made, order, deepest = _split(
        triangles[:, :, :3].copy(), leaves, _MOST_IN_LEAF
    )
    before = np.int32(len(tree.boxes))
    became = np.where(became >= 0, became + before, became)
    below = tree.children < 0
    children = np.where(below, became[np.where(below, -1 - tree.children, 0)], tree.children)
    joined = BinaryTree(
        np.concatenate([tree.boxes, boxes]),
        np.concatenate([children, np.where(pairs >= 0, pairs + before, pairs)]).astype(np.int32),
        tree.first,
        tree.depth + int(deepest),
    )
    return joined, triangles[order], made


def binary_tree(planes: NDArray[np.float32], children: NDArray[np.int32]) -> BinaryTree:
    """The hierarchies of wide trees, which stand one behind the other, parents first."""
    if not len(planes):
        none = np.empty(0, np.int32)
        return BinaryTree(np.empty((0, 2, 2, 3), np.float32), none.reshape(0, 2), none, 0)
    boxes, pairs, first, depth = _binary(planes, children)
    return BinaryTree(boxes, pairs, first, int(depth))


def leaf_triangles(
    geometry: Geometry,
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Triangles leaf after leaf, and where each leaf begins.

    Returns:
        ``(T, 3, 4)`` float32 corners, as bits behind the first the triangle's number and behind
        the second its cells, and ``(B,)`` int32 references of the leaves: ``first << 4 | count``.
    """
    used = geometry.numbers >= 0
    count = used.sum(axis=1)
    begin = np.cumsum(count) - count
    corners = geometry.corners.transpose(0, 2, 1)[used].reshape(-1, 3, 3)
    triangles = np.zeros((len(corners), 3, 4), np.float32)
    triangles[:, :, :3] = corners
    triangles.view(np.int32)[:, 0, 3] = geometry.numbers[used]
    triangles.view(np.int32)[:, 1, 3] = geometry.cells[used]
    return triangles, (begin << _COUNT_BITS | count).astype(np.int32)
