"""The types of the blueprint library."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from carstage_sim.world.state import ActorKind
from carstage_sim.world.vehicles.parameters import Vector3, VehicleParameters


class AttributeType(IntEnum):
    """Type of an attribute's value; a dialect adds its own base where it numbers them from 1."""

    BOOL = 0
    INT = 1
    FLOAT = 2
    STRING = 3
    COLOR = 4


@dataclass(frozen=True, slots=True)
class Attribute:
    """One attribute of a blueprint (``carla.ActorAttribute``).

    Attributes:
        value: default value, as text; colours are ``r,g,b``.
        recommended: values that the client offers; the default is the first of them.
        modifiable: whether a client may set it before it spawns.
        restrict: whether only recommended values are allowed.
        kept: whether an actor gets the value that a client set; else it has the default.
    """

    id: str
    type: AttributeType
    value: str
    recommended: tuple[str, ...] = ()
    modifiable: bool = True
    restrict: bool = False
    kept: bool = True


@dataclass(frozen=True, slots=True)
class Blueprint:
    """Everything that is known of an actor before it is spawned.

    Attributes:
        uid: number of the definition, from 1, stable within a version of the library.
        id: type id such as ``vehicle.tesla.model3``.
        tags: the comma-separated words that clients filter by.
        box_center, box_extent: bounding box in the actor's frame: centre and half sizes, metres.
        semantic_tags: values of :class:`carstage_sim.labels.CityObjectLabel`.
        vehicle: dynamics of vehicles, else None.
    """

    uid: int
    id: str
    tags: str
    attributes: tuple[Attribute, ...]
    kind: ActorKind
    box_center: Vector3
    box_extent: Vector3
    semantic_tags: tuple[int, ...]
    vehicle: VehicleParameters | None = None

    def attribute(self, attribute_id: str) -> Attribute:
        """The attribute of that id.

        Raises:
            KeyError: the blueprint has no such attribute.
        """
        for attribute in self.attributes:
            if attribute.id == attribute_id:
                return attribute
        raise KeyError(f"blueprint {self.id} has no attribute {attribute_id!r}")
