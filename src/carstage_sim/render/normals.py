"""Normals of what rays met, as the normals camera shows them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import kernel
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import Hits, RayCaster
from carstage_sim.render.scene import Frame
from carstage_sim.render.surface import facing_normals


@kernel
def _normals(scene, static, actors, row, triangle, weights, directions, first, last, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        if row[i] == NOTHING:
            out[i, 0], out[i, 1], out[i, 2] = np.float32(0), np.float32(0), np.float32(0)
            continue
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        scale = np.float32(1) / math.sqrt(dx * dx + dy * dy + dz * dz)
        normals = facing_normals(
            scene, static if row[i] < 0 else actors, row[i], triangle[i], weights[i, 0],
            weights[i, 1], False, dx * scale, dy * scale, dz * scale,
        )  # fmt: skip
        out[i, 0], out[i, 1], out[i, 2] = normals[0], normals[1], normals[2]


def smooth_normals(caster: RayCaster, frame: Frame, hits: Hits) -> NDArray[np.float32]:
    """``(N, 3)`` float32 unit normal (world) of the surface that each ray met, else 0.

    Between the corners it is interpolated, as for shading. It faces the ray's origin: one that the
    interpolation turns away is bent back just so far.
    """
    out = np.empty((len(hits.row), 3), np.float32)

    def work(first: int, last: int) -> None:
        _normals(
            frame.scene, frame.static, frame.actors, hits.row, hits.triangle, hits.weights,
            hits.directions, first, last, out,
        )  # fmt: skip

    caster.in_bands(len(out), work)
    return out
