"""Rays that go to a card in several lots meet what they meet in one."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.simulator.conformance import random_frame
from carstage_sim.render.gpu import caster as gpu_caster

pytestmark = pytest.mark.xdist_group("gpu")
_RAYS = 1000


@pytest.mark.parametrize("weights", [True, False])
@pytest.mark.parametrize("shared", [True, False])
def test_rays_in_lots_meet_the_same(software_gpu, monkeypatch, weights, shared):
    frame = random_frame(3, triangles=300, instances=4)
    rng = np.random.default_rng(7)
    rays = rng.normal(size=(_RAYS, 3)).astype(np.float32)
    origins = np.zeros(3) if shared else rng.normal(size=(_RAYS, 3))
    found = []
    for lot in (_RAYS, 384, 500):
        monkeypatch.setattr(gpu_caster, "LOT", lot)
        caster = gpu_caster.GpuCaster(software_gpu, 1)
        for _ in range(2):
            hits = caster.cast(
                frame.scene, origins, rays, low=1e-3, high=100.0, skip_row=2, weights=weights
            )
            found.append([hits.t, hits.row, hits.triangle, hits.weights])
    assert len(set(found[0][1].tolist())) > 2
    assert (found[0][1] != 2).all()
    for other in found[1:]:
        assert all(a.tobytes() == b.tobytes() for a, b in zip(found[0], other, strict=True))


def test_one_origin_is_the_same_as_one_for_each(software_gpu):
    frame = random_frame(3, triangles=300, instances=4)
    rays = np.random.default_rng(8).normal(size=(_RAYS, 3)).astype(np.float32)
    caster = gpu_caster.GpuCaster(software_gpu, 1)
    here = np.array([0.5, -1.0, 0.25])
    shared = caster.cast(frame.scene, here, rays, low=1e-3, high=100.0)
    each = caster.cast(frame.scene, np.tile(here, (_RAYS, 1)), rays, low=1e-3, high=100.0)
    assert shared.t.tobytes() == each.t.tobytes()
    assert shared.triangle.tobytes() == each.triangle.tobytes()
