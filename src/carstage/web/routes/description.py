"""What the embedded simulator offers: maps, vehicles, weathers, sensors."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from carstage.web.messages import DescriptionMessage, TownMap, TownMapRequest
from carstage.web.messages.base import Name
from carstage.web.routes.access import BUSY, Access

router = APIRouter(prefix="/api", tags=["description"])


@router.get("/description", responses=BUSY)
def description(services: Access) -> DescriptionMessage:
    """Maps, vehicles, pedestrians, weathers and sensor attributes; kept after the first time."""
    return services.description.message()


@router.get("/vehicles/{blueprint}", responses=BUSY)
def vehicle(blueprint: Name, services: Access) -> dict[str, Any]:
    """Shape of a vehicle, as ``carstage sim --vehicle`` prints it: box, wheels, outlines, parts."""
    return services.description.vehicle(blueprint)


@router.post("/map", responses=BUSY)
def town_map(request: TownMapRequest, services: Access) -> TownMap:
    """Lanes and spawn points of a map; of a server that runs, what it tells. Nothing is started."""
    return services.town_maps.look(request)
