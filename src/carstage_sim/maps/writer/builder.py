"""Collects the parts of a network and numbers them."""

from __future__ import annotations

import dataclasses
from collections import defaultdict

from carstage_sim.maps.writer.network import (
    Connection,
    Controller,
    Crosswalk,
    Junction,
    Road,
    RoadNetwork,
    Signal,
    SignalReference,
)

_FIRST_CONNECTING_ROAD_ID = 100
_FIRST_JUNCTION_ID = 1000
_FIRST_SIGN_ID = 20000


class NetworkBuilder:
    """Takes roads, junctions and what stands along the roads, in any order.

    Roads outside junctions count from 1, paths through junctions from 100, junctions from 1000 and
    signs from 20000; the lights of a junction have ten times its id and more.
    """

    def __init__(self) -> None:
        self.roads: dict[int, Road] = {}
        self._junctions: list[Junction] = []
        self._signals: dict[int, list[Signal]] = defaultdict(list)
        self._references: dict[int, list[SignalReference]] = defaultdict(list)
        self._crosswalks: dict[int, list[Crosswalk]] = defaultdict(list)
        self._last_road = 0
        self._last_path = _FIRST_CONNECTING_ROAD_ID - 1
        self._last_junction = _FIRST_JUNCTION_ID - 1
        self._last_sign = _FIRST_SIGN_ID - 1

    def next_road_id(self) -> int:
        """A number for a road outside junctions.

        Raises:
            ValueError: if the town has more than 99 of them.
        """
        self._last_road += 1
        if self._last_road >= _FIRST_CONNECTING_ROAD_ID:
            raise ValueError("a town has at most 99 roads outside its junctions")
        return self._last_road

    def next_path_id(self) -> int:
        """A number for a path through a junction."""
        self._last_path += 1
        return self._last_path

    def next_junction_id(self) -> int:
        """A number for a junction."""
        self._last_junction += 1
        return self._last_junction

    def next_sign_id(self) -> str:
        """A number for a sign."""
        self._last_sign += 1
        return str(self._last_sign)

    def add_road(self, road: Road) -> Road:
        """Takes a road or a path and gives it back."""
        self.roads[road.road_id] = road
        return road

    def add_junction(
        self, junction_id: int, paths: list[tuple[Road, Connection]], lights: list[Controller]
    ) -> None:
        """Takes a junction with its paths."""
        for road, _ in paths:
            self.add_road(road)
        ways = tuple(connection for _, connection in paths)
        self._junctions.append(Junction(junction_id, ways, tuple(lights)))

    def add_signal(self, road_id: int, signal: Signal) -> None:
        """Takes a light or sign that stands beside a road."""
        self._signals[road_id].append(signal)

    def add_reference(self, road_id: int, reference: SignalReference) -> None:
        """Takes the place on a road where a light takes effect."""
        self._references[road_id].append(reference)

    def add_crosswalk(self, road_id: int, crosswalk: Crosswalk) -> None:
        """Takes a crosswalk of a road."""
        self._crosswalks[road_id].append(crosswalk)

    def network(self, name: str, latitude_deg: float, longitude_deg: float) -> RoadNetwork:
        """All of it, roads by id."""
        roads = [
            dataclasses.replace(
                self.roads[number],
                signals=tuple(self._signals[number]),
                references=tuple(self._references[number]),
                crosswalks=tuple(self._crosswalks[number]),
            )
            for number in sorted(self.roads)
        ]
        junctions = sorted(self._junctions, key=lambda junction: junction.junction_id)
        return RoadNetwork(name, latitude_deg, longitude_deg, tuple(roads), tuple(junctions))
