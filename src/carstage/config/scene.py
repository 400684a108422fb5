"""What stands and moves in an episode: map, traffic, ego vehicle, scenario."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from carstage.config.fields import Names, Section, problem, setting

DEFAULT_MAP = "Stage01"


class MapConfig(Section):
    """The town of each episode."""

    choice: str | None = setting(
        None, title="Map", description="The map of all episodes.", group="scene", min_length=1
    )
    random_from: Names | None = setting(
        None,
        title="Random from",
        description="Maps to draw one from for each episode; `[all]` is every map of the server.",
        group="scene",
        min_length=1,
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
        return self


def _radius_m(who: str) -> Any:
    return setting(
        80.0,
        title=f"{who} within",
        description="They begin within this distance of the ego first and further away when the "
        "places there run out; null: anywhere on the map.",
        group="traffic",
        unit="m",
        gt=0,
        le=10_000,
    )


class Vehicles(Section):
    """Other vehicles, driven by the Traffic Manager."""

    count: int = setting(
        20,
        title="Vehicles",
        description="Vehicles besides the ego.",
        group="traffic",
        ge=0,
        le=1000,
    )
    filter: str = setting(
        "vehicle.*",
        title="Vehicle filter",
        description="Pattern of the blueprints to draw from.",
        group="traffic",
        min_length=1,
    )
    radius_m: float | None = _radius_m("Vehicles")


class Pedestrians(Section):
    """Pedestrians, led by CARLA's walker controllers."""

    count: int = setting(
        10, title="Pedestrians", description="Pedestrians.", group="traffic", ge=0, le=1000
    )
    filter: str = setting(
        "walker.pedestrian.*",
        title="Pedestrian filter",
        description="Pattern of the blueprints to draw from.",
        group="traffic",
        min_length=1,
    )
    radius_m: float | None = _radius_m("Pedestrians")


class Ego(Section):
    """The vehicle that carries the sensors."""

    blueprint: str = setting(
        "vehicle.tesla.model3",
        title="Ego vehicle",
        description="Blueprint of the vehicle that carries the rig.",
        group="ego",
        min_length=1,
    )
    spawn: Literal["random"] | Annotated[int, Field(ge=0)] = setting(
        "random",
        title="Start",
        description="Index of the map's spawn point, or `random`: drawn for each episode.",
        group="ego",
    )


class Scenario(Section):
    """What the ego does."""

    kind: Literal["autopilot"] = setting(
        "autopilot",
        title="Scenario",
        description="`autopilot`: the Traffic Manager drives the ego through town.",
        group="ego",
    )
