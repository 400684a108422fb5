"""Outlines of the vehicles' bodies, by build, and which blueprint has which build."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise
from typing import Any

import numpy as np

from carstage_sim.content.body_shape import Bars, BodyShape, Lamps, Tails
from carstage_sim.mesh import Material


class Build(Enum):
    """Kind of body."""

    SEDAN = "sedan"
    HATCH = "hatch"
    COUPE = "coupe"
    SUV = "suv"
    OFFROAD = "offroad"
    BUBBLE = "bubble"
    VAN = "van"
    CAMPER = "camper"
    AMBULANCE = "ambulance"
    PICKUP = "pickup"
    LORRY = "lorry"
    FIRE_ENGINE = "fire engine"
    DELIVERY = "delivery"
    BUS = "bus"
    MOTORCYCLE = "motorcycle"
    CRUISER = "cruiser"
    SCOOTER = "scooter"
    BICYCLE = "bicycle"
    CITY_BIKE = "city bike"


# fmt: off
_ROUND = (
    (-1.0, 0.87), (-0.97, 0.92), (-0.90, 0.96), (-0.72, 0.985), (-0.3, 1.0), (0.4, 1.0),
    (0.72, 0.985), (0.88, 0.955), (0.96, 0.91), (1.0, 0.85),
)
_SQUARE = ((-1.0, 0.93), (-0.96, 0.985), (-0.8, 1.0), (0.8, 1.0), (0.95, 0.97), (1.0, 0.90))



def _straight(*points: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """Points of a curve that runs straight between corners."""
    line = list(points[:1])
    for (x0, y0), (x1, y1) in pairwise(points):
        # Only neighbours of a corner bend: they stand close to it.
        for share in (0.004 / (x1 - x0), 1.0 - 0.004 / (x1 - x0)):
            if 0.0 < share < 1.0 and x1 - x0 > 0.05:
                line.append((x0 + share * (x1 - x0), y0 + share * (y1 - y0)))
        line.append((x1, y1))
    return tuple(line)


def _moved(shape: BodyShape, *pairs: tuple[float, float]) -> BodyShape:
    """A shape of which all at one x stands at another, what is between them in proportion.

    Args:
        shape: the outline.
        pairs: x of the outline, and where it comes to stand.
    """
    old, new = np.array(sorted([(-1.0, -1.0), *pairs, (1.0, 1.0)])).T

    def at(x: float) -> float:
        return float(np.interp(x, old, new)) if -1.0 <= x <= 1.0 else x

    def curve(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        return tuple((at(x), value) for x, value in points)

    return replace(
        shape,
        top=curve(shape.top),
        belt=curve(shape.belt),
        rear_window=(at(shape.rear_window[0]), at(shape.rear_window[1])),
        windscreen=(at(shape.windscreen[0]), at(shape.windscreen[1])),
        side_glass=(at(shape.side_glass[0]), at(shape.side_glass[1])),
        pillars=tuple(at(x) for x in shape.pillars),
        leans=curve(shape.leans),
    )


_SEDAN = BodyShape(
    top=(
        (-1.0, 0.67), (-0.93, 0.705), (-0.76, 0.735), (-0.70, 0.75), (-0.34, 0.955),
        (-0.05, 1.0), (0.12, 0.985), (0.22, 0.95), (0.50, 0.72), (0.56, 0.695),
        (0.78, 0.645), (0.93, 0.585), (1.0, 0.525),
    ),
    belt=((-1.0, 0.61), (-0.7, 0.665), (0.2, 0.625), (0.5, 0.60), (0.8, 0.545), (1.0, 0.475)),
    width=_ROUND, rear_window=(-0.69, -0.34), windscreen=(0.20, 0.50),
    side_glass=(-0.52, 0.41), pillars=(-0.06,),
    head_lamp=(0.52, 1.26, 0.415, 0.495), tail_lamp=(0.46, 1.22, 0.485, 0.59),
    grille=(0.37, 0.50, 0.42), intake=(0.165, 0.29, 0.72), bumper=True,
)
_HATCH = BodyShape(
    top=(
        (-1.0, 0.63), (-0.985, 0.665), (-0.93, 0.765), (-0.86, 0.865), (-0.78, 0.925),
        (-0.62, 0.96), (-0.3, 0.99), (-0.05, 1.0), (0.10, 0.985),
        (0.20, 0.955), (0.52, 0.70), (0.60, 0.67), (0.80, 0.615), (0.94, 0.56), (1.0, 0.50),
    ),
    belt=((-1.0, 0.61), (-0.7, 0.65), (0.2, 0.605), (0.5, 0.575), (0.8, 0.525), (1.0, 0.455)),
    width=_ROUND, rear_window=(-0.975, -0.80), windscreen=(0.18, 0.52),
    side_glass=(-0.68, 0.43), pillars=(-0.40, 0.0),
    head_lamp=(0.54, 1.24, 0.39, 0.48), tail_lamp=(0.60, 1.18, 0.45, 0.60),
    grille=(0.385, 0.475, 0.48), bars=Bars.MESH, intake=(0.165, 0.30, 0.66), tail_lean=0.04,
    boot=False, tinted=True, leans=((-0.90, 0.0), (-0.68, 0.06), (-0.42, 0.0)), rear_pillar=0.08,
    bumper=True,
)
_SUV = BodyShape(
    top=(
        (-1.0, 0.65), (-0.985, 0.70), (-0.95, 0.84), (-0.915, 0.935), (-0.87, 0.972),
        (-0.72, 0.988), (-0.3, 1.0), (0.08, 0.99), (0.19, 0.955), (0.415, 0.70), (0.46, 0.675),
        (0.78, 0.65), (0.92, 0.625), (0.975, 0.60), (1.0, 0.56),
    ),
    belt=((-1.0, 0.61), (-0.5, 0.615), (0.3, 0.60), (0.5, 0.59), (0.8, 0.575), (1.0, 0.52)),
    width=_ROUND, rear_window=(-0.992, -0.93), windscreen=(0.18, 0.42),
    side_glass=(-0.87, 0.34), pillars=(-0.56, -0.10),
    leans=((-0.98, 0.0), (-0.87, 0.075), (-0.56, 0.045), (-0.30, 0.0)), quarter=0.06,
    clearance=0.125, tumblehome=0.17, cladding=0.23, nose_round=0.17, nose_lean=0.05,
    tail_lean=0.03,
    head_lamp=(0.56, 1.16, 0.455, 0.535), tail_lamp=(0.70, 1.12, 0.43, 0.61),
    tails=Tails.UPRIGHT, grille=(0.37, 0.565, 0.53), intake=(0.205, 0.30, 0.66), boot=False,
    tinted=True, rails=True, rear_pillar=0.09, bumper=True,
)

SHAPES: dict[Build, BodyShape] = {
    Build.SEDAN: _SEDAN,
    Build.HATCH: _HATCH,
    Build.COUPE: BodyShape(
        top=(
            (-1.0, 0.655), (-0.96, 0.70), (-0.90, 0.722), (-0.84, 0.742), (-0.40, 0.935),
            (-0.16, 0.995), (-0.06, 1.0), (0.02, 0.985), (0.10, 0.95), (0.38, 0.72), (0.45, 0.695),
            (0.78, 0.635), (0.93, 0.58), (1.0, 0.515),
        ),
        belt=((-1.0, 0.60), (-0.7, 0.655), (0.1, 0.62), (0.4, 0.60), (0.8, 0.55), (1.0, 0.465)),
        width=_ROUND, rear_window=(-0.80, -0.38), windscreen=(0.08, 0.38),
        side_glass=(-0.60, 0.30), pillars=(-0.24,), tumblehome=0.26,
        leans=((-0.74, 0.0), (-0.60, 0.06), (-0.40, 0.0)),
        head_lamp=(0.56, 1.24, 0.41, 0.485), tail_lamp=(0.42, 1.16, 0.505, 0.59),
        grille=(0.335, 0.475, 0.48), bars=Bars.MESH, intake=(0.15, 0.265, 0.78), clearance=0.10,
        bumper=True,
    ),
    Build.SUV: _SUV,
    Build.OFFROAD: replace(
        _SUV,
        top=(
            (-1.0, 0.93), (-0.99, 0.97), (-0.95, 0.99), (-0.5, 1.0), (0.10, 0.99),
            (0.17, 0.965), (0.30, 0.70), (0.36, 0.675), (0.80, 0.655), (0.97, 0.64), (1.0, 0.61),
        ),
        belt=((-1.0, 0.61), (0.3, 0.61), (0.6, 0.61), (0.95, 0.60), (1.0, 0.57)),
        width=((-1.0, 0.97), (-0.96, 1.0), (0.28, 1.0), (0.36, 0.97), (0.60, 0.88), (1.0, 0.80)),
        rear_window=(-1.2, -1.1), windscreen=(0.14, 0.31), side_glass=(-0.93, 0.26),
        pillars=(-0.40, -0.06), leans=(), quarter=0.0, roof=Material.PLASTIC_DARK,
        tumblehome=0.12, nose_round=0.03, tail_round=0.04, nose_lean=0.01, tail_lean=0.01,
        cladding=0.0, clearance=0.24, head_lamp=(0.58, 0.88, 0.487, 0.583), lamps=Lamps.ROUND,
        tail_lamp=(0.80, 0.97, 0.43, 0.56), grille=(0.435, 0.60, 0.50), bars=Bars.SLOTS,
        rear_glass=(0.66, 0.90, 0.78), tinted=False, rails=False, spare=True, bumper=False,
    ),
    Build.BUBBLE: replace(
        _HATCH,
        top=(
            (-1.0, 0.66), (-0.9, 0.80), (-0.6, 0.95), (-0.1, 1.0), (0.25, 0.965), (0.38, 0.92),
            (0.82, 0.58), (0.90, 0.52), (1.0, 0.40),
        ),
        belt=((-1.0, 0.55), (-0.4, 0.58), (0.5, 0.54), (0.85, 0.46), (1.0, 0.36)),
        rear_window=(-0.93, -0.66), windscreen=(0.34, 0.84), side_glass=(-0.66, 0.62), tinted=False,
        pillars=(-0.2,), head_lamp=(0.62, 0.9, 0.34, 0.42), lamps=Lamps.ROUND, grille=None,
        intake=(0.165, 0.20, 0.6), tail_lamp=(0.66, 1.1, 0.44, 0.54), bumper=False,
    ),
    Build.VAN: BodyShape(
        top=(
            (-1.0, 0.93), (-0.985, 0.965), (-0.94, 0.985), (-0.3, 1.0), (0.40, 0.99),
            (0.50, 0.965), (0.545, 0.94), (0.80, 0.56), (0.85, 0.535), (0.95, 0.485), (1.0, 0.415),
        ),
        belt=((-1.0, 0.50), (0.4, 0.50), (0.8, 0.485), (0.9, 0.455), (1.0, 0.38)),
        width=_SQUARE, rear_window=(-1.2, -1.1), windscreen=(0.53, 0.81),
        side_glass=(0.20, 0.74), pillars=(), clearance=0.09, tumblehome=0.12, nose_round=0.20,
        tail_round=0.05, nose_lean=0.05, tail_lean=0.01, head_lamp=(0.58, 1.12, 0.285, 0.375),
        tail_lamp=(0.84, 1.03, 0.26, 0.50), tails=Tails.UPRIGHT, grille=(0.27, 0.355, 0.52),
        intake=(0.13, 0.20, 0.72), cladding=0.16, boot=False,
        rear_glass=(0.56, 0.82, 0.74), screen_foot=0.88,
    ),
    Build.CAMPER: BodyShape(
        top=(
            (-1.0, 0.88), (-0.985, 0.915), (-0.94, 0.955), (-0.80, 0.99), (-0.2, 1.0), (0.60, 0.99),
            (0.74, 0.965), (0.80, 0.93), (0.955, 0.62), (0.97, 0.57), (0.99, 0.49), (1.0, 0.40),
        ),
        belt=((-1.0, 0.56), (0.7, 0.56), (0.9, 0.55), (0.97, 0.50), (1.0, 0.36)),
        width=_SQUARE, rear_window=(-1.2, -1.1), rear_glass=(0.59, 0.82, 0.68),
        windscreen=(0.79, 0.957), side_glass=(-0.86, 0.86), pillars=(-0.42, 0.05, 0.46),
        clearance=0.13, tumblehome=0.12,
        nose_round=0.20, tail_round=0.14, nose_lean=0.03, tail_lean=0.03,
        head_lamp=(0.60, 0.84, 0.32, 0.415), lamps=Lamps.ROUND, grille=None,
        tail_lamp=(0.78, 1.02, 0.34, 0.48), tails=Tails.UPRIGHT, intake=(0.17, 0.195, 0.8),
        boot=False, screen_foot=0.90,
    ),
    Build.PICKUP: BodyShape(
        top=_straight((-1.0, 0.70), (-0.99, 0.715), (-0.02, 0.99), (0.02, 1.0), (0.06, 0.985),
                      (0.99, 0.57), (1.0, 0.54)),
        belt=_straight((-1.0, 0.63), (0.55, 0.60), (1.0, 0.52)),
        width=_straight((-1.0, 0.93), (-0.6, 1.0), (0.70, 1.0), (1.0, 0.90)),
        rear_window=(-0.34, -0.05), windscreen=(0.06, 0.62), side_glass=(-0.34, 0.50),
        pillars=(0.02,), clearance=0.17, tumblehome=0.34, nose_round=0.10, tail_round=0.02,
        nose_lean=0.0, tail_lean=0.0, cladding=0.27, head_lamp=(0.0, 1.0, 0.495, 0.512),
        tail_lamp=(0.0, 1.0, 0.595, 0.615), lamps=Lamps.STRIP, tails=Tails.STRIP, grille=None,
        intake=(0.21, 0.33, 0.90), boot=False, mirrors=False, faceted=True,
    ),
    Build.BUS: BodyShape(
        top=(
            (-1.0, 0.92), (-0.99, 0.955), (-0.96, 0.985), (-0.3, 1.0), (0.80, 1.0), (0.90, 0.985),
            (0.94, 0.96), (0.985, 0.60), (0.99, 0.52), (1.0, 0.36),
        ),
        belt=((-1.0, 0.46), (0.9, 0.46), (0.985, 0.44), (1.0, 0.30)),
        width=_SQUARE, rear_window=(-1.2, -1.1), windscreen=(0.935, 0.987),
        side_glass=(-0.94, 0.93), pillars=(-0.62, -0.30, 0.02, 0.34, 0.66), clearance=0.10,
        tumblehome=0.05, nose_round=0.28, tail_round=0.12, nose_lean=0.02, tail_lean=0.02,
        head_lamp=(0.62, 1.06, 0.20, 0.265), lamps=Lamps.SQUARE, grille=None,
        tail_lamp=(0.84, 0.98, 0.22, 0.40), tails=Tails.UPRIGHT, boot=False,
        intake=(0.13, 0.175, 0.75), mirrors=False, rear_glass=(0.50, 0.82, 0.76),
        screen_foot=0.93, tall_mirrors=True,
    ),
}
# fmt: on
SHAPES[Build.AMBULANCE] = SHAPES[Build.VAN]

_LEON = _moved(_HATCH, (0.18, 0.10), (0.52, 0.47))
_CHARGER = _moved(_SEDAN, (0.20, 0.10), (0.50, 0.40))
_LIMOUSINE = _moved(
    _SEDAN, (-0.69, -0.58), (-0.52, -0.44), (-0.34, -0.28), (0.20, 0.13), (0.50, 0.39)
)
_MINI = replace(
    _moved(_HATCH, (-0.62, -0.72), (0.18, 0.18), (0.52, 0.42)),
    width=_SQUARE,
    tumblehome=0.20,
    roof=Material.PAINT_BLACK,
    leans=((-0.96, 0.0), (-0.76, 0.04), (-0.5, 0.0)),
    pillars=(-0.16,),
    side_glass=(-0.76, 0.35),
    lamps=Lamps.ROUND,
    head_lamp=(0.62, 0.90, 0.42, 0.535),
    grille=(0.37, 0.47, 0.44),
    tail_lamp=(0.74, 1.06, 0.44, 0.60),
    tails=Tails.UPRIGHT,
)
# Outlines of models whose windscreen or tail stands elsewhere than their build's: where the foot
# and the top of the screen and the lower end of the rear window are, as far as we know the cars.
_OUTLINES: dict[str, BodyShape] = {
    "audi.etron": replace(
        _moved(_SUV, (0.18, 0.15), (0.42, 0.48)),
        top=(
            (-1.0, 0.63), (-0.985, 0.68), (-0.94, 0.79), (-0.87, 0.90), (-0.80, 0.945),
            (-0.62, 0.975), (-0.25, 1.0), (0.03, 0.99), (0.15, 0.95), (0.48, 0.68), (0.54, 0.66),
            (0.80, 0.64), (0.93, 0.61), (0.98, 0.58), (1.0, 0.54),
        ),
        belt=((-1.0, 0.60), (-0.6, 0.635), (0.3, 0.60), (0.5, 0.585), (0.8, 0.565), (1.0, 0.50)),
        rear_window=(-0.965, -0.82), side_glass=(-0.78, 0.41), pillars=(-0.50, -0.05),
        leans=((-0.95, 0.0), (-0.78, 0.10), (-0.50, 0.04), (-0.3, 0.0)),
        quarter=0.0, tumblehome=0.22,
    ),
    "bmw.grandtourer": _moved(_HATCH, (-0.62, -0.74), (-0.40, -0.50), (0.52, 0.50)),
    "chevrolet.impala": _LIMOUSINE,
    "citroen.c3": replace(_moved(_HATCH, (0.18, 0.15), (0.52, 0.50)), tinted=False),
    "dodge.charger_2020": _CHARGER,
    "dodge.charger_police": _CHARGER,
    "dodge.charger_police_2020": _CHARGER,
    "ford.crown": _LIMOUSINE,
    "ford.mustang": _moved(SHAPES[Build.COUPE], (0.08, 0.02), (0.38, 0.32)),
    "lincoln.mkz_2017": _moved(_SEDAN, (-0.69, -0.74), (0.20, 0.14), (0.50, 0.45)),
    "lincoln.mkz_2020": _moved(_SEDAN, (-0.69, -0.74), (0.20, 0.14), (0.50, 0.45)),
    "mini.cooper_s": _MINI,
    "mini.cooper_s_2021": _MINI,
    "nissan.micra": replace(_moved(_HATCH, (0.52, 0.50)), tinted=False),
    "nissan.patrol": replace(
        _SUV,
        top=(
            (-1.0, 0.91), (-0.99, 0.95), (-0.96, 0.98), (-0.6, 1.0), (0.10, 0.995), (0.22, 0.965),
            (0.40, 0.70), (0.45, 0.68), (0.80, 0.66), (0.95, 0.64), (0.985, 0.615), (1.0, 0.57),
        ),
        belt=((-1.0, 0.61), (0.3, 0.61), (0.5, 0.60), (0.8, 0.59), (0.95, 0.58), (1.0, 0.52)),
        width=_SQUARE, rear_window=(-1.2, -1.1), rear_glass=(0.64, 0.88, 0.76),
        windscreen=(0.21, 0.41), side_glass=(-0.92, 0.34), pillars=(-0.54, -0.06), leans=(),
        pillar=Material.PAINT, tumblehome=0.13, nose_round=0.10, tail_round=0.06, nose_lean=0.02,
        tail_lean=0.01, head_lamp=(0.55, 0.97, 0.45, 0.55), lamps=Lamps.SQUARE,
        tail_lamp=(0.82, 0.98, 0.42, 0.58), grille=(0.45, 0.555, 0.48), spare=True,
        bumper=False,
    ),
    "seat.leon": _LEON,
    "tesla.model3": _moved(_SEDAN, (-0.69, -0.78), (-0.34, -0.42), (0.20, 0.12)),
    "toyota.prius": _moved(_SEDAN, (-0.69, -0.86), (-0.34, -0.40), (0.20, 0.10), (0.50, 0.53)),
}  # fmt: skip

# What tells a model from others of its build.
_OWN: dict[str, dict[str, Any]] = {
    "audi.a2": {"grille": (0.365, 0.46, 0.40), "bars": Bars.ACROSS, "tinted": False},
    "audi.etron": {
        "grille": (0.325, 0.545, 0.42),
        "head_lamp": (0.52, 1.18, 0.455, 0.525),
        "tail_lamp": (0.0, 1.0, 0.57, 0.61),
        "bars": Bars.MESH,
        "tails": Tails.STRIP,
    },
    "audi.tt": {"grille": (0.29, 0.475, 0.42)},
    "bmw.grandtourer": {"grille": (0.37, 0.48, 0.30), "bars": Bars.UPRIGHT},
    "dodge.charger_2020": {
        "grille": (0.38, 0.495, 0.48),
        "bars": Bars.MESH,
        "tails": Tails.STRIP,
        "tail_lamp": (0.0, 1.0, 0.52, 0.565),
    },
    "dodge.charger_police_2020": {"grille": (0.38, 0.495, 0.48), "bars": Bars.MESH},
    "ford.crown": {"grille": (0.37, 0.495, 0.34), "bars": Bars.UPRIGHT},
    "ford.mustang": {
        "lamps": Lamps.ROUND,
        "head_lamp": (0.70, 0.94, 0.385, 0.505),
        "grille": (0.36, 0.50, 0.64),
        "tails": Tails.UPRIGHT,
        "tail_lamp": (0.62, 0.96, 0.48, 0.61),
    },
    "lincoln.mkz_2020": {"tails": Tails.STRIP, "tail_lamp": (0.0, 1.0, 0.53, 0.57)},
    "nissan.patrol_2021": {
        "bars": Bars.VEE,
        "tumblehome": 0.24,
        "tail_lamp": (0.56, 1.16, 0.475, 0.59),
        "tails": Tails.SWEPT,
    },
    "nissan.micra": {"grille": (0.39, 0.455, 0.36), "bars": Bars.ACROSS},
    "tesla.model3": {"grille": None, "intake": (0.15, 0.25, 0.66)},
    "toyota.prius": {"grille": (0.43, 0.475, 0.36), "intake": (0.16, 0.32, 0.62)},
}


def shape_of(type_id: str) -> BodyShape:
    """The body's outline of a blueprint that has one."""
    name = type_id.removeprefix("vehicle.")
    outline = _OUTLINES.get(name) or SHAPES[build_of(type_id)]
    return replace(outline, **_OWN.get(name, {}))


@dataclass(frozen=True, slots=True)
class MakersSize:
    """Measures of the car that a blueprint is named after, in metres, as its maker gives them.

    Attributes:
        length: over its bumpers.
        width: without mirrors.
        tyre_radius: of a usual tyre.
    """

    length: float
    width: float
    tyre_radius: float


# fmt: off
_MAKERS_SIZES: dict[str, MakersSize] = {
    "audi.a2": MakersSize(3.826, 1.673, 0.296),
    "audi.etron": MakersSize(4.901, 1.935, 0.381),
    "audi.tt": MakersSize(4.178, 1.842, 0.327),
    "bmw.grandtourer": MakersSize(4.556, 1.800, 0.326),
    "chevrolet.impala": MakersSize(5.415, 2.029, 0.339),
    "citroen.c3": MakersSize(3.996, 1.749, 0.317),
    "dodge.charger_2020": MakersSize(5.040, 1.905, 0.364),
    "dodge.charger_police": MakersSize(5.040, 1.905, 0.364),
    "dodge.charger_police_2020": MakersSize(5.040, 1.905, 0.364),
    "ford.crown": MakersSize(5.385, 1.986, 0.345),
    "ford.mustang": MakersSize(4.760, 1.826, 0.330),
    "jeep.wrangler_rubicon": MakersSize(3.881, 1.872, 0.407),
    "lincoln.mkz_2017": MakersSize(4.925, 1.864, 0.339),
    "lincoln.mkz_2020": MakersSize(4.925, 1.864, 0.339),
    "mercedes.coupe": MakersSize(5.027, 1.899, 0.351),
    "mercedes.coupe_2020": MakersSize(4.686, 1.810, 0.328),
    "mercedes.sprinter": MakersSize(5.910, 1.993, 0.356),
    "mini.cooper_s": MakersSize(3.714, 1.683, 0.304),
    "mini.cooper_s_2021": MakersSize(3.850, 1.727, 0.311),
    "nissan.micra": MakersSize(3.719, 1.660, 0.296),
    "nissan.patrol": MakersSize(4.440, 1.930, 0.389),
    "nissan.patrol_2021": MakersSize(5.315, 1.995, 0.419),
    "seat.leon": MakersSize(4.184, 1.742, 0.317),
    "tesla.model3": MakersSize(4.694, 1.849, 0.334),
    "toyota.prius": MakersSize(4.460, 1.745, 0.317),
    "volkswagen.t2": MakersSize(4.505, 1.720, 0.325),
    "volkswagen.t2_2021": MakersSize(4.505, 1.720, 0.325),
}
# fmt: on
_MOST_SHARE = 0.97
"""Widest body, as a share of its box: mirrors are seen beside it."""


def makers_size(type_id: str, length_m: float, width_m: float) -> MakersSize | None:
    """The measures of a car, scaled as its maker's length is to its bounding box's.

    CARLA's boxes hold the mirrors of its older models and leave out those of its newer ones. A
    body that is a fixed share of the box is too narrow for its height in one of the two.

    Args:
        type_id: id of a blueprint.
        length_m, width_m: of its bounding box.

    Returns:
        None for what is not known. The width is at most 0.97 of the box's.
    """
    size = _MAKERS_SIZES.get(type_id.removeprefix("vehicle."))
    if size is None:
        return None
    scale = length_m / size.length
    width = min(size.width * scale, _MOST_SHARE * width_m)
    return MakersSize(length_m, width, size.tyre_radius * scale)


_BUILDS: dict[str, Build] = {
    "audi.a2": Build.HATCH,
    "audi.etron": Build.SUV,
    "audi.tt": Build.COUPE,
    "bmw.grandtourer": Build.HATCH,
    "citroen.c3": Build.HATCH,
    "ford.mustang": Build.COUPE,
    "jeep.wrangler_rubicon": Build.OFFROAD,
    "mercedes.coupe": Build.COUPE,
    "mercedes.coupe_2020": Build.COUPE,
    "micro.microlino": Build.BUBBLE,
    "mini.cooper_s": Build.HATCH,
    "mini.cooper_s_2021": Build.HATCH,
    "nissan.micra": Build.HATCH,
    "nissan.patrol": Build.SUV,
    "nissan.patrol_2021": Build.SUV,
    "seat.leon": Build.HATCH,
    "ford.ambulance": Build.AMBULANCE,
    "mercedes.sprinter": Build.VAN,
    "volkswagen.t2": Build.CAMPER,
    "volkswagen.t2_2021": Build.CAMPER,
    "carlamotors.carlacola": Build.DELIVERY,
    "carlamotors.european_hgv": Build.LORRY,
    "carlamotors.firetruck": Build.FIRE_ENGINE,
    "tesla.cybertruck": Build.PICKUP,
    "mitsubishi.fusorosa": Build.BUS,
    "harley-davidson.low_rider": Build.CRUISER,
    "kawasaki.ninja": Build.MOTORCYCLE,
    "vespa.zx125": Build.SCOOTER,
    "yamaha.yzf": Build.MOTORCYCLE,
    "bh.crossbike": Build.BICYCLE,
    "diamondback.century": Build.BICYCLE,
    "gazelle.omafiets": Build.CITY_BIKE,
}


def build_of(type_id: str) -> Build:
    """The build of a blueprint; sedan unless known otherwise."""
    return _BUILDS.get(type_id.removeprefix("vehicle."), Build.SEDAN)
