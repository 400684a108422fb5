"""Stage02: many blocks on hills, with curved streets, side streets that wait, and a roundabout.

Crossings are named like squares of a chess board: columns a to f from west to east, rows 1 to 6
from south to north.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from carstage_sim.maps.writer.alignment import Point
from carstage_sim.maps.writer.plan import (
    Control,
    Crossing,
    Hill,
    Roundabout,
    Street,
    StreetProfile,
    TownPlan,
)

_PLACES: dict[str, Point] = {
    "b1": (-185.0, -295.0), "c1": (-80.0, -285.0), "d1": (45.0, -290.0),
    "a2": (-300.0, -185.0), "b2": (-190.0, -180.0), "c2": (-78.0, -170.0),
    "d2": (40.0, -180.0), "f2": (285.0, -165.0),
    "a3": (-295.0, -65.0), "b3": (-185.0, -60.0), "c3": (-75.0, -55.0),
    "d3": (45.0, -60.0), "e3": (165.0, -50.0), "f3": (290.0, -60.0),
    "a4": (-300.0, 55.0), "b4": (-190.0, 65.0), "c4": (-72.0, 60.0),
    "d4": (50.0, 55.0), "e4": (160.0, 70.0), "f4": (295.0, 60.0),
    "a5": (-290.0, 180.0), "c5": (-70.0, 180.0), "d5": (45.0, 175.0),
    "e5": (165.0, 185.0), "f5": (290.0, 180.0),
    "c6": (-72.0, 295.0), "d6": (45.0, 285.0), "e6": (160.0, 295.0),
}  # fmt: skip

_LANE = StreetProfile(lanes=1, speed_limit_kmh=30, sidewalk_width_m=4.5, parking_width_m=2.2)
_STREET = StreetProfile(lanes=1, speed_limit_kmh=50)
_AVENUE = StreetProfile(lanes=2, speed_limit_kmh=40, sidewalk_width_m=4.5, parking_width_m=2.2)
_RING = StreetProfile(lanes=1, speed_limit_kmh=60, biking_width_m=1.6)


def _chain(profile: StreetProfile, names: str) -> list[Street]:
    """Straight streets from each named crossing to the next."""
    places = [_PLACES[name] for name in names.split()]
    return [Street(pair, profile) for pair in pairwise(places)]


def _curve(
    profile: StreetProfile, first: str, inner: Iterable[Point], last: str, radius_m: float
) -> Street:
    return Street((_PLACES[first], *inner, _PLACES[last]), profile, radius_m)


_STREETS = (
    # The ring, in the corners around the hills.
    *_chain(_RING, "b1 c1 d1"),
    _curve(_RING, "d1", [(130.0, -292.0), (290.0, -270.0)], "f2", 70.0),
    *_chain(_RING, "f2 f3 f4 f5"),
    _curve(_RING, "f5", [(292.0, 292.0)], "e6", 70.0),
    *_chain(_RING, "e6 d6 c6"),
    _curve(_RING, "c6", [(-180.0, 298.0), (-285.0, 285.0)], "a5", 70.0),
    *_chain(_RING, "a5 a4 a3 a2"),
    _curve(_RING, "a2", [(-302.0, -298.0)], "b1", 70.0),
    # Two avenues.
    *_chain(_AVENUE, "a3 b3 c3 d3"),
    _curve(_AVENUE, "d3", [(105.0, -72.0)], "e3", 90.0),
    *_chain(_AVENUE, "e3 f3"),
    *_chain(_AVENUE, "c1 c2 c3 c4 c5 c6"),
    # Streets between them.
    *_chain(_STREET, "a2 b2"),
    _curve(_STREET, "b2", [(-135.0, -192.0)], "c2", 80.0),
    *_chain(_STREET, "c2 d2"),
    _curve(_STREET, "d2", [(120.0, -195.0), (205.0, -145.0)], "f2", 90.0),
    *_chain(_STREET, "d1 d2 d3 d4"),
    *_chain(_STREET, "c5 d5 e5 f5"),
    *_chain(_STREET, "e6 e5 e4 e3"),
    # Quiet lanes.
    *_chain(_LANE, "b1 b2 b3 b4 c4"),
    *_chain(_LANE, "a4 b4"),
    _curve(_LANE, "a5", [(-200.0, 208.0), (-145.0, 168.0)], "c5", 60.0),
    _curve(_LANE, "c4", [(-12.0, 78.0)], "d4", 60.0),
    *_chain(_LANE, "d4 e4 f4"),
    *_chain(_LANE, "d5 d6"),
)

_CONTROL = {
    # On the ring, and where much traffic turns, the Traffic Manager's vehicles wait for each other.
    Control.STOP: "b2 d2 b4",
    Control.YIELD: "d4 e4",
}

STAGE02 = TownPlan(
    "Stage02",
    latitude_deg=48.8,
    longitude_deg=9.2,
    turn_limit_kmh=20,
    streets=_STREETS,
    crossings=tuple(
        Crossing(_PLACES[name], control)
        for control, names in _CONTROL.items()
        for name in names.split()
    ),
    roundabouts=(Roundabout(_PLACES["e5"]),),
    hills=(
        Hill((-255.0, 225.0), 10.5, 235.0),
        Hill((205.0, -225.0), 8.0, 195.0),
        Hill((85.0, 30.0), -2.0, 160.0),
    ),
)
