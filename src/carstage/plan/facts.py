"""What a server offers, as far as planning needs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

DIALECT = "0.9.16"


@dataclass(frozen=True, slots=True)
class ServerFacts:
    """What a server offers, as far as planning needs it.

    Attributes:
        maps: by map name, without folders, how many spawn points are drawn from.
        blueprints: attributes by blueprint id, each with its default as text.
        dialect: version of the wire protocol.
        spawn_points: how many there are, for the maps of which that is known; None: ``maps`` says.
        opendrive: named hash of the text, by the name of each map that is a file of the user's.
        limits: largest values of sensors' attributes by CARLA's name, and of ``pixels``.
    """

    maps: Mapping[str, int]
    blueprints: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    dialect: str = DIALECT
    spawn_points: Mapping[str, int] | None = None
    limits: Mapping[str, float] = field(default_factory=dict)
    opendrive: Mapping[str, str] = field(default_factory=dict)

    def count(self, map_name: str) -> int | None:
        """How many spawn points a map has; None where that is unknown."""
        return (self.maps if self.spawn_points is None else self.spawn_points).get(map_name)
