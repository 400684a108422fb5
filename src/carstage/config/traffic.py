"""Other road users: how many of which, where they begin, how they drive and walk."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from carstage.config.fields import Section, problem, setting
from carstage.spec import GroupSpec, PedestriansSpec, TrafficSpec, VehiclesSpec
from carstage.spec.road_users import SPREADS

Generation = Literal["all", "1", "2", "3"]
Shortfall = Literal["warn", "fail", "fill"]
#: A number, or the two ends between which each vehicle draws its own.
Spread = float | Annotated[tuple[float, float], Strict(strict=False)]


def _filter(default: str) -> Any:
    return setting(
        default,
        title="Filter",
        description="Pattern of the blueprints to draw from.",
        group="traffic",
        min_length=1,
    )


def _generation() -> Any:
    return setting(
        GroupSpec.generation,
        title="Generation",
        description="Only blueprints of CARLA's asset generation `1`, `2` or `3`.",
        group="traffic",
    )


def _radius_m(who: str) -> Any:
    return setting(
        80.0,
        title=f"{who} within",
        description="They begin this near to the ego, further away when places run out; null: "
        "anywhere on the map.",
        group="traffic",
        unit="m",
        gt=0,
        le=10_000,
    )


def _shortfall(more: str) -> Any:
    return setting(
        VehiclesSpec.shortfall,
        title="Shortfall",
        description="When places run out: `warn` and record with fewer, `fail`, or `fill`: "
        f"look for {more}.",
        group="traffic",
    )


class VehicleGroup(Section):
    """Further vehicles with a filter of their own."""

    count: int = setting(title="Vehicles", description="How many.", group="traffic", ge=1, le=1000)
    filter: str = _filter("vehicle.*")
    base_type: str | None = setting(
        None,
        title="Class",
        description="Only blueprints of this base type: car, van, truck, bus, motorcycle, bicycle.",
        group="traffic",
        min_length=1,
    )
    generation: Generation = _generation()


class Vehicles(Section):
    """Other vehicles, driven by the Traffic Manager."""

    count: int = setting(
        20,
        title="Vehicles",
        basic=True,
        description="Vehicles besides the ego.",
        group="traffic",
        ge=0,
        le=1000,
    )
    filter: str = _filter("vehicle.*")
    radius_m: float | None = _radius_m("Vehicles")
    generation: Generation = _generation()
    groups: Annotated[tuple[VehicleGroup, ...], Strict(strict=False)] = setting(
        (),
        title="Groups",
        description="Further groups, such as `{count: 3, base_type: truck}`; they add to count "
        "and are spawned first.",
        group="traffic",
    )
    shortfall: Shortfall = _shortfall("places along the roads between the spawn points")

    @property
    def total(self) -> int:
        """Vehicles of all groups."""
        return self.count + sum(group.count for group in self.groups)


def _share(default: float, title: str, sentence: str) -> Any:
    return setting(
        default, title=title, description=sentence, unit="%", group="traffic", ge=0, le=100
    )


class Pedestrians(Section):
    """Pedestrians, led by CARLA's walker controllers."""

    count: int = setting(
        10,
        title="Pedestrians",
        basic=True,
        description="Pedestrians.",
        group="traffic",
        ge=0,
        le=1000,
    )
    filter: str = _filter("walker.pedestrian.*")
    radius_m: float | None = _radius_m("Pedestrians")
    generation: Generation = _generation()
    running_percent: float = _share(
        PedestriansSpec.running_percent, "Running", "Share that runs instead of walking."
    )
    crossing_percent: float = _share(
        PedestriansSpec.crossing_percent,
        "Crossing",
        "Share that crosses the road at crosswalks near the ego; on CARLA's maps also elsewhere.",
    )
    in_groups_percent: float = _share(
        PedestriansSpec.in_groups_percent,
        "In groups",
        "Share that walks side by side in pairs and threes, each group to one goal.",
    )
    wheelchair_percent: float = _share(
        PedestriansSpec.wheelchair_percent,
        "In wheelchairs",
        "Share, of those whose blueprint can use one, that sits in a wheelchair; CARLA 0.9.16 on.",
    )
    shortfall: Shortfall = _shortfall("more places on the sidewalks")


def _spread(default: float | None, title: str, sentence: str, unit: str) -> Any:
    return setting(default, title=title, description=sentence, unit=unit, group="traffic")


class Traffic(Section):
    """How the Traffic Manager drives; the defaults keep the law.

    A value is a number for all vehicles, or `[low, high]`: each vehicle draws its own between them.
    """

    speed_difference_percent: Spread = _spread(
        0.0, "Slower by", "How far below the speed limit; negative: above it.", "%"
    )
    distance_m: Spread | None = _spread(
        None, "Distance", "To the vehicle ahead; left out: the Traffic Manager's own.", "m"
    )
    lane_changes: bool = setting(
        TrafficSpec.lane_changes,
        title="Lane changes",
        description="Vehicles may change lanes.",
        group="traffic",
    )
    random_lane_change_percent: Spread = _spread(
        0.0, "Random lane changes", "Chance of a lane change without need, to each side.", "%"
    )
    ignore_lights_percent: Spread = _spread(
        0.0, "Ignore lights", "Chance of running a red light.", "%"
    )
    ignore_signs_percent: Spread = _spread(0.0, "Ignore signs", "Chance of passing a stop.", "%")
    ignore_vehicles_percent: Spread = _spread(
        0.0, "Ignore vehicles", "Chance of not braking for a vehicle.", "%"
    )
    ignore_walkers_percent: Spread = _spread(
        0.0, "Ignore pedestrians", "Chance of not braking for a pedestrian.", "%"
    )
    include_ego: bool = setting(
        TrafficSpec.include_ego,
        title="Ego, too",
        description="The ego draws like the others; else it keeps the law.",
        group="traffic",
    )
    hybrid_physics_radius_m: Annotated[float, Field(gt=0, le=10_000)] | None = setting(
        None,
        title="Hybrid physics",
        description="Vehicles farther from the ego move without physics; left out: none does.",
        unit="m",
        group="traffic",
    )

    @model_validator(mode="after")
    def _check_spreads(self) -> Traffic:
        for name, (least, most) in SPREADS.items():
            value = getattr(self, name)
            if value is None:
                continue
            ends = value if isinstance(value, tuple) else (value,)
            for position, end in enumerate(ends):
                path = (name, position) if isinstance(value, tuple) else (name,)
                if end < least:
                    raise problem(f"{end:g} is too small.", f"Give at least {least:g}.", *path)
                if end > most:
                    raise problem(f"{end:g} is too large.", f"Give at most {most:g}.", *path)
            if ends[0] > ends[-1]:
                raise problem(f"{ends[0]:g} is above {ends[-1]:g}.", "Write [low, high].", name)
        return self
