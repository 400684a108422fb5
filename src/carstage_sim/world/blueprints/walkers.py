"""The pedestrians, and the controller that steers them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from carstage_sim.content.people import (
    CHILDREN,
    COUNT,
    ELDERLY,
    FEMALE,
    SMALL_CHILDREN,
    WALKING_ONLY,
)
from carstage_sim.content.wheelchairs import EXTENT
from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.state import ActorKind
from carstage_sim.world.vehicles.parameters import Vector3

# Standing, walking and running, m/s.
_ADULT_SPEEDS = ("0.0", "1.6", "2.6")
_CHILD_SPEEDS = ("0.0", "1.1", "2.0")
_USE = "use_wheelchair"


def uses_wheelchair(attributes: Mapping[str, str]) -> bool:
    """Whether a walker of these attributes sits in a wheelchair."""
    return attributes.get(_USE, "").lower() == "true"


def seated(blueprint: Blueprint, attributes: Mapping[str, str]) -> Blueprint:
    """The blueprint of an actor with these attributes: the box of a wheelchair holds all of it.

    CARLA 0.9.16 keeps the box of who stands (issue 9410); a later release has one for the chair.
    """
    if blueprint.kind != ActorKind.WALKER or not uses_wheelchair(attributes):
        return blueprint
    return replace(blueprint, box_extent=EXTENT)


def _age(number: int) -> str:
    if number in SMALL_CHILDREN or number in CHILDREN:
        return "child"
    return "elderly" if number in ELDERLY else "adult"


def _extent(number: int) -> Vector3:
    # CARLA's capsules: the same for all adults, two sizes of children.
    if number in SMALL_CHILDREN:
        return (0.25, 0.25, 0.55)
    if number in CHILDREN:
        return (0.187679, 0.187679, 0.65)
    return (0.187679, 0.187679, 0.93)


def _pedestrian(number: int) -> Blueprint:
    age = _age(number)
    speeds = _CHILD_SPEEDS if age == "child" else _ADULT_SPEEDS
    text = AttributeType.STRING
    can = number not in WALKING_ONLY
    wishes = ("false", "true") if can else ("false",)
    return Blueprint(
        uid=0,
        id=f"walker.pedestrian.{number:04d}",
        tags=f"walker,pedestrian,{number:04d}",
        attributes=(
            Attribute("role_name", text, "pedestrian", ("pedestrian",)),
            Attribute("gender", text, "female" if number in FEMALE else "male", modifiable=False),
            Attribute("age", text, age, modifiable=False),
            Attribute("generation", AttributeType.INT, "2", modifiable=False),
            Attribute("speed", AttributeType.FLOAT, speeds[0], speeds),
            Attribute("is_invincible", AttributeType.BOOL, "true", ("true",)),
            Attribute("can_use_wheelchair", AttributeType.BOOL, str(can).lower(), modifiable=False),
            # Scripts set it on whoever has the attribute above, whatever its value; of who cannot
            # use a wheelchair it stays as it is.
            Attribute(_USE, AttributeType.BOOL, "false", wishes, kept=can),
            Attribute("ros_name", text, f"walker.pedestrian.{number:04d}"),
        ),
        kind=ActorKind.WALKER,
        # A walker's origin is at mid height (the client's navigation relies on it).
        box_center=(0.0, 0.0, 0.0),
        box_extent=_extent(number),
        semantic_tags=(CityObjectLabel.PEDESTRIANS,),
    )


def walker_blueprints() -> list[Blueprint]:
    """Pedestrians 0001 to 0050 and the AI controller, not yet numbered."""
    controller = Blueprint(
        uid=0,
        id="controller.ai.walker",
        tags="controller,ai,walker",
        attributes=(Attribute("role_name", AttributeType.STRING, "default", ("default",)),),
        kind=ActorKind.OTHER,
        box_center=(0.0, 0.0, 0.0),
        box_extent=(0.0, 0.0, 0.0),
        semantic_tags=(),
    )
    return [controller, *(_pedestrian(number) for number in range(1, COUNT + 1))]
