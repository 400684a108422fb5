"""The walkers check fails on what it is there to notice."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import carla
import pytest
from shapely.geometry import Point

from carstage_sim.check.walkers import OVERHANG_M, WalkerFigures, judge, walls

GOOD = WalkerFigures(walkers=10, samples=800, walked=9, alive=10)


def test_walkers_who_keep_to_the_walkable_surface_pass() -> None:
    assert judge("Stage01", GOOD).ok


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("alive", 9),
        ("outside", 1),
        ("farthest_outside_m", 0.6),
        ("in_walls", 1),
        ("walked", 7),
    ],
)
def test_each_fault_fails(name: str, value: float) -> None:
    assert not judge("Stage01", replace(GOOD, **{name: value})).ok


def test_walls_are_the_turned_outlines_of_buildings_and_walls() -> None:
    house = carla.BoundingBox(carla.Location(10.0, 0.0, 3.0), carla.Vector3D(4.0, 2.0, 3.0))
    house.rotation = carla.Rotation(yaw=90.0)
    boxes = {carla.CityObjectLabel.Buildings: [house], carla.CityObjectLabel.Walls: []}
    solid = walls(SimpleNamespace(get_level_bbs=boxes.get))
    assert solid.contains(Point(10.0, 3.9 - OVERHANG_M))
    assert not solid.contains(Point(10.0, 3.9))  # below an awning
    assert not solid.contains(Point(13.0, 0.0))
    assert walls(SimpleNamespace(get_level_bbs=lambda _label: [])).is_empty
