"""Vehicles beyond the spawn points start on lanes, clear of junctions and of each other."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace

import carla

from benchmarks.simulator.session import free_stretches


@dataclass
class Waypoint:
    """A place on a lane along x whose junction begins at 100 m."""

    x: float

    @property
    def transform(self) -> carla.Transform:
        return carla.Transform(carla.Location(self.x, 0.0, 2.0))

    @property
    def is_junction(self) -> bool:
        return self.x >= 100.0

    def next(self, distance_m: float) -> list[Waypoint]:
        return [Waypoint(self.x + distance_m)]


def street() -> SimpleNamespace:
    return SimpleNamespace(
        generate_waypoints=lambda step_m: [Waypoint(k * step_m) for k in range(20)]
    )


def places(count: int, taken: list[float]) -> list[float]:
    spots = [carla.Transform(carla.Location(x, 0.0, 2.5)) for x in taken]
    return [round(pose.location.x, 1) for pose in free_stretches(street(), spots, count)]


def test_stretches_keep_away_from_taken_places_and_from_each_other() -> None:
    found = places(5, taken=[10.0, 40.0])
    assert len(found) == 5
    everything = sorted([*found, 10.0, 40.0])
    gaps = [after - before for before, after in pairwise(everything)]
    assert min(gaps) >= 8.9


def test_no_stretch_lies_in_or_just_before_a_junction() -> None:
    assert max(places(100, taken=[])) < 92.0


def test_the_vehicle_is_let_down_onto_the_road() -> None:
    assert free_stretches(street(), [], 1)[0].location.z > 2.2
