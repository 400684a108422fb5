"""A LiDAR's rays and returns are those of NumPy, in order, whatever the number of threads."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.laser_kernels import RAYS, Lasers, aim_lasers, gather_returns
from carstage_sim.sensors.lidar import laser_directions
from carstage_sim.sensors.view import turned

pytestmark = pytest.mark.xdist_group("kernels")

_TURN = (12.0, -130.0, 3.0)


@pytest.mark.parametrize("threads", [1, 4])
@pytest.mark.parametrize("share", [None, 0.7, 0.0])
def test_rays_and_returns_are_numpys(threads: int, share: float | None) -> None:
    rng = np.random.default_rng(8)
    up, around = rng.uniform(-0.5, 0.2, 9), rng.uniform(-3.0, 3.0, 1501)
    count = len(up) * len(around)
    chosen = slice(None) if share is None else rng.random(count) < share
    rays = laser_directions(up, around)[chosen]
    laser_of = np.repeat(np.arange(len(up)), len(around))[chosen]
    sent = np.empty(0, np.intp) if share is None else np.flatnonzero(chosen)
    lasers = Lasers(np.cos(up), np.sin(up), np.cos(around), np.sin(around), sent)
    caster, aimed = RayCaster(threads), np.empty((len(rays), 3), np.float32)
    rotation = np.ascontiguousarray(rotation_matrix(_TURN))
    caster.in_parts(aim_lasers, (lasers, rotation, aimed), len(rays), RAYS)
    np.testing.assert_array_equal(aimed, turned(rays, _TURN))

    row = rng.choice(np.array([NOTHING, -1, 3], np.int32), len(rays))
    t = rng.random(len(rays), np.float32)
    met, places = np.empty(len(rays), np.bool_), np.zeros(len(rays) // RAYS + 2, np.int64)
    local, lasers_back = np.empty((len(rays), 3)), np.empty(len(rays), np.intp)
    distance = np.empty(len(rays))
    data = lasers, row, t, met, places, local, lasers_back, distance
    caster.in_parts(gather_returns, data, len(rays), RAYS)
    caster.close()
    back = row != NOTHING
    np.testing.assert_array_equal(met, back)
    assert places[-1] == back.sum()
    for found, wanted in ((local, rays), (lasers_back, laser_of), (distance, t)):
        np.testing.assert_array_equal(found[: places[-1]], wanted[back])
