"""The hierarchy holds every box once, inside its parents' boxes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from carstage_sim.render.bvh import build_tree, refitted_tree, triangle_blocks

pytestmark = pytest.mark.xdist_group("kernels")


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 300),
    leaf=st.sampled_from([1, 8]),
    same=st.booleans(),
    moved=st.booleans(),
)
def test_every_box_is_in_exactly_one_leaf_inside_its_parents(seed, count, leaf, same, moved):
    rng = np.random.default_rng(seed)
    low = rng.uniform(-100, 100, (1 if same else count, 3)).astype(np.float32)
    low = np.broadcast_to(low, (count, 3)).copy()
    high = low + rng.uniform(0, 5, (count, 3)).astype(np.float32)
    tree = build_tree(low, high, leaf)
    if moved:
        low += rng.uniform(-20, 20, (count, 3)).astype(np.float32)
        high = low + rng.uniform(0, 5, (count, 3)).astype(np.float32)
        tree = refitted_tree(tree, low, high)
    assert sorted(tree.order.tolist()) == list(range(count))
    assert tree.leaf_count.max() <= leaf
    assert tree.leaf_count.sum() == count

    def members_of(node):
        found = []
        for lane in range(8):
            child = tree.children[node, lane]
            box_low, box_high = tree.planes[node, :3, lane], tree.planes[node, 3:, lane]
            if box_low[0] > box_high[0]:
                continue
            if child >= 0:
                inside = members_of(child)
            else:
                first = tree.leaf_first[-1 - child]
                inside = tree.order[first : first + tree.leaf_count[-1 - child]].tolist()
            assert np.all(low[inside] >= box_low)
            assert np.all(high[inside] <= box_high)
            found += inside
        return found

    assert sorted(members_of(0)) == list(range(count))


def test_leaves_and_nodes_are_nearly_full():
    rng = np.random.default_rng(1)
    low = rng.uniform(-100, 100, (4000, 3)).astype(np.float32)
    tree = build_tree(low, low + rng.uniform(0, 5, (4000, 3)).astype(np.float32), 8)
    assert tree.leaf_count.mean() > 7
    assert (tree.planes[:, 0] < np.inf).sum(axis=1).mean() > 5.5


def test_blocks_hold_each_triangle_with_its_corners():
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(101, 3, 3)).astype(np.float32)
    tree = build_tree(corners.min(axis=1), corners.max(axis=1), 8)
    blocks, numbers = triangle_blocks(tree, corners)
    used = numbers >= 0
    assert sorted(numbers[used].tolist()) == list(range(101))
    lanes = blocks.transpose(0, 2, 1).reshape(-1, 3, 3)
    assert np.array_equal(lanes[used.reshape(-1)], corners[numbers[used]])
    assert np.all(blocks.transpose(0, 2, 1)[~used] == 0)


def test_a_hierarchy_is_not_fitted_to_another_number_of_boxes():
    tree = build_tree(np.zeros((3, 3), np.float32), np.ones((3, 3), np.float32), 8)
    with pytest.raises(ValueError, match="over 3 boxes cannot hold 4"):
        refitted_tree(tree, np.zeros((4, 3), np.float32), np.ones((4, 3), np.float32))


def test_nothing_to_build_over_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        build_tree(np.empty((0, 3), np.float32), np.empty((0, 3), np.float32), 8)
