"""The pedestrians, and the controller that steers them."""

from __future__ import annotations

from carstage_sim.content.people import CHILDREN, COUNT, ELDERLY, FEMALE, SMALL_CHILDREN
from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.state import ActorKind
from carstage_sim.world.vehicles.parameters import Vector3

# Standing, walking and running, m/s.
_ADULT_SPEEDS = ("0.0", "1.6", "2.6")
_CHILD_SPEEDS = ("0.0", "1.1", "2.0")


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
            Attribute("can_use_wheelchair", AttributeType.BOOL, "false", modifiable=False),
            # Scripts set it on whoever has the attribute above, whatever its value; nobody here has
            # a wheelchair, so it stays as it is.
            Attribute("use_wheelchair", AttributeType.BOOL, "false", ("false",), kept=False),
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
