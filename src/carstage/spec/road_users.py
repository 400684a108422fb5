"""The other road users: how many of which, where they begin, how they drive and walk."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, Optional, Tuple, Union

from carstage.spec.fields import Fields
from carstage.spec.plain import LEFT_OUT
from carstage.spec.values import Value

ALL_GENERATIONS = "all"
_SHORTFALLS = ("warn", "fail", "fill")

Spread = Union[float, Tuple[float, float]]
"""A number for all vehicles, or the two ends between which each draws its own."""


@dataclass(frozen=True, eq=False, repr=False)
class GroupSpec(Value):
    """So many actors of these blueprints.

    Attributes:
        filter: pattern of blueprint ids.
        base_type: class of vehicle such as ``truck``; None: any.
        generation: ``1``, ``2``, ``3`` or ``all``.
    """

    count: int
    filter: str
    base_type: Optional[str] = field(default=None, metadata=LEFT_OUT)
    generation: str = ALL_GENERATIONS

    @classmethod
    def read(cls, fields: Fields) -> GroupSpec:
        """Check and read one group."""
        return cls(
            count=fields.integer("count", 0),
            filter=fields.text("filter"),
            base_type=fields.text("base_type") if "base_type" in fields else None,
            generation=_generation(fields),
        )


@dataclass(frozen=True, eq=False, repr=False)
class VehiclesSpec(Value):
    """Vehicles besides the ego.

    Attributes:
        count, filter, generation: the largest group.
        radius_m: how near the ego they begin; None: anywhere.
        groups: further groups, which are spawned first.
        shortfall: what too few places mean: ``warn``, ``fail`` or ``fill``.
    """

    count: int
    filter: str
    radius_m: Optional[float]
    generation: str = ALL_GENERATIONS
    groups: Tuple[GroupSpec, ...] = ()
    shortfall: str = "warn"

    @classmethod
    def read(cls, fields: Fields) -> VehiclesSpec:
        """Check and read the section."""
        return cls(
            count=fields.integer("count", 0),
            filter=fields.text("filter"),
            radius_m=_radius_m(fields),
            generation=_generation(fields),
            groups=tuple(GroupSpec.read(group) for group in fields.objects("groups")),
            shortfall=_shortfall(fields),
        )

    @property
    def all_groups(self) -> Tuple[GroupSpec, ...]:
        """Every group, in the order in which they are spawned."""
        return (*self.groups, GroupSpec(self.count, self.filter, None, self.generation))

    @property
    def total(self) -> int:
        """Vehicles of all groups."""
        return sum(group.count for group in self.all_groups)


@dataclass(frozen=True, eq=False, repr=False)
class PedestriansSpec(Value):
    """Pedestrians, led by CARLA's walker controllers; shares in per cent, the rest as vehicles."""

    count: int
    filter: str
    radius_m: Optional[float]
    generation: str = ALL_GENERATIONS
    running_percent: float = 0.0
    crossing_percent: float = 0.0
    shortfall: str = "warn"
    in_groups_percent: float = field(default=0.0, metadata=LEFT_OUT)
    wheelchair_percent: float = field(default=0.0, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields) -> PedestriansSpec:
        """Check and read the section."""
        return cls(
            count=fields.integer("count", 0),
            filter=fields.text("filter"),
            radius_m=_radius_m(fields),
            generation=_generation(fields),
            running_percent=_percent(fields, "running_percent"),
            crossing_percent=_percent(fields, "crossing_percent"),
            shortfall=_shortfall(fields),
            in_groups_percent=_percent(fields, "in_groups_percent"),
            wheelchair_percent=_percent(fields, "wheelchair_percent"),
        )

    @property
    def group(self) -> GroupSpec:
        """All of them as one group."""
        return GroupSpec(self.count, self.filter, None, self.generation)


@dataclass(frozen=True, eq=False, repr=False)
class TrafficSpec(Value):
    """How the Traffic Manager drives.

    Attributes:
        include_ego: the ego draws its values like the others, else it keeps the law.
        hybrid_physics_radius_m: vehicles farther from the ego move without physics; None: none.
    """

    speed_difference_percent: Optional[Spread] = field(default=None, metadata=LEFT_OUT)
    distance_m: Optional[Spread] = field(default=None, metadata=LEFT_OUT)
    lane_changes: bool = True
    random_lane_change_percent: Optional[Spread] = field(default=None, metadata=LEFT_OUT)
    ignore_lights_percent: Optional[Spread] = field(default=None, metadata=LEFT_OUT)
    ignore_signs_percent: Optional[Spread] = field(default=None, metadata=LEFT_OUT)
    ignore_vehicles_percent: Optional[Spread] = field(default=None, metadata=LEFT_OUT)
    ignore_walkers_percent: Optional[Spread] = field(default=None, metadata=LEFT_OUT)
    include_ego: bool = False
    hybrid_physics_radius_m: Optional[float] = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields) -> TrafficSpec:
        """Check and read the section."""
        spreads = {
            name: fields.spread(name, *bounds) for name, bounds in SPREADS.items() if name in fields
        }
        return cls(
            lane_changes=fields.flag("lane_changes") if "lane_changes" in fields else True,
            include_ego=fields.flag("include_ego") if "include_ego" in fields else False,
            hybrid_physics_radius_m=fields.number("hybrid_physics_radius_m", 0.0)
            if "hybrid_physics_radius_m" in fields
            else None,
            **spreads,
        )

    @property
    def spreads(self) -> Dict[str, Tuple[float, float]]:
        """By name, the ends between which each vehicle draws its own value."""
        found: Dict[str, Tuple[float, float]] = {}
        for name in SPREADS:
            value: Optional[Spread] = getattr(self, name)
            if value is not None:
                found[name] = value if isinstance(value, tuple) else (value, value)
        return found


_PERCENT = (0.0, 100.0)
SPREADS = {
    "speed_difference_percent": (-100.0, 100.0),
    "distance_m": (0.0, 100.0),
    "random_lane_change_percent": _PERCENT,
    "ignore_lights_percent": _PERCENT,
    "ignore_signs_percent": _PERCENT,
    "ignore_vehicles_percent": _PERCENT,
    "ignore_walkers_percent": _PERCENT,
}
"""The least and the most of each value that vehicles draw."""


def _generation(fields: Fields) -> str:
    return fields.text("generation") if "generation" in fields else ALL_GENERATIONS


def _radius_m(fields: Fields) -> Optional[float]:
    return fields.number("radius_m", 0.0) if "radius_m" in fields else None


def _shortfall(fields: Fields) -> str:
    return fields.text("shortfall", _SHORTFALLS) if "shortfall" in fields else _SHORTFALLS[0]


def _percent(fields: Fields, name: str) -> float:
    return fields.number(name, least=0.0, most=100.0) if name in fields else 0.0
