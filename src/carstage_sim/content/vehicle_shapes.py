"""Outlines of the vehicles' bodies, by build, and which blueprint has which build."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise
from typing import Any

from carstage_sim.content.car_body import Bars, BodyShape, Lamps, Tails


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


_SEDAN = BodyShape(
    top=(
        (-1.0, 0.67), (-0.93, 0.705), (-0.76, 0.735), (-0.70, 0.75), (-0.34, 0.955),
        (-0.05, 1.0), (0.12, 0.985), (0.22, 0.95), (0.50, 0.72), (0.56, 0.695),
        (0.78, 0.645), (0.93, 0.585), (1.0, 0.525),
    ),
    belt=((-1.0, 0.61), (-0.7, 0.665), (0.2, 0.625), (0.5, 0.60), (0.8, 0.545), (1.0, 0.475)),
    width=_ROUND, rear_window=(-0.69, -0.34), windscreen=(0.20, 0.50),
    side_glass=(-0.52, 0.41), pillars=(-0.06,),
    head_lamp=(0.52, 1.26, 0.385, 0.465), tail_lamp=(0.46, 1.22, 0.485, 0.59),
    grille=(0.335, 0.46, 0.42), intake=(0.165, 0.275, 0.72),
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
    head_lamp=(0.54, 1.24, 0.365, 0.45), tail_lamp=(0.60, 1.18, 0.45, 0.60),
    grille=(0.345, 0.435, 0.48), bars=Bars.MESH, intake=(0.165, 0.285, 0.66), tail_lean=0.04,
    boot=False, tinted=True,
)
_SUV = BodyShape(
    top=(
        (-1.0, 0.65), (-0.985, 0.70), (-0.95, 0.815), (-0.905, 0.92), (-0.86, 0.962),
        (-0.72, 0.985), (-0.3, 1.0), (0.12, 0.99),
        (0.22, 0.955), (0.44, 0.715), (0.50, 0.69), (0.78, 0.665), (0.92, 0.64), (0.975, 0.61),
        (1.0, 0.57),
    ),
    belt=((-1.0, 0.61), (-0.5, 0.62), (0.3, 0.60), (0.5, 0.60), (0.8, 0.585), (1.0, 0.53)),
    width=_ROUND, rear_window=(-0.98, -0.90), windscreen=(0.20, 0.45),
    side_glass=(-0.84, 0.37), pillars=(-0.48, -0.04),
    clearance=0.125, tumblehome=0.16, cladding=0.23, nose_round=0.17, nose_lean=0.05,
    tail_lean=0.03,
    head_lamp=(0.58, 1.14, 0.43, 0.505), tail_lamp=(0.68, 1.12, 0.42, 0.61), tails=Tails.UPRIGHT,
    grille=(0.35, 0.525, 0.52), intake=(0.205, 0.29, 0.66), boot=False,
    tinted=True, rails=True,
)

SHAPES: dict[Build, BodyShape] = {
    Build.SEDAN: _SEDAN,
    Build.HATCH: _HATCH,
    Build.COUPE: BodyShape(
        top=(
            (-1.0, 0.68), (-0.93, 0.72), (-0.84, 0.745), (-0.40, 0.935), (-0.12, 1.0),
            (0.04, 0.985), (0.12, 0.955), (0.40, 0.735), (0.47, 0.71), (0.78, 0.645),
            (0.93, 0.585), (1.0, 0.515),
        ),
        belt=((-1.0, 0.62), (-0.7, 0.68), (0.1, 0.645), (0.4, 0.62), (0.8, 0.56), (1.0, 0.465)),
        width=_ROUND, rear_window=(-0.78, -0.40), windscreen=(0.11, 0.40),
        side_glass=(-0.40, 0.31), pillars=(-0.22,),
        head_lamp=(0.56, 1.24, 0.385, 0.455), tail_lamp=(0.42, 1.16, 0.505, 0.59),
        grille=(0.29, 0.44, 0.52), bars=Bars.MESH, intake=(0.15, 0.255, 0.78), clearance=0.10,
    ),
    Build.SUV: _SUV,
    Build.OFFROAD: replace(
        _SUV,
        top=(
            (-1.0, 0.90), (-0.985, 0.95), (-0.95, 0.985), (-0.5, 1.0), (0.10, 0.99),
            (0.17, 0.965), (0.30, 0.72), (0.36, 0.69), (0.80, 0.665), (0.97, 0.63), (1.0, 0.56),
        ),
        belt=((-1.0, 0.63), (0.3, 0.63), (0.6, 0.62), (0.95, 0.59), (1.0, 0.53)),
        width=_SQUARE, rear_window=(-1.2, -1.1), windscreen=(0.14, 0.31), side_glass=(-0.93, 0.26),
        pillars=(-0.45, -0.08), tumblehome=0.09, nose_round=0.08, tail_round=0.06, nose_lean=0.02,
        tail_lean=0.01, cladding=0.26, head_lamp=(0.55, 0.83, 0.42, 0.53), lamps=Lamps.ROUND,
        tail_lamp=(0.80, 0.97, 0.44, 0.58), grille=(0.37, 0.555, 0.46), bars=Bars.UPRIGHT,
        intake=(0.22, 0.30, 0.85),
        rear_glass=(0.66, 0.90, 0.78), rails=False, spare=True,
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
        intake=(0.165, 0.20, 0.6), tail_lamp=(0.66, 1.1, 0.44, 0.54),
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
            (-1.0, 0.78), (-0.985, 0.85), (-0.94, 0.93), (-0.80, 0.985), (-0.2, 1.0), (0.60, 0.99),
            (0.74, 0.965), (0.80, 0.93), (0.955, 0.62), (0.97, 0.57), (0.99, 0.49), (1.0, 0.40),
        ),
        belt=((-1.0, 0.56), (0.7, 0.56), (0.9, 0.55), (0.97, 0.50), (1.0, 0.36)),
        width=_SQUARE, rear_window=(-0.99, -0.86), windscreen=(0.79, 0.957),
        side_glass=(-0.86, 0.86), pillars=(-0.42, 0.05, 0.46), clearance=0.13, tumblehome=0.12,
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

# What tells a model from others of its build.
_OWN: dict[str, dict[str, Any]] = {
    "audi.a2": {"grille": (0.335, 0.43, 0.40), "bars": Bars.ACROSS},
    "audi.etron": {
        "grille": (0.30, 0.50, 0.40),
        "bars": Bars.MESH,
        "tails": Tails.SWEPT,
    },
    "bmw.grandtourer": {"grille": (0.33, 0.44, 0.30), "bars": Bars.UPRIGHT},
    "dodge.charger_2020": {
        "grille": (0.33, 0.46, 0.62),
        "bars": Bars.MESH,
        "tails": Tails.STRIP,
        "tail_lamp": (0.0, 1.0, 0.52, 0.565),
    },
    "dodge.charger_police_2020": {"grille": (0.33, 0.46, 0.62), "bars": Bars.MESH},
    "ford.crown": {"grille": (0.33, 0.455, 0.34), "bars": Bars.UPRIGHT},
    "ford.mustang": {
        "grille": (0.31, 0.46, 0.60),
        "tails": Tails.UPRIGHT,
        "tail_lamp": (0.62, 0.96, 0.48, 0.61),
    },
    "lincoln.mkz_2020": {"tails": Tails.STRIP, "tail_lamp": (0.0, 1.0, 0.53, 0.57)},
    "mini.cooper_s": {"lamps": Lamps.ROUND, "head_lamp": (0.60, 0.86, 0.385, 0.49)},
    "mini.cooper_s_2021": {"lamps": Lamps.ROUND, "head_lamp": (0.60, 0.86, 0.385, 0.49)},
    "nissan.patrol": {"grille": (0.36, 0.505, 0.42), "spare": True},
    "nissan.patrol_2021": {"bars": Bars.VEE},
    "nissan.micra": {"grille": (0.36, 0.42, 0.36), "bars": Bars.ACROSS},
    "tesla.model3": {"grille": None, "intake": (0.15, 0.24, 0.66)},
    "toyota.prius": {"grille": (0.40, 0.445, 0.36), "intake": (0.16, 0.31, 0.62)},
}


def shape_of(type_id: str) -> BodyShape:
    """The body's outline of a blueprint that has one."""
    own = _OWN.get(type_id.removeprefix("vehicle."), {})
    return replace(SHAPES[build_of(type_id)], **own)


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
