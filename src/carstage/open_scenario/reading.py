"""The whole file: parameters, map, entities, storyboard."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from carstage.config.scene import map_name
from carstage.errors import ConfigError
from carstage.open_scenario.actions import read_action
from carstage.open_scenario.conditions import read_trigger
from carstage.open_scenario.document import Element, root_of
from carstage.open_scenario.entities import Entities, read_entities, read_init
from carstage.open_scenario.places import Axes, entity_of
from carstage.spec import StoryboardSpec
from carstage.spec.storyboard import (
    PRIORITIES,
    StoryAct,
    StoryCondition,
    StoryEvent,
    StoryGroup,
    StoryManeuver,
    Trigger,
)

_MOST_TIMES = 10_000
_PRIORITIES = (*PRIORITIES, "overwrite")
"""``overwrite`` is what OpenSCENARIO 1.0 and 1.1 call ``override``."""


def town_of(content: bytes, given: Mapping[str, Any]) -> str:
    """The map that a file names by ``RoadNetwork/LogicFile``; the rest is not looked at.

    Args:
        content: of the file.
        given: values of parameters that override the file's.

    Raises:
        ConfigError: it is no OpenSCENARIO, or names none.
    """
    root = root_of(content)
    declared = root.iterfind("ParameterDeclarations/ParameterDeclaration")
    values = {str(each.get("name")): str(each.get("value")) for each in declared}
    return _town(Element(root, values | {name: _text(value) for name, value in given.items()}))


def read_storyboard(content: bytes, given: Mapping[str, Any]) -> tuple[str, StoryboardSpec]:
    """The map and the storyboard of a file.

    Args:
        content: of the file.
        given: values of parameters that override the file's.

    Raises:
        ConfigError: something in it cannot be, or is beyond what Car-STAGE plays; with the line
            and the path in the document.
    """
    document = root_of(content)
    root = Element(document, {})
    root.allow(
        _XML_SCHEMA,
        "FileHeader ParameterDeclarations CatalogLocations RoadNetwork Entities Storyboard",
    )
    root = Element(document, _parameters(root.maybe("ParameterDeclarations"), given))
    town = _town(root)
    header = root.child("FileHeader")
    if header.text("revMajor", "1") != "1":
        header.refuse("it is of another version than 1.x", "Write the file in OpenSCENARIO 1.x.")
    axes = Axes(header.text("description", "").startswith("CARLA:"))
    entities = read_entities(root.child("Entities"), axes)
    board = root.child("Storyboard").allow("", "Init Story StopTrigger")
    init = board.child("Init").allow("", "Actions")
    entities = read_init(init.child("Actions"), entities)
    acts = tuple(act for story in board.children("Story") for act in _acts(story, entities))
    stop = board.maybe("StopTrigger")
    spec = StoryboardSpec(
        entities.everybody, acts, () if stop is None else read_trigger(stop, entities)
    )
    _check_elements(spec, board)
    return town, spec


_XML_SCHEMA = "{http://www.w3.org/2001/XMLSchema-instance}noNamespaceSchemaLocation"


def _town(root: Element) -> str:
    network = root.maybe("RoadNetwork")
    file = None if network is None else network.maybe("LogicFile")
    town = "" if file is None else map_name(file.text("filepath", ""))
    if not re.fullmatch(r"[\w-]+", town):
        raise ConfigError(
            "scenario.file: it names no map by RoadNetwork/LogicFile.",
            "Name an OpenSCENARIO 1.x file with a town, as CARLA's examples have it.",
        )
    return town


def _parameters(declared: Element | None, given: Mapping[str, Any]) -> dict[str, str]:
    found: dict[str, str] = {}
    for each in [] if declared is None else declared.allow("", "ParameterDeclaration").children():
        found[each.allow("name parameterType value").name()] = each.text("value")
    for name, value in given.items():
        if name not in found:
            raise ConfigError(
                f"scenario.params.{name}: the file declares no such parameter.",
                f"Declared are: {', '.join(found) or 'none'}.",
            )
        found[name] = _text(value)
    return found


def _text(value: Any) -> str:
    """A parameter's value as the file would spell it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _acts(story: Element, entities: Entities) -> Iterator[StoryAct]:
    story.allow("name", "ParameterDeclarations Act")
    _check_no_parameters(story)
    for act in story.children("Act"):
        act.allow("name", "ManeuverGroup StartTrigger StopTrigger")
        stop = act.maybe("StopTrigger")
        yield StoryAct(
            act.name(),
            tuple(_group(group, entities) for group in act.children("ManeuverGroup")),
            _start(act, entities),
            () if stop is None else read_trigger(stop, entities),
        )


def _start(element: Element, entities: Entities) -> Trigger | None:
    start = element.maybe("StartTrigger")
    return None if start is None else read_trigger(start, entities)


def _group(group: Element, entities: Entities) -> StoryGroup:
    group.allow("name maximumExecutionCount", "Actors Maneuver")
    if group.whole("maximumExecutionCount", 1, _MOST_TIMES, 1) != 1:
        group.refuse("a group that acts more than once is not known to Car-STAGE")
    actors = group.child("Actors").allow("selectTriggeringEntities", "EntityRef")
    if actors.flag("selectTriggeringEntities"):
        actors.refuse("actors that a trigger selects are not known to Car-STAGE")
    names = tuple(entity_of(each, entities.names) for each in actors.children())
    maneuvers = group.children("Maneuver")
    return StoryGroup(
        group.name(), names, tuple(_maneuver(each, names, entities) for each in maneuvers)
    )


def _maneuver(maneuver: Element, actors: tuple[str, ...], entities: Entities) -> StoryManeuver:
    maneuver.allow("name", "ParameterDeclarations Event")
    _check_no_parameters(maneuver)
    events = []
    for event in maneuver.children("Event"):
        event.allow("name priority maximumExecutionCount", "Action StartTrigger")
        priority = event.choice("priority", _PRIORITIES)
        actions = (read_action(each, actors, entities) for each in event.children("Action"))
        events.append(
            StoryEvent(
                event.name(),
                "override" if priority == "overwrite" else priority,
                event.whole("maximumExecutionCount", 1, _MOST_TIMES, 1),
                tuple(action for action in actions if action is not None),
                _start(event, entities),
            )
        )
    return StoryManeuver(maneuver.name(), tuple(events))


def _check_no_parameters(element: Element) -> None:
    for each in element.children("ParameterDeclarations"):
        if each.children():
            each.refuse("parameters are known to Car-STAGE at the file's begin alone")


def _check_elements(spec: StoryboardSpec, board: Element) -> None:
    """Refuse conditions on parts of the storyboard that are not there, or there twice."""
    there: Counter[tuple[str, str]] = Counter()
    for act in spec.acts:
        there["act", act.name] += 1
        for group in act.groups:
            there["maneuverGroup", group.name] += 1
            for maneuver in group.maneuvers:
                there["maneuver", maneuver.name] += 1
                for event in maneuver.events:
                    there["event", event.name] += 1
                    there.update(("action", action.name) for action in event.actions)
    for condition in _conditions(spec):
        if condition.element is not None and there[condition.element] != 1:
            count = there[condition.element] or "none"
            kind, name = condition.element
            board.refuse(
                f"a condition names the {kind} {name!r}, and there is {count}",
                "Give each part that is named a name of its own.",
            )


def _conditions(spec: StoryboardSpec) -> Iterator[StoryCondition]:
    triggers: list[Trigger | None] = [spec.stop]
    for act in spec.acts:
        triggers += [act.start, act.stop]
        maneuvers = (maneuver for group in act.groups for maneuver in group.maneuvers)
        triggers += [event.start for maneuver in maneuvers for event in maneuver.events]
    for trigger in triggers:
        for group in trigger or ():
            yield from group
