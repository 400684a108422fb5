"""Rays of a LiDAR's lasers, and which of them met something, in the order of the rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.crew import do, do_step

RAYS = 2048
"""Rays per piece of work."""


class Lasers(NamedTuple):
    """The rays of a sweep: each laser's, one step after the other.

    Attributes:
        level, up: ``(C,)`` float64 cosine and sine of each laser's elevation.
        ahead, aside: ``(S,)`` float64 cosine and sine of each step's azimuth.
        fired: ``(N,)`` int64 numbers of the rays that are sent, ``laser * S + step``; none: all.
    """

    level: NDArray[np.float64]
    up: NDArray[np.float64]
    ahead: NDArray[np.float64]
    aside: NDArray[np.float64]
    fired: NDArray[np.int64]


@device
def _of_ray(lasers, ray):  # type: ignore[no-untyped-def]
    """Laser and step of a ray."""
    steps = lasers.ahead.shape[0]
    number = lasers.fired[ray] if lasers.fired.shape[0] else ray
    laser = number // steps
    return laser, number - laser * steps


@device
def _aim_part(lasers, rotation, directions, worker, first, last):  # type: ignore[no-untyped-def]
    for ray in range(first, last):
        laser, step = _of_ray(lasers, ray)
        x, y = lasers.level[laser] * lasers.ahead[step], lasers.level[laser] * lasers.aside[step]
        z = lasers.up[laser]
        for axis in range(3):
            directions[ray, axis] = np.float32(
                x * rotation[axis, 0] + y * rotation[axis, 1] + z * rotation[axis, 2]
            )


@kernel
def aim_lasers(data, board, job, work):  # type: ignore[no-untyped-def]
    """World directions of rays.

    The data are :class:`Lasers`, ``(3, 3)`` float64 world_from_sensor, and ``(N, 3)`` float32 that
    receives them.
    """
    do(_aim_part, data, board, job, work)


@device
def _count_part(row, met, places, worker, first, last):  # type: ignore[no-untyped-def]
    count = 0
    for ray in range(first, last):
        met[ray] = row[ray] != NOTHING
        count += met[ray]
    places[first // RAYS] = count


@device
def _gather_part(  # type: ignore[no-untyped-def]
    lasers, t, met, places, local, laser_of, distance, worker, first, last
):
    at = places[first // RAYS]
    for ray in range(first, last):
        if met[ray]:
            laser, step = _of_ray(lasers, ray)
            local[at, 0] = lasers.level[laser] * lasers.ahead[step]
            local[at, 1] = lasers.level[laser] * lasers.aside[step]
            local[at, 2] = lasers.up[laser]
            laser_of[at] = laser
            distance[at] = t[ray]
            at += 1


@kernel
def gather_returns(data, board, job, work):  # type: ignore[no-untyped-def]
    """Rays that met something, one behind the other; parts have :data:`RAYS` rays.

    The data are :class:`Lasers`; ``(N,)`` what each ray met and how far it is; ``(N,)`` bool that
    receives which met something; ``(N // RAYS + 2,)`` zeros whose last becomes how many; and what
    receives ``(N, 3)`` float64 directions in the sensor's frame, lasers and distances of those.
    """
    lasers, row, t, met, places, local, laser_of, distance = data
    do(_count_part, (row, met, places), board, job, work)
    count = 0
    for part in range(places.shape[0]):
        here = places[part]
        places[part] = count
        count += here
    gathering = lasers, t, met, places, local, laser_of, distance
    do_step(_gather_part, gathering, board, job, work, 1, work[1], work[2])
