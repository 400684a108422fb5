"""The static props of CARLA's catalogue by their names; sizes are those of such things."""

from __future__ import annotations

from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.state import ActorKind
from carstage_sim.world.vehicles.parameters import Vector3

# name, size class, half sizes in metres
_PROPS: tuple[tuple[str, str, Vector3], ...] = (
    ("advertisement", "medium", (0.10, 0.70, 1.10)),
    ("atm", "medium", (0.40, 0.45, 0.95)),
    ("barbeque", "medium", (0.30, 0.50, 0.50)),
    ("barrel", "medium", (0.30, 0.30, 0.45)),
    ("bench01", "medium", (0.32, 0.80, 0.42)),
    ("bench02", "medium", (0.35, 0.90, 0.44)),
    ("bench03", "medium", (0.30, 0.75, 0.42)),
    ("bike helmet", "tiny", (0.13, 0.11, 0.09)),
    ("bikeparking", "medium", (0.30, 1.20, 0.45)),
    ("bin", "medium", (0.32, 0.32, 0.50)),
    ("box01", "medium", (0.30, 0.30, 0.30)),
    ("box02", "medium", (0.25, 0.25, 0.25)),
    ("box03", "medium", (0.35, 0.25, 0.20)),
    ("briefcase", "small", (0.22, 0.06, 0.16)),
    ("brokentile01", "small", (0.20, 0.18, 0.02)),
    ("brokentile02", "small", (0.16, 0.14, 0.02)),
    ("brokentile03", "small", (0.22, 0.12, 0.02)),
    ("brokentile04", "small", (0.12, 0.12, 0.02)),
    ("busstop", "big", (0.80, 2.00, 1.30)),
    ("busstoplb", "big", (0.80, 2.00, 1.30)),
    ("calibrator", "medium", (0.05, 0.50, 0.90)),
    ("chainbarrier", "medium", (0.70, 0.08, 0.50)),
    ("chainbarrierend", "medium", (0.40, 0.08, 0.50)),
    ("clothcontainer", "medium", (0.60, 0.60, 0.90)),
    ("clothesline", "medium", (0.50, 1.20, 0.90)),
    ("colacan", "tiny", (0.033, 0.033, 0.06)),
    ("constructioncone", "small", (0.17, 0.17, 0.30)),
    ("container", "big", (1.00, 0.60, 0.65)),
    ("creasedbox01", "small", (0.25, 0.20, 0.12)),
    ("creasedbox02", "small", (0.22, 0.22, 0.10)),
    ("creasedbox03", "small", (0.18, 0.24, 0.14)),
    ("dirtdebris01", "medium", (0.70, 0.60, 0.08)),
    ("dirtdebris02", "medium", (0.90, 0.80, 0.10)),
    ("dirtdebris03", "medium", (0.60, 0.70, 0.06)),
    ("doghouse", "medium", (0.50, 0.40, 0.45)),
    ("foodcart", "big", (0.80, 1.20, 1.20)),
    ("fountain", "big", (1.80, 1.80, 1.40)),
    ("garbage01", "small", (0.40, 0.35, 0.12)),
    ("garbage02", "small", (0.30, 0.30, 0.10)),
    ("garbage03", "small", (0.35, 0.30, 0.10)),
    ("garbage04", "small", (0.45, 0.40, 0.15)),
    ("garbage05", "small", (0.50, 0.40, 0.12)),
    ("garbage06", "small", (0.30, 0.25, 0.08)),
    ("gardenlamp", "small", (0.12, 0.12, 0.40)),
    ("glasscontainer", "medium", (0.65, 0.65, 0.85)),
    ("gnome", "small", (0.12, 0.12, 0.25)),
    ("guitarcase", "small", (0.55, 0.20, 0.08)),
    ("haybale", "big", (0.60, 1.20, 0.60)),
    ("haybalelb", "big", (0.60, 1.20, 0.60)),
    ("ironplank", "medium", (0.60, 1.20, 0.01)),
    ("kiosk_01", "big", (1.20, 1.60, 1.40)),
    ("mailbox", "medium", (0.25, 0.30, 0.60)),
    ("maptable", "medium", (0.10, 0.60, 0.90)),
    ("mobile", "tiny", (0.035, 0.07, 0.005)),
    ("motorhelmet", "tiny", (0.14, 0.14, 0.13)),
    ("omri", "medium", (0.10, 0.40, 0.90)),
    ("pergola", "big", (2.00, 2.00, 1.40)),
    ("plantpot01", "medium", (0.35, 0.35, 0.60)),
    ("plantpot02", "medium", (0.30, 0.30, 0.50)),
    ("plantpot03", "medium", (0.40, 0.40, 0.55)),
    ("plantpot04", "medium", (0.45, 0.45, 0.70)),
    ("plantpot05", "medium", (0.25, 0.25, 0.45)),
    ("plantpot06", "medium", (0.50, 0.50, 0.80)),
    ("plantpot07", "medium", (0.30, 0.30, 0.65)),
    ("plantpot08", "medium", (0.35, 0.35, 0.40)),
    ("plasticbag", "small", (0.18, 0.18, 0.18)),
    ("plasticchair", "small", (0.28, 0.28, 0.42)),
    ("plastictable", "medium", (0.45, 0.45, 0.36)),
    ("platformgarbage01", "big", (1.50, 1.00, 0.10)),
    ("purse", "tiny", (0.14, 0.14, 0.12)),
    ("shop01", "big", (1.80, 2.40, 1.50)),
    ("shoppingbag", "tiny", (0.17, 0.17, 0.20)),
    ("shoppingcart", "medium", (0.45, 0.28, 0.50)),
    ("shoppingtrolley", "small", (0.20, 0.22, 0.48)),
    ("slide", "medium", (1.40, 0.35, 1.00)),
    ("streetbarrier", "medium", (0.60, 0.15, 0.50)),
    ("streetfountain", "medium", (0.35, 0.35, 0.55)),
    ("streetsign", "medium", (0.05, 0.35, 1.20)),
    ("streetsign01", "medium", (0.05, 0.30, 1.10)),
    ("streetsign04", "medium", (0.05, 0.35, 1.30)),
    ("swing", "medium", (0.90, 1.60, 1.10)),
    ("swingcouch", "medium", (0.70, 1.00, 1.00)),
    ("table", "medium", (0.45, 0.80, 0.38)),
    ("trafficcone01", "small", (0.19, 0.19, 0.38)),
    ("trafficcone02", "small", (0.17, 0.17, 0.30)),
    ("trafficwarning", "medium", (0.90, 1.00, 1.20)),
    ("trampoline", "big", (1.60, 1.60, 0.45)),
    ("trashbag", "small", (0.30, 0.30, 0.35)),
    ("trashcan01", "medium", (0.32, 0.32, 0.55)),
    ("trashcan02", "medium", (0.28, 0.28, 0.50)),
    ("trashcan03", "medium", (0.30, 0.30, 0.45)),
    ("trashcan04", "medium", (0.25, 0.25, 0.45)),
    ("trashcan05", "medium", (0.35, 0.35, 0.60)),
    ("travelcase", "small", (0.25, 0.15, 0.36)),
    ("vendingmachine", "medium", (0.42, 0.50, 0.95)),
    ("warningaccident", "medium", (0.05, 0.40, 0.50)),
    ("warningconstruction", "medium", (0.35, 0.30, 0.60)),
    ("wateringcan", "tiny", (0.14, 0.14, 0.15)),
)


MESH_PROP = "static.prop.mesh"
"""Shows a mesh of CARLA's assets, of which there are none here: it has a place and no shape."""


def has_shape(type_id: str) -> bool:
    """Whether actors of a blueprint are props that are seen and hit."""
    return type_id.startswith("static.prop.") and type_id != MESH_PROP


def prop_blueprints() -> list[Blueprint]:
    """The props, not yet numbered; their origin is the middle of the base."""
    role = Attribute("role_name", AttributeType.STRING, "prop", ("prop",))
    props = [
        Blueprint(
            uid=0,
            id=f"static.prop.{name}",
            tags=f"static,prop,{name}",
            attributes=(role, Attribute("size", AttributeType.STRING, size, modifiable=False)),
            kind=ActorKind.OTHER,
            box_center=(0.0, 0.0, extent[2]),
            box_extent=extent,
            semantic_tags=(CityObjectLabel.STATIC,),
        )
        for name, size, extent in _PROPS
    ]
    mesh = (
        Attribute("mesh_path", AttributeType.STRING, "", ("",)),
        Attribute("mass", AttributeType.FLOAT, "0.0", ("0.0",)),
        Attribute("scale", AttributeType.FLOAT, "1.0", ("1.0",)),
    )
    return [*props, _shapeless(MESH_PROP, (role, *mesh)), _empty()]


def _empty() -> Blueprint:
    """A place that other actors can be attached to."""
    role = Attribute("role_name", AttributeType.STRING, "default", ("default",))
    return _shapeless("util.actor.empty", (role,))


def _shapeless(type_id: str, attributes: tuple[Attribute, ...]) -> Blueprint:
    return Blueprint(
        uid=0,
        id=type_id,
        tags=type_id.replace(".", ","),
        attributes=attributes,
        kind=ActorKind.OTHER,
        box_center=(0.0, 0.0, 0.0),
        box_extent=(0.0, 0.0, 0.0),
        semantic_tags=(),
    )
