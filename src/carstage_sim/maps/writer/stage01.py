"""Stage01: several signalised blocks on a plain."""

from __future__ import annotations

from carstage_sim.maps.writer.plan import StreetProfile, TownPlan, grid_streets

STAGE01 = TownPlan(
    "Stage01",
    latitude_deg=49.0,
    longitude_deg=8.4,
    streets=grid_streets(
        columns=(-190.0, -65.0, 55.0, 190.0),
        rows=(-112.0, 0.0, 118.0),
        narrow=StreetProfile(lanes=1, speed_limit_kmh=30),
        wide=StreetProfile(lanes=2, speed_limit_kmh=40),
        wide_columns=frozenset({1}),
        wide_rows=frozenset({1}),
    ),
)
