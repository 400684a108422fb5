"""A handful of static props."""

from __future__ import annotations

from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.state import ActorKind
from carstage_sim.world.vehicles.parameters import Vector3

# name, size class, half sizes in metres
_PROPS: tuple[tuple[str, str, Vector3], ...] = (
    ("barrel", "medium", (0.30, 0.30, 0.45)),
    ("bench01", "medium", (0.32, 0.80, 0.42)),
    ("bin", "medium", (0.32, 0.32, 0.50)),
    ("box01", "medium", (0.30, 0.30, 0.30)),
    ("box02", "medium", (0.25, 0.25, 0.25)),
    ("chainbarrier", "medium", (0.70, 0.08, 0.50)),
    ("constructioncone", "small", (0.17, 0.17, 0.30)),
    ("container", "big", (1.00, 0.60, 0.65)),
    ("plasticbag", "small", (0.18, 0.18, 0.18)),
    ("streetbarrier", "medium", (0.60, 0.15, 0.50)),
    ("trafficcone01", "small", (0.19, 0.19, 0.38)),
    ("trafficcone02", "small", (0.17, 0.17, 0.30)),
    ("trafficwarning", "medium", (0.90, 1.00, 1.20)),
    ("trashcan01", "medium", (0.32, 0.32, 0.55)),
    ("warningconstruction", "medium", (0.35, 0.30, 0.60)),
)


def prop_blueprints() -> list[Blueprint]:
    """The props, not yet numbered; their origin is the middle of the base."""
    return [
        Blueprint(
            uid=0,
            id=f"static.prop.{name}",
            tags=f"static,prop,{name}",
            attributes=(
                Attribute("role_name", AttributeType.STRING, "prop", ("prop",)),
                Attribute("size", AttributeType.STRING, size, modifiable=False),
            ),
            kind=ActorKind.OTHER,
            box_center=(0.0, 0.0, extent[2]),
            box_extent=extent,
            semantic_tags=(CityObjectLabel.STATIC,),
        )
        for name, size, extent in _PROPS
    ]
