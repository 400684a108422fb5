"""Lens and exposure attributes of cameras."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.lens import PINHOLE, Lens
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

_BARREL = {"lens_circle_multiplier": "3.0", "lens_circle_falloff": "3.0"}


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    cache = tmp_path_factory.mktemp("cache")
    with WorldSensors(town(GROUND, WALL), threads=1, cache=cache) as made:
        yield made


def picture(sensors, kind="rgb", **attributes):
    sensors.reset()
    ((_, frame),) = sensors.capture(state(1), [request(f"camera.{kind}", **attributes)])
    return frame.pixels.astype(int)


def test_carlas_defaults_distort_nothing():
    assert Lens.of({}) == PINHOLE
    assert not PINHOLE.distorts
    assert Lens.of({"lens_k": "3", "lens_kcube": "1"}) == PINHOLE


def test_a_barrel_shows_more_at_the_edge_and_leaves_the_middle():
    lens = Lens.of(_BARREL)
    x, y = lens.undistorted(np.array([0.0, 1.0]), np.array([0.0, 0.0]))
    assert x[0] == y[0] == y[1] == 0.0
    assert x[1] > 1.05
    assert Lens.of(_BARREL | {"lens_k": "1"}).undistorted(*np.ones((2, 1)))[0] < 1.0


@pytest.mark.parametrize("name", ["lens_k", "lens_kcube", "lens_circle_falloff", "lens_x_size"])
def test_each_lens_attribute_counts(name):
    plain = Lens.of(_BARREL | {"lens_kcube": "-0.5"})
    other = Lens.of(_BARREL | {"lens_kcube": "-0.5"} | {name: "0.3"})
    place = np.array([0.8]), np.array([0.4])
    assert not np.allclose(plain.undistorted(*place), other.undistorted(*place))


def test_distorting_undoes_undistorting():
    lens = Lens.of(_BARREL)
    x, y = np.meshgrid(np.linspace(-0.95, 0.95, 9), np.linspace(-0.95, 0.95, 7))
    again = lens.distorted(*lens.undistorted(x, y))
    assert np.abs(np.array(again) - np.array([x, y])).max() < 1e-4


def test_all_cameras_look_through_the_lens(sensors):
    tilted = {"rotation_deg": (-8.0, 50.0, 25.0)}
    for kind in ("rgb", "depth", "semantic_segmentation", "normals"):
        plain = picture(sensors, kind, **tilted)
        assert (plain != picture(sensors, kind, **tilted, **_BARREL)).any()


def test_an_impossible_lens_is_refused_by_the_attributes_name(sensors):
    with pytest.raises(SensorAttributeError, match="lens_circle_multiplier"):
        picture(sensors, lens_circle_multiplier=-1)


def test_exposure_compensation_brightens_and_darkens(sensors):
    dark, plain, bright = (
        picture(sensors, exposure_compensation=ev).mean() for ev in (-2.0, 0.0, 2.0)
    )
    assert dark < plain - 20 < plain + 20 < bright


def test_a_higher_gamma_lifts_the_middle_tones(sensors):
    assert picture(sensors, gamma=2.8).mean() > picture(sensors, gamma=2.2).mean() + 5
    assert np.array_equal(picture(sensors, gamma=2.2), picture(sensors))


def test_manual_exposure_follows_shutter_aperture_and_iso(sensors):
    manual = {"exposure_mode": "manual"}
    usual = picture(sensors, **manual).mean()
    assert picture(sensors, **manual, iso=400).mean() > usual + 10
    assert picture(sensors, **manual, shutter_speed=1000).mean() < usual - 10
    assert picture(sensors, **manual, fstop=4.0).mean() < usual - 10
    assert np.array_equal(
        picture(sensors, **manual, iso=400, shutter_speed=800), picture(sensors, **manual)
    )


@pytest.mark.parametrize("name", ["shutter_speed", "iso", "fstop", "gamma"])
def test_exposure_values_must_be_positive(sensors, name):
    with pytest.raises(SensorAttributeError, match=name):
        picture(sensors, **{name: 0})
