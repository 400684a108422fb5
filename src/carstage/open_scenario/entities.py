"""Who is there, where, and how fast in the begin."""

from __future__ import annotations

import re
from collections.abc import Container
from dataclasses import dataclass, replace

from carstage.open_scenario.controllers import FASTEST_M_S, check_controller
from carstage.open_scenario.document import WAY_OUT, Element
from carstage.open_scenario.places import Axes, entity_of, read_position
from carstage.spec.storyboard import StoryEntity, StoryPlace, WorldPlace

MOST_ENTITIES = 200
_FAMILIES = {"Vehicle": "vehicle.", "Pedestrian": "walker.", "MiscObject": "static."}
_NAMES_OF_EGOS = ("hero", "ego", "ego_vehicle")
_NO_CATALOGS = "Write it into the file, or give scenario.scenario_runner."
_COLOUR = re.compile(r"\d{1,3}(\s*,\s*\d{1,3}){2}")


@dataclass(frozen=True, slots=True)
class Entities:
    """Those of the file.

    Attributes:
        everybody: the ego is the first.
        axes: whose the file's numbers are in.
    """

    everybody: tuple[StoryEntity, ...]
    axes: Axes

    @property
    def names(self) -> tuple[str, ...]:
        """Of all."""
        return tuple(entity.name for entity in self.everybody)

    @property
    def movable(self) -> tuple[str, ...]:
        """Names of vehicles and pedestrians."""
        return tuple(one.name for one in self.everybody if not one.blueprint.startswith("static."))

    @property
    def drivable(self) -> tuple[str, ...]:
        """Names of vehicles."""
        return tuple(one.name for one in self.everybody if one.blueprint.startswith("vehicle."))


def read_entities(section: Element, axes: Axes) -> Entities:
    """``Entities``, without their places.

    Raises:
        ConfigError: one is of another kind, two have one name, or none is the ego.
    """
    section.allow("", "ScenarioObject")
    found: dict[str, StoryEntity] = {}
    egos = []
    for scenario_object in section.children():
        scenario_object.allow(
            "name", " ".join([*_FAMILIES, "CatalogReference", "ObjectController"])
        )
        name = scenario_object.name()
        if name in found:
            scenario_object.refuse(f"two are called {name!r}", "Rename one.")
        found[name], is_ego = _entity(scenario_object, name)
        if is_ego:
            egos.append(name)
        if len(found) > MOST_ENTITIES:
            scenario_object.refuse(f"more than {MOST_ENTITIES} are too many", "Leave some out.")
    vehicles = [name for name, one in found.items() if one.blueprint.startswith("vehicle.")]
    egos += [name for name in vehicles if name.lower() in _NAMES_OF_EGOS]
    if not egos:
        section.refuse(
            "none is the ego",
            'Give a Vehicle the Property name="type" value="ego_vehicle", or call it hero.',
        )
    ego = found.pop(egos[0])
    return Entities((ego, *found.values()), axes)


def _entity(scenario_object: Element, name: str) -> tuple[StoryEntity, bool]:
    kinds = [child for child in scenario_object.children() if child.tag != "ObjectController"]
    if len(kinds) != 1:
        scenario_object.refuse(f"it is no one of {', '.join(_FAMILIES)}", "Mend the file there.")
    (body,) = kinds
    if body.tag == "CatalogReference":
        body.refuse("catalogs are not read by Car-STAGE", _NO_CATALOGS)
    family = _FAMILIES[body.tag]
    names = [body.text(each, "") for each in ("name", "model", "model3d")]
    blueprint = next((each for each in names if each.startswith(family)), None)
    if blueprint is None:
        body.refuse(
            f"its name {names[0][:80]!r} is none of CARLA's",
            f"Name a blueprint, such as {_EXAMPLES[body.tag]}.",
        )
    properties = _properties(body)
    attributes = {}
    if "color" in properties and body.tag == "Vehicle":
        if not _COLOUR.fullmatch(properties["color"]):
            body.refuse("its color is no red,green,blue", "Give three numbers from 0 to 255.")
        attributes["color"] = "".join(properties["color"].split())
    is_ego = properties.get("type") == "ego_vehicle" and body.tag == "Vehicle"
    return StoryEntity(name, blueprint, attributes, WorldPlace(), 0.0), is_ego


_EXAMPLES = {
    "Vehicle": "vehicle.tesla.model3",
    "Pedestrian": "walker.pedestrian.0001",
    "MiscObject": "static.prop.trafficcone01",
}


def _properties(body: Element) -> dict[str, str]:
    properties = body.maybe("Properties")
    found = [] if properties is None else properties.children("Property")
    return {each.name(): each.text("value") for each in found}


def read_init(actions: Element, entities: Entities) -> Entities:
    """``Storyboard/Init/Actions``: the places of all, and their speeds.

    ``EnvironmentAction`` is not used: weather is the configuration's.

    Raises:
        ConfigError: something else is asked for, or somebody has no place.
    """
    actions.allow("", "GlobalAction Private")
    for action in actions.children("GlobalAction"):
        action.only(["EnvironmentAction"])
    places: dict[str, StoryPlace] = {}
    speeds: dict[str, float] = {}
    for private in actions.children("Private"):
        private.allow("entityRef", "PrivateAction")
        name = entity_of(private, entities.names)
        for action in private.children():
            kind = action.only(["TeleportAction", "LongitudinalAction", "ControllerAction"])
            if kind.tag == "TeleportAction":
                placed = [one for one in entities.names if one in places]
                places[name] = read_position(kind.only_child("Position"), entities.axes, placed)
            elif kind.tag == "ControllerAction":
                check_controller(kind, name == entities.names[0])
            else:
                speeds[name] = _first_speed(kind, name, entities.movable)
    for name in entities.names:
        if name not in places:
            actions.refuse(f"{name!r} has no TeleportAction", "Say where it begins.")
    return Entities(
        tuple(
            replace(one, place=places[one.name], speed_m_s=speeds.get(one.name, 0.0))
            for one in entities.everybody
        ),
        entities.axes,
    )


def _first_speed(longitudinal: Element, name: str, movable: Container[str]) -> float:
    if name not in movable:
        longitudinal.refuse(f"{name!r} is no vehicle and no pedestrian", WAY_OUT)
    action = longitudinal.only_child("SpeedAction")
    action.allow("", "SpeedActionDynamics SpeedActionTarget")
    target = action.child("SpeedActionTarget").only_child("AbsoluteTargetSpeed")
    return target.allow("value").number("value", least=0.0, most=FASTEST_M_S)
