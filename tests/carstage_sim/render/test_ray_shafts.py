"""Parallel rays that are traced together meet what each meets alone."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.packets import TOGETHER, new_packet_scratch
from carstage_sim.render.scene import Placement
from carstage_sim.render.shafts import trace_along
from ray_scenes import frame_of, soup, sphere

pytestmark = pytest.mark.xdist_group("kernels")


@kernel
def along(scene, memory, places, way, high, skip, any_hit, met):
    d = (way[0], way[1], way[2])
    for begin in range(0, places.shape[0], TOGETHER):
        count = min(TOGETHER, places.shape[0] - begin)
        for i in range(count):
            for axis in range(3):
                memory.from_[axis, i] = places[begin + i, axis]
            memory.from_[3, i] = np.float32(20.0)
        memory.wanted[0] = count
        trace_along(scene, memory, d, np.float32(1e-3), high, skip, any_hit)
        for i in range(count):
            met[begin + i] = memory.met[i]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("any_hit", [True, False])
def test_the_same_is_met(seed, any_hit):
    rng = np.random.default_rng(seed)
    size = rng.choice([0.1, 1.0, 8.0], (900, 1, 1))
    corners = rng.uniform(-25, 25, (900, 1, 3)) + rng.normal(size=(900, 3, 3)) * size
    placements = [Placement(k + 1, "ball", rng.uniform(-15, 15, 3), np.eye(3)) for k in range(10)]
    frame = frame_of(soup(corners, leafy=seed % 2 == 1), placements, {"ball": sphere(2)})
    ways = [[0, 0, 1.0], [1.0, 0, 0], [0, -1.0, 0], rng.normal(size=3), rng.normal(size=3)]
    # Places of a row of pixels lie near each other; now and then one lies elsewhere.
    places = np.cumsum(rng.normal(size=(700, 3)) * 0.05, axis=0) + rng.uniform(-8, 8, 3)
    places[::9] = rng.uniform(-20, 20, places[::9].shape)
    places = places.astype(np.float32)
    caster = RayCaster(1)
    skip = int(rng.integers(-1, 4))
    for way in ways:
        way = (np.array(way) / np.linalg.norm(way)).astype(np.float32)
        high = float(rng.choice([0.7, 5.0, 300.0]))
        alone = caster.cast(
            frame.scene, places, np.tile(way, (len(places), 1)), low=1e-3, high=high, skip_row=skip
        )
        met = np.empty(len(places), np.float32)
        memory = new_packet_scratch()
        along(frame.scene, memory, places, way, np.float32(high), skip, any_hit, met)
        blocked = alone.row != -2
        assert np.array_equal(met >= 0, blocked)
        if not any_hit:
            assert np.array_equal(met[blocked], alone.t[blocked])
        assert blocked.any() or high < 1.0
