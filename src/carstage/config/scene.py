"""What an episode plays in and what the ego does there: map, ego vehicle, scenario."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Strict, field_validator, model_validator

from carstage.config.asked_events import Events, no_events
from carstage.config.drivers import AutopilotDriver, Driver
from carstage.config.fields import Names, Section, problem, setting, shortened, unknown
from carstage.config.own_classes import Values
from carstage.config.timing import Timing
from carstage.spec.drivers import MOST_PARAMETERS

DEFAULT_MAP = "Stage01"
MAP_SUFFIX = ".xodr"
"""A map with this ending is a file of the user's, which the embedded simulator makes a town of."""
_MAP_NAME = re.compile(r"/?([\w-][\w .-]*/)*[\w-][\w .-]*")
"""A name or a path of the server's, no part of which is ``..``."""
#: Layers of CARLA's `_Opt` maps: ``carla.MapLayer`` of the 0.9.16 client.
MAP_LAYERS = (
    "Buildings",
    "Decals",
    "Foliage",
    "Ground",
    "ParkedVehicles",
    "Particles",
    "Props",
    "StreetLights",
    "Walls",
)


def map_name(text: str) -> str:
    """A map's name, of its path on the server or of an OpenDRIVE file's path."""
    return text.rsplit("/", 1)[-1].removesuffix(MAP_SUFFIX)


class MapConfig(Section):
    """The town of each episode."""

    choice: str | None = setting(
        None,
        title="Map",
        basic=True,
        description="The map of all episodes: a name, or an OpenDRIVE file (`towns/My.xodr`) for "
        "the embedded simulator.",
        group="scene",
        min_length=1,
    )
    random_from: Names | None = setting(
        None,
        title="Random from",
        description="Maps to draw one from for each episode; `[all]` is every map of the server.",
        group="scene",
        min_length=1,
    )
    layers: Literal["all"] | Names = setting(
        "all",
        title="Layers",
        description="Layers to load of CARLA's `_Opt` maps; other maps load whole.",
        group="scene",
    )

    @model_validator(mode="before")
    @classmethod
    def _accept_short_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"choice": data}
        if isinstance(data, dict) and not {"choice", "random_from"} & set(data):
            return {"choice": DEFAULT_MAP, **data}
        return data

    @model_validator(mode="after")
    def _check_one(self) -> MapConfig:
        if (self.choice is None) == (self.random_from is None):
            raise problem("exactly one of choice and random_from is needed.", "Keep one.", "choice")
        for place, name in self.located_names():
            is_file = name.endswith(MAP_SUFFIX)
            if not _MAP_NAME.fullmatch(map_name(name) if is_file else name):
                raise problem(
                    f"{shortened(repr(name))} cannot be a map's name.",
                    "Write its name, such as Town01, its path on the server, or an OpenDRIVE file.",
                    *place,
                )
        for position, name in enumerate(() if self.layers == "all" else self.layers):
            if name not in MAP_LAYERS:
                raise problem(*unknown("map layer", name, MAP_LAYERS), "layers", position)
        return self

    def located_names(self) -> list[tuple[tuple[str | int, ...], str]]:
        """Each map as it was written, ``all`` among them, behind its path in this section."""
        if self.choice is not None:
            return [(("choice",), self.choice)]
        return [(("random_from", i), name) for i, name in enumerate(self.random_from or ())]


def _coordinate(title: str) -> Any:
    return setting(
        title=title,
        description=f"{title} on the map, CARLA's axes.",
        unit="m",
        group="ego",
        ge=-100_000,
        le=100_000,
    )


class Place(Section):
    """A place on the map; the height is the road's."""

    x: float = _coordinate("x")
    y: float = _coordinate("y")


class Stand(Place):
    """A place on the map and a heading."""

    z: float = setting(
        0.3,
        title="z",
        description="Height; a little above the road.",
        unit="m",
        group="ego",
        ge=-10_000,
        le=10_000,
    )
    yaw_deg: float = setting(
        0.0, title="Heading", description="Yaw.", unit="deg", group="ego", ge=-360, le=360
    )


Channel = Annotated[int, Field(ge=0, le=255)]


class Ego(Section):
    """The vehicle that carries the sensors."""

    blueprint: str = setting(
        "vehicle.tesla.model3",
        title="Ego vehicle",
        basic=True,
        description="Blueprint of the vehicle that carries the rig.",
        group="ego",
        min_length=1,
    )
    spawn: Literal["random"] | Annotated[int, Field(ge=0)] | Stand = setting(
        "random",
        title="Start",
        basic=True,
        description="Index of the map's spawn point, `random`: drawn for each episode, or a place "
        "`{x, y, z, yaw_deg}`.",
        group="ego",
    )
    color: Literal["random"] | Annotated[tuple[Channel, Channel, Channel], Strict(strict=False)] = (
        setting(
            "random",
            title="Colour",
            description="`[red, green, blue]` from 0 to 255, or `random`: one that the blueprint "
            "recommends.",
            group="ego",
        )
    )
    driver: Driver = setting(
        AutopilotDriver,
        title="Driver",
        description="Who drives it; see docs/how-to/drive-the-ego.md.",
        group="ego",
    )


class AutopilotScenario(Section):
    """The Traffic Manager drives the ego through town, wherever the lights lead it."""

    kind: Literal["autopilot"] = setting(
        "autopilot",
        title="Scenario",
        basic=True,
        description="The Traffic Manager drives the ego through town.",
        group="ego",
    )
    events: Events = no_events()


class RouteScenario(Section):
    """The Traffic Manager drives the ego through given places, on the shortest way by road."""

    kind: Literal["route"] = setting(
        title="Scenario", description="The ego drives through given places.", group="ego"
    )
    through: Annotated[tuple[Annotated[int, Field(ge=0)] | Place, ...], Strict(strict=False)] = (
        setting(
            title="Through",
            description="In this order: indices of spawn points, or places `{x, y}`. After the "
            "last one the ego drives on.",
            group="ego",
            min_length=1,
        )
    )
    events: Events = no_events()


class StationaryScenario(Section):
    """The ego stands with its hand brake on; the others drive."""

    kind: Literal["stationary"] = setting(
        title="Scenario", description="The ego stands still.", group="ego"
    )


class ReplayScenario(Section):
    """All road users move as in a recorded episode; map, ego and traffic are taken from there.

    Sensors, weather, labels and conversion are this configuration's own.
    """

    kind: Literal["replay"] = setting(
        title="Scenario", description="A recorded episode once more.", group="ego"
    )
    episode: str = setting(
        title="Episode",
        description="Folder of the episode: `DATASET/episodes/<id>/<attempt>`, or `DATASET` if it "
        "has only one.",
        group="ego",
        min_length=1,
    )


class LogScenario(Section):
    """All road users move as in a log of CARLA's recorder; map, ego, traffic are taken from there.

    Sensors, weather, labels and conversion are this configuration's own.
    """

    kind: Literal["log"] = setting(
        title="Scenario", description="A log of CARLA's recorder.", group="ego"
    )
    file: str = setting(
        title="Log",
        description="File that `start_recorder` wrote, of CARLA or of the embedded simulator.",
        group="ego",
        min_length=1,
    )
    ego: str = setting(
        "hero",
        title="Ego",
        description="The vehicle that carries the rig: its `role_name`, its id in the log, or a "
        "pattern such as `vehicle.tesla.*`.",
        group="ego",
        min_length=1,
        max_length=200,
    )
    start_s: float = setting(
        0.0,
        title="Begin at",
        description="Where in the log the episode begins; at the next recorded frame.",
        unit="s",
        group="ego",
        ge=0.0,
        le=1e6,
    )


class OpenScenarioScenario(Section):
    """An OpenSCENARIO file says who does what; map and traffic are taken from there.

    Sensors, weather, labels and conversion are this configuration's own.
    """

    kind: Literal["openscenario"] = setting(
        title="Scenario", description="An OpenSCENARIO 1.x file.", group="ego"
    )
    file: str = setting(
        title="File",
        description="The `.xosc` file; see docs/how-to/scenarios.md.",
        group="ego",
        min_length=1,
    )
    scenario_runner: str | None = setting(
        None,
        title="scenario_runner",
        description="Folder of CARLA's scenario_runner, which plays the file; left out: Car-STAGE "
        "plays it, as far as it knows OpenSCENARIO.",
        group="ego",
        min_length=1,
    )
    params: Values = setting(
        dict,
        title="Parameters",
        description="Values of the file's parameters that override it.",
        group="ego",
        max_length=MOST_PARAMETERS,
    )
    python: str = setting(
        "auto",
        title="Python",
        description="An interpreter that has scenario_runner's packages, CARLA's `agents` and the "
        "`carla` wheel; `auto`: this one.",
        group="ego",
        min_length=1,
    )

    @field_validator("params")
    @classmethod
    def _check_params(cls, params: dict[str, Any]) -> dict[str, Any]:
        for name, value in params.items():
            if not name.isidentifier() or set(str(value)) & set(",:"):
                raise problem("this cannot be given.", "Leave out commas and colons.", name)
        return params


_SET_BY_US = {
    "map": "scenario.map",
    "carla_map": "scenario.map",
    "timestep": "fps",
    "weather": "weather",
    "address": "server",
    "port": "server",
    "timeout": "supervision",
    "render": "the rig",
    "record": "output",
}
"""Scenic's global parameters that follow from a setting of ours."""


class ScenicScenario(Section):
    """A Scenic program places and moves everybody; the ego is its ``ego``.

    Sensors, weather, labels and conversion are this configuration's own.
    """

    kind: Literal["scenic"] = setting(
        title="Scenario", description="A Scenic program.", group="ego"
    )
    file: str = setting(
        title="Program",
        description="The `.scenic` file; see docs/how-to/scenarios.md.",
        group="ego",
        min_length=1,
    )
    params: Values = setting(
        dict,
        title="Parameters",
        description="Global parameters that override those of the program.",
        group="ego",
        max_length=MOST_PARAMETERS,
    )
    map: str | None = setting(
        None,
        title="Map",
        description="A map's name instead of the one that the program names.",
        group="ego",
        min_length=1,
    )
    mode_2d: bool = setting(
        True,
        title="2D mode",
        description="Scenic's 2D compatibility mode (`--2d`), as its examples for CARLA need it.",
        group="ego",
    )
    python: str = setting(
        "auto",
        title="Python",
        description="An interpreter that has Scenic 3 and the `carla` wheel; `auto`: this one.",
        group="ego",
        min_length=1,
    )

    @field_validator("params")
    @classmethod
    def _check_params(cls, params: dict[str, Any]) -> dict[str, Any]:
        for name in params:
            if not name.isidentifier():
                raise problem("this cannot be a parameter's name.", "Use letters and '_'.", name)
            if name in _SET_BY_US:
                raise problem("Car-STAGE sets it.", f"It follows from {_SET_BY_US[name]}.", name)
        return params


def _accept_former_name(data: Any) -> Any:
    """``hold`` is what versions up to 0.1 called ``stationary``."""
    if isinstance(data, dict) and data.get("kind") == "hold":
        return {**data, "kind": "stationary"}
    return data


Scenario = Annotated[
    AutopilotScenario
    | RouteScenario
    | StationaryScenario
    | ReplayScenario
    | LogScenario
    | ScenicScenario
    | OpenScenarioScenario,
    Discriminator("kind"),
    BeforeValidator(_accept_former_name),
]
FROM_FILES = (ReplayScenario, LogScenario, ScenicScenario, OpenScenarioScenario)
"""Scenarios that follow a file, which is read once for all episodes."""
SCENARIO_KINDS = ("autopilot", "route", "stationary", "replay", "log", "scenic", "openscenario")


def check_file(scenario: Section, timing: Timing) -> None:
    """Refuse what a file tells step by step where the world runs by the clock.

    Raises:
        PydanticCustomError: with the path of the setting.
    """
    if isinstance(scenario, FROM_FILES) and timing.mode != "sync":
        raise problem(
            "what a file tells needs a world that waits for each step.",
            "Set timing.mode to sync.",
            *("scenario", "kind"),
        )
