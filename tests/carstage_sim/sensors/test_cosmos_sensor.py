"""The control picture of 0.9.16: boxes as lines on black."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import LevelObject, OrientedBox, Town, TrafficLightSite
from carstage_sim.sensors.cosmos import CosmosCamera
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.world.town_changes import TownChanges
from sensor_worlds import GROUND, request, state, town

RED, SIGN, LIGHT, POLE = (255, 0, 0), (131, 175, 155), (252, 157, 155), (66, 40, 144)


def picture(place: Town, world, frame_request: SensorRequest) -> np.ndarray:
    """``(H, W, 3)`` RGB; no ray is cast, so there is no view."""
    return CosmosCamera(frame_request, place).measure(world, frame_request, None).pixels[..., 2::-1]


def test_vehicles_are_red_boxes_on_black() -> None:
    place = town(GROUND)
    world = state(1, vehicles=[(7, (12.0, 0.0, 0.0), 0.0)])
    drawn = picture(place, world, request("camera.cosmos_visualization"))
    rows, columns = np.nonzero(drawn[..., 0] > 100)
    # 12 m ahead, less half a length, a car of 2.2 m is 32 px / 9.6 m wide in a picture of 64 px.
    assert 5 < columns.max() - columns.min() < 14
    assert rows.min() >= 24  # below the camera's height
    assert drawn[..., 1].max() == 0
    assert (drawn == 0).mean() > 0.9
    alone = picture(place, state(1), request("camera.cosmos_visualization"))
    assert alone.max() == 0


def test_signs_are_boxes_and_only_upright_poles_are_lines() -> None:
    level = [
        LevelObject(1, "sign", CityObjectLabel.TRAFFIC_SIGNS,
                    OrientedBox((8.0, 0.0, 2.0), (0.05, 0.4, 0.4), (0.0, 0.0, 0.0))),
        LevelObject(2, "arm", CityObjectLabel.POLES,
                    OrientedBox((8.0, 3.0, 4.0), (0.1, 2.0, 0.1), (0.0, 0.0, 0.0))),
    ]  # fmt: skip
    place = replace(town(GROUND), level_objects=tuple(level))
    drawn = picture(place, state(1), request("camera.cosmos_visualization"))
    brightest = drawn.reshape(-1, 3)[drawn.reshape(-1, 3).sum(axis=1).argmax()]
    assert np.abs(brightest.astype(int) - SIGN).max() < 60
    assert not (drawn[..., 2] > 1.5 * drawn[..., 1]).any()  # nothing in the poles' violet


def colours_in(drawn: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(pixel) for pixel in drawn.reshape(-1, 3).tolist()}


def test_traffic_lights_are_boxes_of_their_heads_on_upright_masts() -> None:
    site = TrafficLightSite(
        "7", (8.0, 3.0, 0.0), (0.0, 90.0, 0.0), (-4.0, 0.0, 5.5, 90.0), 1, 0, ()
    )
    place = replace(town(GROUND), traffic_lights=(site,))
    asked = request("camera.cosmos_visualization", image_size_x=320, image_size_y=240)
    drawn = picture(place, state(1), asked)
    assert {LIGHT, POLE} <= colours_in(drawn)
    ahead, high = np.nonzero((drawn == LIGHT).all(axis=2))[::-1]
    mast = np.nonzero((drawn == POLE).all(axis=2))[1]
    # 8 m ahead a metre is 20 px wide: the arm's head is 4 m to the left of the mast.
    assert 60 < mast.mean() - ahead.min() < 110
    assert np.ptp(mast) < 6
    assert high.min() < 60 < high.max()


def test_what_clients_hid_is_not_drawn() -> None:
    post = OrientedBox((8.0, 0.0, 2.0), (0.1, 0.1, 2.0), (0.0, 0.0, 0.0))
    pole = LevelObject(5, "pole", CityObjectLabel.POLES, post)
    place = replace(town(GROUND), level_objects=(pole,))
    asked = request("camera.cosmos_visualization")
    assert picture(place, state(1), asked).any()
    hidden = replace(state(1), town_changes=TownChanges(hidden=frozenset({5})))
    assert not picture(place, hidden, asked).any()


def test_ignored_vehicles_are_not_drawn_but_walkers_are() -> None:
    world = state(1, vehicles=[(7, (12.0, -3.0, 0.0), 0.0)], walkers=[(8, (8.0, 3.0, 1.0), 0.0)])
    asked = request("camera.cosmos_visualization")
    all_seen = picture(town(GROUND), world, asked)
    assert all_seen[..., 0].any()
    ignoring = picture(town(GROUND), world, replace(asked, ignored=frozenset({7, 8})))
    assert not ignoring[..., 0].any()
    assert np.array_equal(ignoring[..., 1], all_seen[..., 1])
    assert ignoring.any()


def test_the_hero_is_not_drawn() -> None:
    world = state(1, vehicles=[(7, (12.0, 0.0, 0.0), 0.0)])
    asked = request("camera.cosmos_visualization")
    assert picture(town(GROUND), world, asked).any()
    assert not picture(town(GROUND), replace(world, hero_id=7), asked).any()
