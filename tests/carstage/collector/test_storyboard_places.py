"""Where positions of a storyboard are on maps with hills and bridges."""

from __future__ import annotations

import math

import carla
import pytest

from carstage.collector.scenario.storyboard.places import Places
from carstage.spec.fields import Fields
from carstage.spec.plain import plain
from carstage.spec.storyboard import WorldPlace, _read_place
from carstage_sim.maps import MapCatalogue


def _map(name):
    town = MapCatalogue().load(name)
    return carla.Map(name, town.opendrive)


def _places(world_map):
    return Places(world_map, lambda name: pytest.fail(f"nobody asked for {name}"))


def test_without_a_height_a_place_is_on_the_lane_wherever_that_is():
    hills = _map("Stage02")
    lanes = [lane.transform.location for lane in hills.generate_waypoints(25.0)]
    high = [at for at in lanes if at.z > 3.0]
    assert len(high) > 20
    places = _places(hills)
    for at in high:
        found = places.transform(WorldPlace(at.x, at.y)).location
        assert math.dist((found.x, found.y), (at.x, at.y)) < 1e-3
        # Junctions have lanes that cross a little above each other.
        assert found.z == pytest.approx(at.z, abs=0.3)


def test_a_height_chooses_among_lanes_above_each_other():
    bridges = _map("Stage03")
    lanes = [lane.transform.location for lane in bridges.generate_waypoints(4.0)]
    above = [at for at in lanes if at.z > 5.5]
    crossing = [
        (over, under)
        for over in above
        for under in lanes
        if math.dist((over.x, over.y), (under.x, under.y)) < 1.0 and under.z < 1.0
    ]
    assert crossing
    over, under = crossing[0]
    places = _places(bridges)
    assert places.transform(WorldPlace(over.x, over.y, over.z)).location.z > 5.0
    assert places.transform(WorldPlace(over.x, over.y, under.z)).location.z < 1.0
    assert places.transform(WorldPlace(over.x, over.y)).location.z < 1.0


def test_beside_all_lanes_the_places_own_height_counts():
    places = _places(_map("Stage01"))
    assert places.transform(WorldPlace(5e3, 5e3, 7.5)).location.z == 7.5
    assert places.transform(WorldPlace(5e3, 5e3)).location.z == 0.0


@pytest.mark.parametrize("z_m", [None, 0.0, 4.5])
def test_a_place_comes_back_from_its_plain_form(z_m):
    place = WorldPlace(1.0, -2.0, z_m, 30.0)
    form = plain(place)
    assert ("z_m" in form) == (z_m is not None)
    assert _read_place(Fields(form, "place")) == place
