"""What a card has made of one camera does not show in the pictures of the next."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import sensor_worlds
from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.film import Film
from carstage_sim.render.gpu import passes
from carstage_sim.render.gpu.camera import GpuCameras, Shot
from carstage_sim.render.gpu.caster import GpuCaster
from carstage_sim.render.gpu.passes import Product
from carstage_sim.render.motion import no_motion
from carstage_sim.render.sky import SkyModel
from carstage_sim.sensors.world_sensors import WorldSensors
from carstage_sim.world.state import Weather

pytestmark = pytest.mark.xdist_group("gpu")

WIDTH, HEIGHT = 128, 80


def slopes():
    across = (np.arange(WIDTH) + 0.5) * (2.0 / WIDTH) - 1.0
    upwards = (1.0 - (np.arange(HEIGHT) + 0.5) * (2.0 / HEIGHT)) * HEIGHT / WIDTH
    return np.stack([np.tile(across, HEIGHT), np.repeat(upwards, WIDTH)], axis=1)


LENS = slopes()


def shot(yaw_deg, lens=LENS):
    turned = rotation_matrix((-4.0, yaw_deg, 0.0))
    return Shot(WIDTH, HEIGHT, 90.0, lens, np.array([0.0, 0.0, 2.0]), turned, -1, 0.1, 1000.0)


@pytest.fixture(scope="module")
def taken(software_gpu):
    """Takes pictures of a street with a car and a pedestrian."""
    town = sensor_worlds.town(sensor_worlds.GROUND, sensor_worlds.WALL)
    state = sensor_worlds.state(
        1, vehicles=[(7, (8.0, 1.0, 0.0), 40.0)], walkers=[(8, (4.0, -1.2, 1.0), 90.0)]
    )
    cameras = GpuCameras(GpuCaster(software_gpu, 1))
    light = SkyModel().lighting(Weather(sun_altitude_angle=45.0), 0.0)
    with WorldSensors(town, threads=1) as sensors:
        frame = sensors.frame_of(state)
        still = no_motion(len(frame.actor_id))

        def take(shots, products, film=None):
            return cameras.take(frame, shots, products, light, film=film, motions=still)

        yield take


def test_cameras_of_one_lens_get_what_each_gets_alone(taken):
    wanted = [
        ([shot(0.0)], list(Product)),
        ([shot(72.0)], [Product.COLOURS]),
        ([shot(0.0)], [Product.COLOURS, Product.DEPTH], Film(gamma=1.4)),
        ([shot(-72.0)], [Product.TAGS]),
    ]
    alone = [taken(*one).pictures()[0] for one in wanted]
    under_way = [taken(*one) for one in wanted]
    together = [pending.pictures()[0] for pending in under_way]
    assert len(np.unique(alone[0][Product.COLOURS])) > 50
    assert not np.array_equal(alone[0][Product.COLOURS], alone[2][Product.COLOURS])
    for one, other in zip(alone, together, strict=True):
        assert one.keys() == other.keys()
        for product, picture in one.items():
            assert np.array_equal(picture, other[product]), product


@pytest.mark.parametrize("most_extra", [passes._MOST_EXTRA, 7 * WIDTH * 2 + 5])
def test_cameras_taken_together_get_what_each_gets_alone(taken, monkeypatch, most_extra):
    # With less room, extra rays go in bands of seven rows, some of which have rows of two cameras.
    monkeypatch.setattr(passes, "_MOST_EXTRA", most_extra)
    lens, products = slopes(), [Product.COLOURS, Product.INSTANCES, Product.DEPTH, Product.NORMALS]
    within = replace(shot(30.0, lens), location=np.array([8.0, 1.0, 0.7]), skip_row=0)
    shots = [shot(0.0, lens), within, shot(-100.0, lens)]
    together = taken(shots, products).pictures()
    alone = [taken([one], products).pictures()[0] for one in shots]
    assert len(together) == 3
    for one, other in zip(together, alone, strict=True):
        assert (
            list(one)
            == list(other)
            == [*products[2:3], *products[1:2], *products[3:], *products[:1]]
        )
        for product, picture in one.items():
            assert np.array_equal(picture, other[product]), product
    assert len({picture[Product.COLOURS].tobytes() for picture in together}) == 3


def test_cameras_that_have_no_pictures_in_common_are_refused(taken):
    with pytest.raises(ValueError, match="several lenses"):
        taken([shot(0.0), shot(0.0, slopes())], [Product.COLOURS])
    with pytest.raises(ValueError, match="2 cameras at once"):
        taken([shot(0.0), shot(72.0)], [Product.COLOURS, Product.FLOW])
    with pytest.raises(ValueError, match="9 cameras at once"):
        taken([shot(40.0 * k) for k in range(9)], [Product.COLOURS])


def test_a_picture_sampled_in_bands_is_the_same(taken, monkeypatch):
    whole = taken([shot(0.0)], [Product.COLOURS]).pictures()[0]
    # Room for the extra rays of seven rows: the last band has fewer.
    monkeypatch.setattr(passes, "_MOST_EXTRA", 7 * WIDTH * 2 + 5)
    banded = taken([shot(0.0, slopes())], [Product.COLOURS]).pictures()[0]
    assert np.array_equal(whole[Product.COLOURS], banded[Product.COLOURS])


def test_a_picture_of_too_many_bands_is_refused(taken, monkeypatch):
    monkeypatch.setattr(passes, "_MOST_EXTRA", 1)
    monkeypatch.setattr(passes, "_MOST_BANDS", 16)
    with pytest.raises(ValueError, match="128x80 pixels is too large"):
        taken([shot(0.0, slopes())], [Product.COLOURS])


def test_frames_that_are_under_way_at_once_are_those_made_one_after_the_other(
    software_gpu, monkeypatch
):
    place = sensor_worlds.town(sensor_worlds.GROUND, sensor_worlds.WALL)
    requests = [
        sensor_worlds.request("camera.rgb", 1),
        sensor_worlds.request("camera.rgb", 2, rotation_deg=(0.0, 20.0, 0.0), sensor_tick=0.2),
        sensor_worlds.request("camera.depth", 3),
        sensor_worlds.request("camera.optical_flow", 4),
        sensor_worlds.request("lidar.ray_cast", 5, points_per_second=20000, sensor_tick=0.2),
    ]
    ticks = [
        # Exposure follows the sun from tick to tick.
        sensor_worlds.state(
            tick,
            vehicles=[(7, (8.0 - tick, 1.0, 0.0), 40.0)],
            weather=Weather(sun_altitude_angle=20.0 * tick - 30.0),
        )
        for tick in range(1, 5)
    ]

    def made(sensors, *, at_once):
        frames, under_way = [], []

        def deliver(tick, sensor_id, frame):
            frames.append((tick, sensor_id, pickle.dumps(frame)))

        for tick in ticks:  # the first of which lets the sensors forget
            due = sensors.due(tick, requests)
            under_way.append(sensors.begin(tick, due, partial(deliver, tick.frame)).done)
            if not at_once:
                under_way[-1].result()
        for one in under_way:
            one.result()
        return sorted(frames)

    with WorldSensors(place, threads=3, gpu=software_gpu) as sensors:
        alone = made(sensors, at_once=False)
        assert len(alone) == 4 + 2 + 4 + 4 + 2
        assert made(sensors, at_once=True) == alone
        # Both colour cameras are made by the same passes where both are due.
        monkeypatch.setattr(passes, "MOST_CAMERAS", 1)
        assert made(sensors, at_once=True) == alone
