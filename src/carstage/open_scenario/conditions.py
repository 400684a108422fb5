"""Triggers: conditions by time, by state of the storyboard, and by what road users do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from carstage.open_scenario.document import Element
from carstage.open_scenario.entities import Entities
from carstage.open_scenario.places import entity_of, read_position
from carstage.spec.storyboard import (
    EDGES,
    ELEMENT_TYPES,
    EUCLIDEAN,
    LATERAL,
    LONGEST_DELAY_S,
    LONGITUDINAL,
    RULES,
    STATES,
    TRANSITIONS,
    StoryCondition,
    Trigger,
)

_CRITERIA = "criteria_"
_LONGEST_S = 1e6
_MEASURES = {
    "euclidianDistance": EUCLIDEAN,
    "cartesianDistance": EUCLIDEAN,
    LONGITUDINAL: LONGITUDINAL,
    LATERAL: LATERAL,
}
_BODIES = "freespace relativeDistanceType coordinateSystem"


def read_trigger(trigger: Element, entities: Entities) -> Trigger:
    """``StartTrigger`` or ``StopTrigger``; one without conditions never holds.

    Conditions whose names begin with ``criteria_`` are left out: scenario_runner judges by them,
    and starts and stops nothing.

    Raises:
        ConfigError: a condition is of another kind, or wrong.
    """
    trigger.allow("", "ConditionGroup")
    groups = (
        tuple(
            _condition(condition, entities)
            for condition in group.allow("", "Condition").children()
            if not condition.text("name", "").startswith(_CRITERIA)
        )
        for group in trigger.children()
    )
    return tuple(group for group in groups if group)


def _condition(condition: Element, entities: Entities) -> StoryCondition:
    condition.allow("name delay conditionEdge", "ByValueCondition ByEntityCondition")
    by = condition.only(["ByValueCondition", "ByEntityCondition"])
    read = _by_value if by.tag == "ByValueCondition" else _by_entity
    return StoryCondition(
        edge=condition.choice("conditionEdge", EDGES),
        delay_s=condition.number("delay", 0.0, least=0.0, most=LONGEST_DELAY_S),
        **read(by, entities),
    )


def _by_value(by: Element, entities: Entities) -> dict[str, Any]:
    del entities
    kind = by.only(["SimulationTimeCondition", "StoryboardElementStateCondition"])
    if kind.tag == "SimulationTimeCondition":
        return {"kind": "time", **_compared(kind.allow("value rule"))}
    kind.allow("storyboardElementType storyboardElementRef state")
    element_type = kind.choice("storyboardElementType", ELEMENT_TYPES)
    return {
        "kind": "element",
        "element": (element_type, kind.name("storyboardElementRef")),
        "state": kind.choice("state", STATES + TRANSITIONS),
    }


def _by_entity(by: Element, entities: Entities) -> dict[str, Any]:
    by.allow("", "TriggeringEntities EntityCondition")
    triggering = by.child("TriggeringEntities").allow("triggeringEntitiesRule", "EntityRef")
    names = tuple(entity_of(each, entities.names) for each in triggering.children())
    if not names:
        triggering.refuse("nobody is named", "Name somebody by EntityRef.")
    every = triggering.choice("triggeringEntitiesRule", ("any", "all")) == "all"
    kind = by.child("EntityCondition").only(_READERS)
    return {"entities": names, "every": every, **_READERS[kind.tag](kind, entities)}


def _traveled(kind: Element, entities: Entities) -> dict[str, Any]:
    del entities
    value = kind.allow("value").number("value", least=0.0)
    return {"kind": "traveled", "rule": "greaterOrEqual", "value": value}


def _reach(kind: Element, entities: Entities) -> dict[str, Any]:
    kind.allow("tolerance", "Position")
    return {
        "kind": "reach",
        "rule": "lessOrEqual",
        "value": kind.number("tolerance", least=0.0),
        "place": read_position(kind.child("Position"), entities.axes, entities.names),
    }


def _distance(kind: Element, entities: Entities) -> dict[str, Any]:
    kind.allow(f"value rule alongRoute {_BODIES}", "Position")
    if kind.flag("alongRoute"):
        kind.refuse("distances along a route are not known to Car-STAGE")
    place = read_position(kind.child("Position"), entities.axes, entities.names)
    return {"kind": "distance", "place": place, **_compared(kind), **_measured(kind)}


def _relative_distance(kind: Element, entities: Entities) -> dict[str, Any]:
    kind.allow(f"entityRef value rule {_BODIES}")
    other = entity_of(kind, entities.names)
    return {"kind": "relative_distance", "other": other, **_compared(kind), **_measured(kind)}


def _speed(kind: Element, entities: Entities) -> dict[str, Any]:
    del entities
    return {"kind": "speed", **_compared(kind.allow("value rule"))}


def _relative_speed(kind: Element, entities: Entities) -> dict[str, Any]:
    kind.allow("entityRef value rule")
    other = entity_of(kind, entities.names)
    return {"kind": "relative_speed", "other": other, **_compared(kind)}


def _stand_still(kind: Element, entities: Entities) -> dict[str, Any]:
    del entities
    duration_s = kind.allow("duration").number("duration", least=0.0, most=_LONGEST_S)
    return {"kind": "stand_still", "rule": "greaterOrEqual", "value": duration_s}


def _time_to_collision(kind: Element, entities: Entities) -> dict[str, Any]:
    kind.allow(f"value rule alongRoute {_BODIES}", "TimeToCollisionConditionTarget")
    if kind.flag("alongRoute"):
        kind.refuse("times along a route are not known to Car-STAGE")
    target = kind.child("TimeToCollisionConditionTarget").only(["EntityRef", "Position"])
    found: dict[str, Any] = {"kind": "time_to_collision", **_compared(kind), **_measured(kind)}
    if target.tag == "EntityRef":
        return {**found, "other": entity_of(target, entities.names)}
    return {**found, "place": read_position(target, entities.axes, entities.names)}


def _headway(kind: Element, entities: Entities) -> dict[str, Any]:
    kind.allow(f"entityRef value rule alongRoute {_BODIES}")
    if kind.flag("alongRoute"):
        kind.refuse("times along a route are not known to Car-STAGE")
    other = entity_of(kind, entities.names)
    return {"kind": "headway", "other": other, **_compared(kind), **_measured(kind)}


_READERS: dict[str, Callable[[Element, Entities], dict[str, Any]]] = {
    "TraveledDistanceCondition": _traveled,
    "ReachPositionCondition": _reach,
    "DistanceCondition": _distance,
    "RelativeDistanceCondition": _relative_distance,
    "SpeedCondition": _speed,
    "RelativeSpeedCondition": _relative_speed,
    "StandStillCondition": _stand_still,
    "TimeToCollisionCondition": _time_to_collision,
    "TimeHeadwayCondition": _headway,
}


def _compared(kind: Element) -> dict[str, Any]:
    return {"value": kind.number("value"), "rule": kind.choice("rule", RULES)}


def _measured(kind: Element) -> dict[str, Any]:
    kind.choice("coordinateSystem", ("entity",), "entity")
    measure = kind.choice("relativeDistanceType", _MEASURES, "euclidianDistance")
    return {"measure": _MEASURES[measure], "freespace": kind.flag("freespace")}
