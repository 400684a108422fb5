"""Every species of tree, and bushes and hedges, one by one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.render.sheets import DAY, Shot, around, pictures_of
from carstage_sim.content.shrubs import bush_mesh, far_tree_mesh, hedge_mesh
from carstage_sim.content.trees import TREE_KINDS, tree_mesh
from carstage_sim.mesh import TriangleMesh
from carstage_sim.render.scene import Placement

_FOV_DEG = 34.0
_TURN_DEG = 205.0


def _meshes() -> dict[str, TriangleMesh]:
    """A plant of each kind, in the middle of its heights."""
    rng = np.random.default_rng(5)
    plants = {kind.name: tree_mesh(kind, sum(kind.height_m) / 2, rng) for kind in TREE_KINDS}
    linden = TREE_KINDS[0]
    plants["Linden, October"] = tree_mesh(linden, sum(linden.height_m) / 2, rng, autumn=True)
    plants["bush"] = bush_mesh(0.9, rng)
    plants["hedge"] = hedge_mesh(3.0, 1.05, 0.7, rng)
    plants["of a far wood"] = far_tree_mesh(10.0, rng)
    return plants


def tree_pictures(width: int, height: int) -> dict[str, NDArray[np.uint8]]:
    """A picture of each plant by its name, twelve in all."""
    plants = _meshes()
    shots = []
    for name, mesh in plants.items():
        low, high = mesh.bounds.astype(np.float64)
        wide = float(np.hypot(*np.abs([low[:2], high[:2]]).max(axis=0)))
        reach = max(wide, 0.56 * float(high[2]) * width / height)
        away = 1.1 * reach / math.tan(math.radians(_FOV_DEG) / 2.0)
        middle = (0.0, 0.0, 0.5 * float(high[2]))
        eye, rotation = around(middle, away, _TURN_DEG, max(0.4 * float(high[2]), 1.2))
        place = Placement(1, name, np.zeros(3), np.eye(3))
        shots.append(Shot(name, [place], eye, rotation, _FOV_DEG, DAY))
    return pictures_of(shots, plants.__getitem__, width, height)
