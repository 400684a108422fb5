"""The trigger of friction: a box on the road in which tyres hold less, or better."""

from __future__ import annotations

from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.state import ActorKind


def trigger_blueprints() -> list[Blueprint]:
    """The one trigger, not yet numbered; extents are centimetres, as in CARLA."""
    number = AttributeType.FLOAT
    return [
        Blueprint(
            uid=0,
            id="static.trigger.friction",
            tags="static,trigger,friction",
            attributes=(
                Attribute("role_name", AttributeType.STRING, "default", ("default",)),
                Attribute("friction", number, "3.5", ("3.5",)),
                *(Attribute(f"extent_{axis}", number, "1.0", ("1.0",)) for axis in "xyz"),
            ),
            kind=ActorKind.OTHER,
            box_center=(0.0, 0.0, 0.0),
            box_extent=(0.0, 0.0, 0.0),
            semantic_tags=(),
        )
    ]
