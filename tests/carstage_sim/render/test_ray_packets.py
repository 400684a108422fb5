"""Rays that are traced together meet what each meets alone, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.caster import RayCaster, picture_packets
from carstage_sim.render.scene import Placement
from carstage_sim.sensors.lens import PINHOLE, Lens
from carstage_sim.sensors.view import Camera, camera_slopes, pixel_rays
from ray_scenes import frame_of, soup, sphere, turned_box

pytestmark = pytest.mark.xdist_group("kernels")


def crowd(seed, *, triangles=600, instances=12):
    """Triangles of all sizes, some edge on and some behind each other, among turned bodies."""
    rng = np.random.default_rng(seed)
    size = rng.choice([0.05, 0.5, 6.0], (triangles, 1, 1))
    corners = rng.uniform(-20, 20, (triangles, 1, 3)) + rng.normal(size=(triangles, 3, 3)) * size
    corners[::7, :, 2] = np.round(corners[::7, :1, 2])
    corners[1::7] = corners[::7][: len(corners[1::7])]
    placements = [
        Placement(
            k + 1,
            "ball" if k % 2 else "box",
            rng.uniform(-12, 12, 3),
            rotation_matrix(rng.uniform(-180, 180, 3)),
        )
        for k in range(instances)
    ]
    models = {"ball": sphere(2), "box": turned_box((3.0, 1.0, 2.0))}
    return frame_of(soup(corners, leafy=bool(seed % 2)), placements, models), rng


def both(frame, camera, *, low=0.1, high=1000.0, skip_row=-1, threads=1):
    rays = pixel_rays(camera)
    caster = RayCaster(threads)
    place = np.asarray(camera.location)
    span = {"low": low, "high": high, "skip_row": skip_row}
    alone = caster.cast(frame.scene, place, rays, **span)
    packets = picture_packets(camera.width, camera.height)
    together = caster.cast_together(frame.scene, place, rays, packets, **span)
    slopes, unwritten = camera_slopes(camera), np.full_like(rays, np.nan)
    aimed = caster.cast_together(frame.scene, place, unwritten, packets, slopes=slopes, **span)
    caster.close()
    assert aimed.directions.tobytes() == rays.tobytes()
    assert_equal(aimed, together)
    return alone, together


def assert_equal(alone, together):
    for name in ("t", "row", "triangle", "weights"):
        assert getattr(alone, name).tobytes() == getattr(together, name).tobytes(), name


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 2**32 - 1), fov=st.sampled_from([0.5, 20.0, 90.0, 150.0, 178.0]))
def test_a_picture_is_that_of_single_rays(seed, fov):
    frame, rng = crowd(seed)
    turned = tuple(rng.choice([-90.0, -45.0, 0.0, 90.0, rng.uniform(-180, 180)], 3).tolist())
    camera = Camera(61, 43, fov, tuple(rng.uniform(-15, 15, 3).tolist()), turned, 0)
    assert_equal(*both(frame, camera, skip_row=int(rng.integers(-1, 3))))


def test_a_short_interval_and_a_bent_lens_too():
    frame, _ = crowd(4)
    bent = Lens(multiplier=3.0, falloff=3.0)
    assert bent.distorts
    for lens in (PINHOLE, bent):
        camera = Camera(70, 50, 110.0, (1.0, 2.0, 3.0), (-10.0, 47.0, 20.0), 0, lens)
        alone, together = both(frame, camera, low=2.0, high=9.0)
        assert_equal(alone, together)
        assert 0.05 < (alone.row != -2).mean() < 0.95


def test_two_threads_and_an_empty_world_change_nothing():
    frame, _ = crowd(5, triangles=2000)
    camera = Camera(200, 150, 90.0, (0.0, 0.0, 0.0), (0.0, 30.0, 0.0), 0)
    alone, together = both(frame, camera)
    _, again = both(frame, camera, threads=2)
    assert_equal(alone, together)
    assert_equal(alone, again)
    assert_equal(*both(frame_of(None), camera))
