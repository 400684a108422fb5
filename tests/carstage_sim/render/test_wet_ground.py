"""Wet ground: a film between stones that stand out of it, puddles that are level, ragged rims."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, build_mesh
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.detail import ASPHALT, noise, stones
from carstage_sim.render.film import Film
from carstage_sim.render.picture import PictureMaker
from carstage_sim.render.surface import water
from carstage_sim.sensors.view import Camera, View
from carstage_sim.world.state import Weather
from ray_scenes import frame_of

pytestmark = pytest.mark.xdist_group("kernels")

PLACES = np.random.default_rng(3).uniform(0.0, 60.0, (20_000, 2)).astype(np.float32)


class Wet(NamedTuple):
    """What :func:`water` reads of the light."""

    wetness: np.float32
    puddles: np.float32


@kernel
def _look(places, wet, height, out):
    for i in range(len(places)):
        out[i] = water(wet, ASPHALT, height[i], places[i, 0], places[i, 1], np.float32(0.01))


@kernel
def _heights(places, step, out):
    for i in range(len(places)):
        x, y = places[i, 0], places[i, 1]
        out[i, 0], out[i, 1], out[i, 2] = stones(x, y, 31)
        out[i, 3] = noise(x, y, 31)
        out[i, 4] = (noise(x + step, y, 31) - noise(x - step, y, 31)) / (step + step)
        out[i, 5] = (noise(x, y + step, 31) - noise(x, y - step, 31)) / (step + step)


def heights():
    """``(N, 6)``: stones' height and rises, noise there, and its differences along x and y."""
    out = np.empty((len(PLACES), 6), np.float32)
    _heights(PLACES, np.float32(0.01), out)
    return out


def share(height, *, wetness, puddles=0.0):
    """Share of water at each place, whose stones have such heights."""
    out = np.empty(len(PLACES), np.float32)
    wet = Wet(np.float32(wetness), np.float32(puddles))
    _look(PLACES, wet, np.broadcast_to(np.float32(height), len(PLACES)).astype(np.float32), out)
    return out


def test_stones_rise_as_their_heights_say():
    found = heights()
    assert found[:, 0] == pytest.approx(found[:, 3], abs=1e-6)
    # Differences over a lattice's line are those of two bumps.
    inside = (np.abs(PLACES - np.round(PLACES)) > 0.02).all(axis=1)
    assert found[inside, 1] == pytest.approx(found[inside, 4], abs=0.02)
    assert found[inside, 2] == pytest.approx(found[inside, 5], abs=0.02)


def test_a_film_lies_between_stones_and_leaves_their_tops():
    found = share(heights()[:, 0], wetness=1.0)
    assert found.mean() == pytest.approx(0.35, abs=0.03)
    assert share(0.6, wetness=1.0).max() < 0.1 < 0.6 < share(-0.6, wetness=1.0).min()
    assert share(heights()[:, 0], wetness=0.5) == pytest.approx(0.5 * found, abs=1e-6)


def test_a_puddle_ends_between_stones():
    low, high = (share(height, wetness=0.3, puddles=0.5) for height in (-0.6, 0.6))
    stands, stood_out = (low > 0.9).mean(), (high > 0.9).mean()
    assert 0.5 * stands < stood_out < 0.95 * stands


def moonlit(**weather):
    """``(H, W)`` brightness of an empty road by moonlight, nothing but sky around it."""
    x = np.array([-50.0, 300.0])
    corners = np.array([[x[k & 1], (-60.0, 60.0)[k >> 1], 0.0] for k in range(4)])
    road = build_mesh(
        corners, np.array([[0, 1, 3], [0, 3, 2]]), Material.ASPHALT, CityObjectLabel.ROADS
    )
    frame = frame_of(road)
    caster = RayCaster(1)
    night = Weather(sun_altitude_angle=-90.0, cloudiness=5.0, **weather)
    view = View(lambda: frame, caster, PictureMaker(caster), night, 0.0)
    codes = view.colours(Camera(640, 352, 90.0, (0.0, 0.0, 2.3), (-4.0, 0.0, 0.0), 0), Film())
    caster.close()
    return codes.astype(np.float64) @ np.array([0.299, 0.587, 0.114])


def test_a_wet_road_by_moonlight_is_not_flat_near_the_camera():
    seen = moonlit(wetness=60.0)[256:]
    assert seen.mean() < 40.0, "dark as a road without lamps is"
    patches = seen.reshape(3, 32, 20, 32).std(axis=(1, 3))
    assert (patches < 1.0).mean() < 0.05
