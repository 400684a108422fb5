"""Maps: the OpenDRIVE town writer, the bake to arrays, meshes, navigation mesh, spawn points.

``MapCatalogue`` is the way in, ``load_town(name)`` for built-in towns; what comes out is a frozen
``Town``.
"""

from carstage_sim.maps.background import BackgroundBakes, Bake, BakeLimits
from carstage_sim.maps.baking import BakeOptions
from carstage_sim.maps.catalogue import MapCatalogue, MapFileError, generated_source
from carstage_sim.maps.checking import MapSamplingError
from carstage_sim.maps.ground import GroundHeight, ground_height
from carstage_sim.maps.loading import (
    UnknownTownError,
    available_towns,
    load_town,
    spawn_point_count,
)
from carstage_sim.maps.town import Town

__all__ = [
    "BackgroundBakes",
    "Bake",
    "BakeLimits",
    "BakeOptions",
    "GroundHeight",
    "MapCatalogue",
    "MapFileError",
    "MapSamplingError",
    "Town",
    "UnknownTownError",
    "available_towns",
    "generated_source",
    "ground_height",
    "load_town",
    "spawn_point_count",
]
