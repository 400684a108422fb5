"""COCO's own 80 categories of things, and which of them Car-STAGE's classes are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from carstage.errors import BadInputError
from carstage.exporters.class_map import ClassMap, Target
from carstage.exporters.options import ExportOptions

_NAMES: Final = (
    ("person", 1, "person"),
    ("vehicle", 2, "bicycle, car, motorcycle, airplane, bus, train, truck, boat"),
    ("outdoor", 10, "traffic light, fire hydrant, , stop sign, parking meter, bench"),
    ("animal", 16, "bird, cat, dog, horse, sheep, cow, elephant, bear, zebra, giraffe"),
    ("accessory", 27, "backpack, umbrella, , , handbag, tie, suitcase"),
    (
        "sports",
        34,
        "frisbee, skis, snowboard, sports ball, kite, baseball bat, baseball glove, skateboard, "
        "surfboard, tennis racket",
    ),
    ("kitchen", 44, "bottle, , wine glass, cup, fork, knife, spoon, bowl"),
    (
        "food",
        52,
        "banana, apple, sandwich, orange, broccoli, carrot, hot dog, pizza, donut, cake",
    ),
    ("furniture", 62, "chair, couch, potted plant, bed, , dining table, , , toilet"),
    ("electronic", 72, "tv, laptop, mouse, remote, keyboard, cell phone"),
    ("appliance", 78, "microwave, oven, toaster, sink, refrigerator"),
    ("indoor", 84, "book, clock, vase, scissors, teddy bear, hair drier, toothbrush"),
)
"""Supercategory, first number, and names; a gap is a number that COCO leaves out."""

COCO_CATEGORIES: Final[Mapping[int, tuple[str, str]]] = MappingProxyType(
    {
        number: (name, group)
        for group, first, names in _NAMES
        for number, name in enumerate(names.split(", "), first)
        if name
    }
)
"""Name and supercategory by COCO's number, ascending."""

_NUMBERS: Final = {name: number for number, (name, _) in COCO_CATEGORIES.items()}
_STOP_SIGN: Final = r"(?<!bus)(?<!bus_)stop(?!_?light)"
"""In names of level objects: of stop signs, not of bus stops."""


def _coco(name: str, blueprint: str = "") -> Target:
    return Target(name, _NUMBERS[name], blueprint)


COCO80: Final = ClassMap(
    (
        ("car", _coco("car")),
        ("van", _coco("car")),
        ("truck", _coco("truck")),
        ("bus", _coco("bus")),
        ("motorcycle", _coco("motorcycle")),
        ("bicycle", _coco("bicycle")),
        ("walker_adult", _coco("person")),
        ("walker_child", _coco("person")),
        ("walker_wheelchair", _coco("person")),
        ("rider", _coco("person")),
        ("traffic_light", _coco("traffic light")),
        ("traffic_sign", _coco("stop sign", _STOP_SIGN)),
        ("train", _coco("train")),
    )
)
"""COCO has no van: its annotators call most of them cars. Of signs it has stop signs alone."""


def with_categories(options: ExportOptions) -> ExportOptions:
    """The options with COCO's categories as their class map, where they are asked for.

    Raises:
        BadInputError: another class map is given too.
    """
    if options.categories != "coco80":
        return options
    if options.class_map is not None:
        raise BadInputError(
            "categories and class-map: both say what the classes become.", "Give one of them."
        )
    return replace(options, class_map=COCO80)
