"""Which of CARLA's labels each kind of level object has; a plan is read without the client."""

from __future__ import annotations

LEVEL_LABELS = {
    "parked_vehicles": ("Car", "Truck", "Bus", "Motorcycle", "Bicycle", "Vehicles"),
    "traffic_lights": ("TrafficLight",),
    "traffic_signs": ("TrafficSigns",),
    "bridges": ("Bridge",),
    "buildings": ("Buildings",),
    "dynamic": ("Dynamic",),
    "fences": ("Fences",),
    "guard_rails": ("GuardRail",),
    "other": ("Other",),
    "poles": ("Poles",),
    "rail_tracks": ("RailTrack",),
    "static": ("Static",),
    "terrain": ("Terrain",),
    "trains": ("Train",),
    "vegetation": ("Vegetation",),
    "walls": ("Walls",),
    "water": ("Water",),
}
"""Names of ``carla.CityObjectLabel`` by those of ``labels.level_objects``.

Up to 0.9.13 there is one label for all vehicles.
"""
LEVEL_OBJECTS = tuple(sorted(LEVEL_LABELS))
"""Kinds of level objects that a plan may ask for."""
