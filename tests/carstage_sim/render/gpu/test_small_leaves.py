"""A card's hierarchies: the triangles of the CPU's, in leaves of two."""

from __future__ import annotations

import numpy as np

from benchmarks.simulator.conformance import random_frame
from carstage_sim.render.gpu.binary import binary_tree, leaf_triangles, with_small_leaves


def _made():
    geometry = random_frame(5, triangles=700, instances=3).scene.static
    wide = binary_tree(geometry.planes, geometry.children), *leaf_triangles(geometry)
    return wide, with_small_leaves(*wide)


def _numbers(triangles):
    return triangles.view(np.int32)[:, 0, 3]


def test_each_triangle_is_in_one_leaf_of_at_most_two():
    (_, before, _), (tree, triangles, leaves) = _made()
    assert sorted(_numbers(triangles)) == sorted(_numbers(before))
    assert set((leaves & 15).tolist()) <= {1, 2}
    held = np.concatenate([np.arange(leaf >> 4, (leaf >> 4) + (leaf & 15)) for leaf in leaves])
    assert sorted(held.tolist()) == list(range(len(triangles)))
    used = np.sort(-1 - tree.children[tree.children < 0])
    assert np.array_equal(used, np.arange(len(leaves)))


def test_every_box_holds_what_is_below_it():
    _, (tree, triangles, leaves) = _made()
    visited, deepest = [], 0
    waiting = [(0, 1)]
    while waiting:
        node, level = waiting.pop()
        deepest = max(deepest, level)
        for side in range(2):
            child = int(tree.children[node, side])
            low, high = tree.boxes[node, side]
            if child > 0:
                assert (tree.boxes[child, :, 0] >= low).all()
                assert (tree.boxes[child, :, 1] <= high).all()
                waiting.append((child, level + 1))
            elif child < 0:
                leaf = int(leaves[-1 - child])
                corners = triangles[leaf >> 4 : (leaf >> 4) + (leaf & 15), :, :3]
                assert (corners >= low).all()
                assert (corners <= high).all()
                visited.append(-1 - child)
    assert sorted(visited) == list(range(len(leaves)))
    assert deepest <= tree.depth
