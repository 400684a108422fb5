"""The layers of a grid, and what of the vector map and of the labels belongs to each."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from carstage.vector_map.model import DRIVEN_TYPES

STATIC_LAYERS: Final = (
    "drivable_area", "lane", "junction", "parking", "shoulder", "bike_lane", "sidewalk",
    "solid_marking", "broken_marking", "curb", "crosswalk", "stop_line",
)  # fmt: skip
"""Layers of the vector map."""
OBJECT_LAYERS: Final = (
    "ego", "car", "van", "truck", "bus", "train", "motorcycle", "bicycle", "pedestrian",
)  # fmt: skip
"""Layers of boxes; every class of vehicles has the layer of its name."""
LAYERS: Final = (*STATIC_LAYERS, *OBJECT_LAYERS)
"""All layers; the place of a layer is the number of its bit."""

_BITS: Final = MappingProxyType({name: 1 << number for number, name in enumerate(LAYERS)})

_OTHER_LANES: Final = MappingProxyType(
    {
        "parking": ("drivable_area", "parking"),
        "shoulder": ("shoulder",),
        "stop": ("shoulder",),
        "biking": ("bike_lane",),
        "sidewalk": ("sidewalk",),
        "walking": ("sidewalk",),
    }
)


def layer_bit(name: str) -> int:
    """The bit of a layer in the semantic grid.

    Raises:
        KeyError: there is no such layer.
    """
    return _BITS[name]


def lane_bits(lane_type: str, *, in_junction: bool) -> int:
    """The layers of a lane by OpenDRIVE's type; 0: it has none, such as a median."""
    if lane_type in DRIVEN_TYPES:
        return layer_bit("drivable_area") | layer_bit("junction" if in_junction else "lane")
    return sum(layer_bit(name) for name in _OTHER_LANES.get(lane_type, ()))


def marking_bits(marking_type: str) -> int:
    """The layers of a marking by OpenDRIVE's type; ``solid broken`` has both, ``none`` nothing."""
    bits = 0
    for word in marking_type.split():
        if word == "solid":
            bits |= layer_bit("solid_marking")
        elif word in ("broken", "botts"):
            bits |= layer_bit("broken_marking")
        elif word == "curb":
            bits |= layer_bit("curb")
    return bits


def object_bit(object_class: str, *, is_ego: bool) -> int:
    """The layer of a labelled object by its class; 0: it has none, such as a traffic light."""
    if is_ego:
        return layer_bit("ego")
    if object_class.startswith("walker"):
        return layer_bit("pedestrian")
    return layer_bit(object_class) if object_class in OBJECT_LAYERS else 0
