"""Stage03: a motorway ring with two diamond interchanges around a small town."""

from __future__ import annotations

import math

from carstage_sim.maps.writer.plan import (
    Control,
    Crossing,
    Interchange,
    Motorway,
    Street,
    StreetProfile,
    TownPlan,
    grid_streets,
)

_SIZE_M = (1200.0, 900.0)
_CORNER_M = 200.0
_BRIDGE_M = 6.2
"""Height of the streets over the motorway."""
_TERMINAL_M = 75.0
_RAMP_CORNER_M = 14.0
_SOUTH_M = (_SIZE_M[0] - 2 * _CORNER_M) / 2
_HALF_RING_M = _SIZE_M[0] + _SIZE_M[1] - 4 * _CORNER_M + math.pi * _CORNER_M

_WIDE = StreetProfile(lanes=2, speed_limit_kmh=50)
_NARROW = StreetProfile(lanes=1, speed_limit_kmh=30)
_ROWS = (-115.0, 0.0, 120.0)
_ARTERIAL = StreetProfile(
    lanes=2, speed_limit_kmh=60, gutter_width_m=1.0, sidewalk_width_m=0.0, kind="rural"
)
_BRIDGE = StreetProfile(
    lanes=1, speed_limit_kmh=60, gutter_width_m=1.0, sidewalk_width_m=0.0, kind="rural"
)


def _way_out(side: int) -> tuple[Street, Street]:
    """From the town to the near ramps, and over the motorway to the far ones."""
    middle_m = side * _SIZE_M[1] / 2
    near, far = (0.0, middle_m - side * _TERMINAL_M), (0.0, middle_m + side * _TERMINAL_M)
    edge = (0.0, _ROWS[-1] if side > 0 else _ROWS[0])
    return Street((edge, near), _ARTERIAL), Street((near, far), _BRIDGE)


def _ramp_crossings(side: int) -> tuple[Crossing, Crossing]:
    middle_m = side * _SIZE_M[1] / 2
    near, far = (0.0, middle_m - side * _TERMINAL_M), (0.0, middle_m + side * _TERMINAL_M)
    return (
        Crossing(near, Control.SIGNALS, _BRIDGE_M, _RAMP_CORNER_M),
        Crossing(far, Control.YIELD, _BRIDGE_M, _RAMP_CORNER_M),
    )


STAGE03 = TownPlan(
    "Stage03",
    latitude_deg=50.1,
    longitude_deg=8.6,
    turn_limit_kmh=20,
    streets=(
        *grid_streets(
            columns=(-230.0, -110.0, 0.0, 105.0, 225.0),
            rows=_ROWS,
            narrow=_NARROW,
            wide=_WIDE,
            wide_columns=frozenset({2}),
            wide_rows=frozenset({1}),
        ),
        *_way_out(-1),
        *_way_out(1),
    ),
    crossings=(*_ramp_crossings(-1), *_ramp_crossings(1)),
    motorways=(
        Motorway(
            _SIZE_M,
            _CORNER_M,
            (
                Interchange(_SOUTH_M, terminal_m=_TERMINAL_M),
                Interchange(_SOUTH_M + _HALF_RING_M, terminal_m=_TERMINAL_M),
            ),
        ),
    ),
)
