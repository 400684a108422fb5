"""The hierarchies of a scene in a card's memory, and how they get there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.cast import Geometry, Scene, empty_geometry
from carstage_sim.render.gpu.binary import (
    BinaryTree,
    binary_tree,
    leaf_triangles,
    with_small_leaves,
)
from carstage_sim.render.gpu.device import Gpu

Words = NDArray[np.uint32]

_NODE, _TRIANGLE, _PLACE = 16, 12, 16
"""Words of a node, of a triangle, and of an instance's place."""
_COUNT_BITS = 4
_ABSENT = np.int32(0)
"""A child that does not exist: no hierarchy has its root below another node."""


def node_words(tree: BinaryTree, nodes: int, leaves: NDArray[np.int32]) -> Words:
    """``(M, 16)`` words of nodes.

    Args:
        tree: the hierarchies.
        nodes: that stand before theirs.
        leaves: what each leaf becomes: not negative.
    """
    words = np.zeros((len(tree.boxes), _NODE), np.uint32)
    boxes = tree.boxes.transpose(0, 1, 3, 2)  # node, side, axis, low or high
    words[:, 0:4] = np.ascontiguousarray(boxes[:, 0, :2]).reshape(-1, 4).view(np.uint32)
    words[:, 4:8] = np.ascontiguousarray(boxes[:, 1, :2]).reshape(-1, 4).view(np.uint32)
    words[:, 8:12] = np.ascontiguousarray(boxes[:, :, 2]).reshape(-1, 4).view(np.uint32)
    children = tree.children
    inner = children > 0
    reference = leaves[np.where(children < 0, -1 - children, 0)] if len(leaves) else children
    placed = np.where(inner, children + nodes, np.where(children < 0, -1 - reference, _ABSENT))
    words[:, 12:14] = placed.astype(np.int32).view(np.uint32)
    return words


def _hierarchy(
    geometry: Geometry,
) -> tuple[BinaryTree, NDArray[np.float32], NDArray[np.int32]]:
    """Nodes, triangles and leaves of a geometry as the card has them."""
    return with_small_leaves(
        binary_tree(geometry.planes, geometry.children), *leaf_triangles(geometry)
    )


class GpuGeometry:
    """Keeps a card's copy of the hierarchies up to date.

    Attributes:
        nodes: of the hierarchy over instances, of the town's, and of those of the actors' meshes.
        triangles: of the town, leaf after leaf, and behind them those of the meshes.
        places: where each instance is.
        extent: sizes, as ``Extent`` in ``trace.wgsl`` has them.
        stack: entries that a ray's stack needs.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._static: Geometry = empty_geometry()
        self._actors: Geometry = empty_geometry()
        self._reserved = 256
        self._town = (0, 0, 0)
        self._roots = np.empty(0, np.int32)
        self._depth = self._town_depth = 0
        self._scene: Scene | None = None
        self.nodes = gpu.storage(self._reserved * _NODE * 4)
        self.triangles = gpu.storage(_TRIANGLE * 4)
        self.places = gpu.storage(1 << 14)
        self.extent = gpu.uniform(16)
        self.stack = 32

    @property
    def buffers(self) -> tuple[Any, ...]:
        """Buffers of bind group 0, in the order of their bindings."""
        return self.nodes, self.triangles, self.places, self.extent

    def update(self, scene: Scene) -> None:
        """Bring what differs from the last scene to the card."""
        if scene is self._scene:
            return
        self._scene = scene
        over = binary_tree(scene.top_planes, scene.top_children)
        # A scene without its town passes by: the town's copy stays.
        town = scene.static if len(scene.static.planes) else self._static
        new_town = town is not self._static
        if len(over.boxes) > self._reserved:
            self._reserved, new_town = 2 * len(over.boxes), True
        if new_town or scene.actors is not self._actors:
            self._upload(town, scene.actors, new_town)
        self._upload_instances(scene, over)

    def _upload(self, static: Geometry, actors: Geometry, new_town: bool) -> None:
        tree, triangles, leaves = _hierarchy(actors)
        if new_town:
            town, town_triangles, town_leaves = _hierarchy(static)
            self._town = (len(town.boxes), len(town_triangles), town.depth)
        first, before, town_depth = self._reserved + self._town[0], self._town[1], self._town[2]
        words = node_words(tree, first, leaves + (before << _COUNT_BITS))
        parts = (("nodes", first * _NODE, words), ("triangles", before * _TRIANGLE, triangles))
        for name, start, array in parts:
            if getattr(self, name).size < (start + array.size) * 4:
                if not new_town:
                    self._upload(static, actors, True)
                    return
                # Room for the models that are still to come.
                setattr(self, name, self._gpu.storage((start + 2 * array.size + 4096) * 4))
        for name, start, array in parts:
            self._gpu.write(getattr(self, name), array, start * 4)
        if new_town:
            own = node_words(town, self._reserved, town_leaves)
            self._gpu.write(self.nodes, own, self._reserved * _NODE * 4)
            self._gpu.write(self.triangles, town_triangles)
        self._static, self._actors = static, actors
        self._roots = tree.first + np.int32(first)
        self._depth, self._town_depth = tree.depth, town_depth

    def _upload_instances(self, scene: Scene, over: BinaryTree) -> None:
        rows = scene.top_row
        place = np.zeros((len(rows), 4, 4), np.float32)
        place[:, :3, :3] = scene.rotation[rows].transpose(0, 2, 1)
        place[:, :3, 3] = scene.position[rows]
        last = place.view(np.int32)[:, 3]
        last[:, 0] = self._roots[scene.root[rows]]
        last[:, 1] = rows
        if self.places.size < place.nbytes:
            self.places = self._gpu.storage(2 * place.nbytes)
        self._gpu.write(self.places, place)
        self._gpu.write(self.nodes, node_words(over, 0, np.arange(len(rows), dtype=np.int32)))
        root = self._reserved if len(scene.static.planes) else -1
        self._gpu.write(self.extent, np.array([len(rows) > 0, root, 0, 0], np.int32))
        # The town's nodes and those over instances do not wait at the same time.
        needed = max(self._town_depth, self._depth + over.depth) + 2
        self.stack = max(self.stack, -(-needed // 8) * 8)
