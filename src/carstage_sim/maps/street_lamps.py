"""Where the street lamps of a town are, so that world and renderer count them alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.mesh import Material, TriangleMesh

_PATCH_M = 2.0


@dataclass(frozen=True, slots=True)
class StreetLamps:
    """The lamps of a town; the index of a row is the lamp's number.

    Attributes:
        location: ``(L, 3)`` float64 world metres, the middle of the luminous surface.
        object_id: ``(L,)`` uint32 level object that carries it (as in the mesh: index + 1), 0 for
            none.
    """

    location: NDArray[np.float64]
    object_id: NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.location)


def street_lamps(mesh: TriangleMesh | None) -> StreetLamps:
    """The lamps of a mesh: one per level object with a surface of ``STREET_LAMP``.

    Luminous triangles of no object belong to one lamp when they lie in the same two metres.
    """
    if mesh is None:
        return StreetLamps(np.empty((0, 3)), np.empty(0, np.uint32))
    (bright,) = np.nonzero(mesh.material == Material.STREET_LAMP)
    middle = mesh.vertices[mesh.triangles[bright]].mean(axis=1).astype(np.float64)
    owner = mesh.object_id[bright]
    patch = np.where(owner[:, None] > 0, 0.0, np.round(middle / _PATCH_M))
    keys = np.column_stack([owner, patch])
    _, first, lamp = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    lamp = lamp.reshape(-1)
    count = np.bincount(lamp, minlength=len(first))
    location = np.column_stack(
        [np.bincount(lamp, middle[:, axis], len(first)) / count for axis in range(3)]
    ).reshape(-1, 3)
    order = np.argsort(first, kind="stable")
    return StreetLamps(location[order], owner[first][order].astype(np.uint32))
