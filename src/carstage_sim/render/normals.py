"""Normals of what rays met, as the normals camera shows them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import Hits, RayCaster
from carstage_sim.render.crew import do, for_workers
from carstage_sim.render.scene import Frame
from carstage_sim.render.surface import normals_at, turned_normals

_TOGETHER = 256
"""Rays whose normals are turned in one loop without branches, eight at a time."""


class _Scratch(NamedTuple):
    """Working memory of one thread: ``(9, 256)`` float32 directions and normals."""

    seen: NDArray[np.float32]


@device
def _normals_part(  # type: ignore[no-untyped-def]
    memory, scene, static, actors, row, triangle, weights, directions, out, worker, first, last
):
    seen = memory[worker]
    for begin in range(first, last, _TOGETHER):
        count = min(_TOGETHER, last - begin)
        for k in range(count):
            i = begin + k
            for axis in range(3):
                seen[axis, k] = directions[i, axis]
            if row[i] != NOTHING:
                surfaces = static if row[i] < 0 else actors
                n = normals_at(scene, surfaces, row[i], triangle[i], weights[i, 0], weights[i, 1])
                for axis in range(6):
                    seen[3 + axis, k] = n[axis]
        for k in range(count):
            dx, dy, dz = seen[0, k], seen[1, k], seen[2, k]
            scale = np.float32(1) / math.sqrt(dx * dx + dy * dy + dz * dz)
            n = turned_normals(
                (seen[3, k], seen[4, k], seen[5, k]),
                (seen[6, k], seen[7, k], seen[8, k]),
                np.float32(1),
                (dx * scale, dy * scale, dz * scale),
            )
            seen[3, k], seen[4, k], seen[5, k] = n[0], n[1], n[2]
        for k in range(count):
            i = begin + k
            for axis in range(3):
                out[i, axis] = seen[3 + axis, k] if row[i] != NOTHING else np.float32(0)


@kernel
def _normals(data, board, job, work):  # type: ignore[no-untyped-def]
    do(_normals_part, data, board, job, work)


def smooth_normals(caster: RayCaster, frame: Frame, hits: Hits) -> NDArray[np.float32]:
    """``(N, 3)`` float32 unit normal (world) of the surface that each ray met, else 0.

    Between the corners it is interpolated, as for shading. It faces the ray's origin: one that the
    interpolation turns away is bent back just so far.
    """
    out = np.empty((len(hits.row), 3), np.float32)
    memory = for_workers(caster.crew, _Scratch(np.empty((9, _TOGETHER), np.float32)))
    data = (
        memory.seen, frame.scene, frame.static, frame.actors, hits.row, hits.triangle,
        hits.weights, hits.directions, out,
    )  # fmt: skip
    caster.in_parts(_normals, data, len(out))
    return out
