"""OpenSCENARIO files for tests, put together from parts."""

from __future__ import annotations

import math
from collections.abc import Sequence

HERO, LEAD, WALKER = "hero", "lead", "walker"


def vehicle(name: str, blueprint: str = "vehicle.tesla.model3", kind: str = "simulation") -> str:
    """A car."""
    return (
        f'<ScenarioObject name="{name}"><Vehicle name="{blueprint}" vehicleCategory="car">'
        f'<ParameterDeclarations/><Properties><Property name="type" value="{kind}"/>'
        f"</Properties></Vehicle></ScenarioObject>"
    )


def pedestrian(name: str) -> str:
    """A pedestrian."""
    return (
        f'<ScenarioObject name="{name}"><Pedestrian name="walker.pedestrian.0001" mass="80" '
        f'pedestrianCategory="pedestrian"/></ScenarioObject>'
    )


def world(x: float, y: float, yaw_deg: float, z: float = 0.0) -> str:
    """A position in the world, in CARLA's axes."""
    return (
        f'<Position><WorldPosition x="{x}" y="{y}" z="{z}" h="{math.radians(yaw_deg)}"/></Position>'
    )


def placed(name: str, position: str, speed_m_s: float | None = None, more: str = "") -> str:
    """Where somebody begins, and how fast."""
    begin = f"<PrivateAction><TeleportAction>{position}</TeleportAction></PrivateAction>"
    if speed_m_s is not None:
        begin += f"<PrivateAction>{speed(speed_m_s)}</PrivateAction>"
    return f'<Private entityRef="{name}">{begin}{more}</Private>'


def speed(value: float, shape: str = "step", dimension: str = "time", over: float = 0.0) -> str:
    """A change of speed."""
    return (
        "<LongitudinalAction><SpeedAction>"
        f'<SpeedActionDynamics dynamicsShape="{shape}" value="{over}" '
        f'dynamicsDimension="{dimension}"/>'
        f'<SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget>'
        "</SpeedAction></LongitudinalAction>"
    )


def lane_change(name: str, left: int, over_s: float, shape: str = "sinusoidal") -> str:
    """A change of lane."""
    return (
        "<LateralAction><LaneChangeAction>"
        f'<LaneChangeActionDynamics dynamicsShape="{shape}" value="{over_s}" '
        'dynamicsDimension="time"/><LaneChangeTarget>'
        f'<RelativeTargetLane entityRef="{name}" value="{left}"/>'
        "</LaneChangeTarget></LaneChangeAction></LateralAction>"
    )


def at(time_s: float, rule: str = "greaterThan") -> str:
    """A condition of time."""
    return (
        f'<ByValueCondition><SimulationTimeCondition value="{time_s}" rule="{rule}"/>'
        "</ByValueCondition>"
    )


def after(kind: str, name: str, state: str = "endTransition") -> str:
    """A condition of the storyboard."""
    return (
        f'<ByValueCondition><StoryboardElementStateCondition storyboardElementType="{kind}" '
        f'storyboardElementRef="{name}" state="{state}"/></ByValueCondition>'
    )


def of(name: str, condition: str) -> str:
    """A condition of somebody."""
    return (
        '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any">'
        f'<EntityRef entityRef="{name}"/></TriggeringEntities>'
        f"<EntityCondition>{condition}</EntityCondition></ByEntityCondition>"
    )


def when(*conditions: str, edge: str = "rising", delay_s: float = 0.0, tag: str = "Start") -> str:
    """A trigger of one group."""
    each = "".join(
        f'<Condition name="" delay="{delay_s}" conditionEdge="{edge}">{one}</Condition>'
        for one in conditions
    )
    return f"<{tag}Trigger><ConditionGroup>{each}</ConditionGroup></{tag}Trigger>"


def event(
    name: str, actions: Sequence[str], trigger: str, priority: str = "parallel", most: int = 1
) -> str:
    """An event; its actions are called as it is, with their numbers."""
    each = "".join(
        f'<Action name="{name}{i}"><PrivateAction>{one}</PrivateAction></Action>'
        for i, one in enumerate(actions)
    )
    count = f'maximumExecutionCount="{most}"'
    return f'<Event name="{name}" priority="{priority}" {count}>{each}{trigger}</Event>'


def group(actor: str, *events: str) -> str:
    """What somebody does."""
    return (
        f'<ManeuverGroup name="{actor}Group" maximumExecutionCount="1">'
        f'<Actors selectTriggeringEntities="false"><EntityRef entityRef="{actor}"/></Actors>'
        f'<Maneuver name="{actor}Maneuver">{"".join(events)}</Maneuver></ManeuverGroup>'
    )


def scenario(
    entities: Sequence[str],
    init: Sequence[str],
    groups: Sequence[str],
    *,
    town: str = "Stage01",
    start: str = "",
    stop: str = "<StopTrigger/>",
    parameters: str = "",
    axes: str = "CARLA:",
) -> str:
    """A whole file."""
    start = start or when(at(-1.0), edge="none")
    act = f'<Act name="Act">{"".join(groups)}{start}</Act>'
    story = f'<Story name="Story">{act}</Story>' if groups else ""
    return (
        '<?xml version="1.0"?>\n<OpenSCENARIO>'
        f'<FileHeader revMajor="1" revMinor="2" date="2026-01-01T12:00:00" description="{axes}" '
        'author=""/>'
        f"<ParameterDeclarations>{parameters}</ParameterDeclarations><CatalogLocations/>"
        f'<RoadNetwork><LogicFile filepath="{town}"/></RoadNetwork>\n'
        f"<Entities>{''.join(entities)}</Entities>\n"
        f"<Storyboard><Init><Actions>{''.join(init)}</Actions></Init>\n{story}{stop}</Storyboard>"
        "</OpenSCENARIO>\n"
    )
