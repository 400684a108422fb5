"""What the embedded simulator offers."""

from __future__ import annotations

from carstage.web.messages.base import Message


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
