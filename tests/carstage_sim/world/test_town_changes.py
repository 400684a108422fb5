"""Street lights and level objects as clients and the sun switch them."""

from __future__ import annotations

import numpy as np

from carstage_sim.maps.street_lamps import StreetLamps
from carstage_sim.maps.town import LevelObject, MapLayer, OrientedBox
from carstage_sim.world.street_lights import LightState, StreetLights
from carstage_sim.world.town_objects import TownObjects

_BOX = OrientedBox((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))


def lights(count: int = 2) -> StreetLights:
    return StreetLights(StreetLamps(np.zeros((count, 3)), np.arange(1, count + 1, dtype=np.uint32)))


def objects() -> TownObjects:
    return TownObjects(
        [
            LevelObject(1, "House", 3, _BOX, MapLayer.BUILDINGS),
            LevelObject(2, "Tree", 9, _BOX, MapLayer.FOLIAGE),
            LevelObject(3, "Pole", 6, _BOX),
        ]
    )


def on(street: StreetLights) -> list[bool]:
    return [state.active for state in street.states()]


def test_dusk_and_dawn_switch_the_lights() -> None:
    street = lights()
    assert not street.follow_sun(45.0)
    assert street.follow_sun(-10.0)
    assert on(street) == [True, True]
    assert street.follow_sun(20.0)
    assert on(street) == [False, False]


def test_between_dusk_and_dawn_a_switched_light_stays_as_it_is() -> None:
    street = lights()
    street.follow_sun(-10.0)
    street.apply(
        [LightState(1, 5000.0, 2, (255, 0, 0), False), LightState(99, 1.0, 2, (0,) * 3, True)]
    )
    assert not street.follow_sun(-30.0)
    assert on(street) == [False, True]


def test_without_the_cycle_the_sun_switches_nothing_and_with_it_at_once() -> None:
    street = lights()
    street.set_day_night_cycle(False)
    assert not street.follow_sun(-10.0)
    assert on(street) == [False, False]
    assert street.set_day_night_cycle(True)
    assert on(street) == [True, True]


def test_power_is_colour_times_intensity_and_none_when_off() -> None:
    street = lights()
    street.apply([LightState(1, 20_000.0, 2, (255, 0, 0), True)])
    assert np.allclose(street.power(), [[2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def test_a_change_is_told_in_the_next_frame_only() -> None:
    street = lights()
    street.apply([LightState(1, 1.0, 2, (1, 2, 3), True)])
    told = []
    for _ in range(2):
        street.step()
        told.append(street.changed_since_frame)
    assert told == [True, False]


def test_an_object_is_hidden_by_its_own_switch_or_by_its_layer() -> None:
    town = objects()
    town.enable([3, 99], False)
    town.load_layers(MapLayer.FOLIAGE, False)
    assert town.hidden() == {2, 3}
    town.load_layers(MapLayer.ALL, True)
    assert town.hidden() == {3}
    town.enable([3], True)
    assert town.hidden() == frozenset()


def test_objects_without_a_layer_stay_when_all_layers_go() -> None:
    town = objects()
    town.load_layers(MapLayer.ALL, False)
    assert town.hidden() == {1, 2}
