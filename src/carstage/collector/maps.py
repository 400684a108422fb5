"""The map: its name on the server, its spawn points, its place on earth."""

from __future__ import annotations

import difflib
from typing import Any, Dict, List, Optional, Sequence

import carla

from carstage.collector.internals.errors import SceneError
from carstage.releases import GnssConvention


def find_map(client: Any, name: str) -> str:
    """The server's full name of a map: ``Stage01`` is ``/Game/Carla/Maps/Stage01``.

    Raises:
        SceneError: the server does not have it.
    """
    available = sorted(client.get_available_maps())
    for candidate in available:
        if candidate == name or candidate.rsplit("/", 1)[-1] == name:
            return str(candidate)
    short = [candidate.rsplit("/", 1)[-1] for candidate in available]
    near = difflib.get_close_matches(name, short, n=1)
    raise SceneError(
        "map: the server has no map %r." % name,
        "Did you mean %s?" % near[0] if near else "It has: %s." % ", ".join(short),
    )


def layers_of(names: Optional[Sequence[str]]) -> Any:
    """``carla.MapLayer`` of the layers to load; all for None. Only ``_Opt`` maps have layers.

    Raises:
        SceneError: this client does not know one of them.
    """
    if names is None:
        return carla.MapLayer.All
    bits = int(carla.MapLayer.NONE)
    for name in names:
        layer = carla.MapLayer.names.get(name)
        if layer is None:
            raise SceneError(
                "map.layers: this CARLA client does not know %r." % name,
                "It knows: %s." % ", ".join(sorted(carla.MapLayer.names)),
            )
        bits |= int(layer)
    return carla.MapLayer(bits)


def spawn_points(world_map: Any) -> List[Any]:
    """The map's spawn points for vehicles, in the server's order (``carla.Transform``)."""
    return list(world_map.get_spawn_points())


def geo_reference(world_map: Any, convention: GnssConvention) -> Dict[str, Any]:
    """Latitude and longitude (deg), altitude (m) of the map's origin, and how GNSS sensors count.

    Args:
        world_map: ``carla.Map``.
        convention: the server's.
    """
    origin = world_map.transform_to_geolocation(carla.Location(0.0, 0.0, 0.0))
    return {
        "latitude_deg": origin.latitude,
        "longitude_deg": origin.longitude,
        "altitude_m": origin.altitude,
        "projection": convention.projection,
        "gnss_north": convention.north,
    }
