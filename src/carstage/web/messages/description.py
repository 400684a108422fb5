"""What the embedded simulator offers."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from carstage.web.messages.base import Document, Message


class MapEntry(Message):
    """A map and how many spawn points it has."""

    name: str
    spawn_points: int


class VehicleEntry(Message):
    """A vehicle blueprint; its shape is at ``/api/vehicles/{id}``."""

    id: str
    base_type: str
    generation: str
    wheels: int
    colors: list[str]


class DescriptionMessage(Message):
    """What a server offers, known without starting it.

    Attributes:
        sensors: blueprint attributes with CARLA's defaults, by kind.
    """

    protocol: str
    maps: list[MapEntry]
    vehicles: list[VehicleEntry]
    walkers: list[str]
    weathers: list[str]
    sensors: dict[str, dict[str, str]]


class TownMapRequest(Message):
    """Which map on which server: the section ``server`` of a configuration."""

    server: Document
    map: Annotated[str, StringConstraints(min_length=1, max_length=300)]


class TownMap(Message):
    """A map from above, as far as it is known.

    Attributes:
        lanes: polylines of lane centres in the direction of travel, x, y in world metres.
        lane_heights_m: z of each point of each lane.
        spawn_points: x, y, z (m) and yaw (deg), in the order of their numbers.
        note: what is not known, and why; empty when nothing is missing.
    """

    map: str
    lanes: list[list[list[float]]] = Field(default_factory=list)
    lane_heights_m: list[list[float]] = Field(default_factory=list)
    lane_widths_m: list[float] = Field(default_factory=list)
    spawn_points: list[list[float]] = Field(default_factory=list)
    note: str = ""
