"""Actions of events: changes of speed and lane, jumps."""

from __future__ import annotations

from carstage.open_scenario.controllers import FASTEST_M_S, check_controller
from carstage.open_scenario.document import Element
from carstage.open_scenario.entities import Entities
from carstage.open_scenario.places import entity_of, read_position
from carstage.spec.storyboard import (
    DIMENSIONS,
    MOST_LANES,
    SHAPES,
    StoryAction,
    StoryDynamics,
    StoryLaneChange,
    StorySpeed,
    StoryTeleport,
)

_LONGEST = 1e5


def read_action(action: Element, actors: tuple[str, ...], entities: Entities) -> StoryAction | None:
    """``Action`` of an event; None: it says who drives, which changes nothing.

    Args:
        action: the element.
        actors: who carries it out.
        entities: who there is.

    Raises:
        ConfigError: it is of another kind, or wrong.
    """
    action.allow("name", "PrivateAction GlobalAction UserDefinedAction")
    name = action.name()
    private = action.only(["PrivateAction"])
    kind = private.only(
        ["LongitudinalAction", "LateralAction", "TeleportAction", "ControllerAction"]
    )
    if kind.tag == "ControllerAction":
        check_controller(kind, is_ego=actors == entities.names[:1])
        return None
    needed = entities.drivable if kind.tag == "LateralAction" else entities.movable
    if kind.tag != "TeleportAction" and not set(actors) <= set(needed):
        kind.refuse("not all of its actors can do that", "Let vehicles carry it out.")
    if kind.tag == "TeleportAction":
        place = read_position(kind.only_child("Position"), entities.axes, entities.names)
        return StoryTeleport(name, place)
    if kind.tag == "LateralAction":
        return _lane_change(kind.only_child("LaneChangeAction"), name, actors, entities)
    return _speed(kind.only_child("SpeedAction"), name, entities)


def _speed(action: Element, name: str, entities: Entities) -> StorySpeed:
    action.allow("", "SpeedActionDynamics SpeedActionTarget")
    dynamics = _dynamics(action.child("SpeedActionDynamics"))
    known = ["AbsoluteTargetSpeed", "RelativeTargetSpeed"]
    target = action.child("SpeedActionTarget").only(known)
    if target.tag == "AbsoluteTargetSpeed":
        value = target.allow("value").number("value", least=0.0, most=FASTEST_M_S)
        return StorySpeed(name, dynamics, value)
    target.allow("entityRef value speedTargetValueType continuous")
    if target.flag("continuous"):
        target.refuse("a speed that follows another all the time is not known to Car-STAGE")
    is_factor = target.choice("speedTargetValueType", ("delta", "factor")) == "factor"
    value = target.number("value", least=-FASTEST_M_S, most=FASTEST_M_S)
    return StorySpeed(name, dynamics, value, entity_of(target, entities.movable), is_factor)


def _lane_change(
    action: Element, name: str, actors: tuple[str, ...], entities: Entities
) -> StoryLaneChange:
    action.allow("targetLaneOffset", "LaneChangeActionDynamics LaneChangeTarget")
    if action.number("targetLaneOffset", 0.0) != 0.0:
        action.refuse("a targetLaneOffset is not known to Car-STAGE")
    dynamics = _dynamics(action.child("LaneChangeActionDynamics"))
    target = action.child("LaneChangeTarget").only(["AbsoluteTargetLane", "RelativeTargetLane"])
    if target.tag == "AbsoluteTargetLane":
        lane = target.allow("value").whole("value", -MOST_LANES, MOST_LANES)
        return StoryLaneChange(name, dynamics, lane)
    target.allow("entityRef value")
    if (entity_of(target, entities.names),) != actors:
        target.refuse("lanes are counted from the lane of its one actor alone")
    return StoryLaneChange(name, dynamics, None, target.whole("value", -MOST_LANES, MOST_LANES))


def _dynamics(element: Element) -> StoryDynamics:
    element.allow("dynamicsShape value dynamicsDimension followingMode")
    element.choice("followingMode", ("position",), "position")
    shape = element.choice("dynamicsShape", SHAPES)
    dimension = element.choice("dynamicsDimension", DIMENSIONS)
    value = element.number("value", least=0.0, most=_LONGEST)
    if dimension == "rate" and value == 0.0 and shape != "step":
        element.refuse("a rate of 0 leads nowhere", "Give one above 0.")
    return StoryDynamics(shape, dimension, value)
