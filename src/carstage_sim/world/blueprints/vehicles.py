"""The vehicles: CARLA's ids, types and bounding boxes, one row each.

Boxes are those that a CARLA server reports (half sizes, centre relative to the actor), but for the
bus. Axles of first-generation cars were measured on CARLA's models; the others follow the real
car's wheelbase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.state import ActorKind
from carstage_sim.world.vehicles.parameters import Vector3, VehicleParameters, Wheel
from carstage_sim.world.vehicles.powertrain import calibrated

_PAINTS: dict[str, tuple[str, ...]] = {
    "car": (
        "17,37,103",
        "137,0,0",
        "180,180,180",
        "20,20,22",
        "240,240,238",
        "64,84,92",
        "133,121,98",
        "38,74,58",
    ),
    "van": ("240,240,238", "40,62,110", "150,28,28", "92,98,102", "196,170,92"),
    "truck": ("232,232,228", "24,62,120", "158,34,30", "214,150,32"),
    "bus": ("214,190,60", "36,94,138", "226,226,222"),
    "motorcycle": ("22,22,24", "150,20,20", "24,60,140", "200,200,200"),
    "bicycle": ("22,22,24", "148,32,32", "40,92,150", "210,210,206"),
    "police": ("245,245,245", "18,18,20"),
    "fire": ("172,22,18",),
    "ambulance": ("245,245,245",),
    "taxi": ("228,180,30",),
}


@dataclass(frozen=True, slots=True)
class _Row:
    """A vehicle: id, base type, box centre (x, z), half sizes, axles (front x, rear x), mass."""

    name: str
    base_type: str
    center: tuple[float, float]
    extent: Vector3
    axles_m: tuple[float, float]
    mass_kg: float
    generation: int = 1
    special_type: str = ""
    doors: bool = False
    lights: bool = False
    paint: str = ""


_CAR, _VAN, _TRUCK, _BUS, _MOTO, _BIKE = "car", "van", "truck", "bus", "motorcycle", "bicycle"

# fmt: off
_ROWS: tuple[_Row, ...] = (
    _Row("audi.a2", _CAR, (0.0, 0.782), (1.853, 0.894, 0.775), (1.250, -1.256), 1045),
    _Row("audi.etron", _CAR, (-0.004, 0.821), (2.428, 1.016, 0.825), (1.514, -1.386), 2490,
         special_type="electric", lights=True),
    _Row("audi.tt", _CAR, (0.0, 0.693), (2.091, 0.997, 0.693), (1.247, -1.406), 1445, lights=True),
    _Row("bmw.grandtourer", _CAR, (0.0, 0.765), (2.306, 1.121, 0.834), (1.492, -1.443), 1510),
    _Row("chevrolet.impala", _CAR, (0.0, 0.701), (2.679, 1.017, 0.705), (1.652, -1.330), 1760),
    _Row("citroen.c3", _CAR, (0.0, 0.762), (1.994, 0.925, 0.809), (1.274, -1.410), 1090),
    _Row("dodge.charger_2020", _CAR, (-0.005, 0.766), (2.504, 0.941, 0.767), (1.532, -1.520), 1830,
         generation=2, doors=True, lights=True),
    _Row("dodge.charger_police", _CAR, (0.024, 0.793), (2.487, 1.019, 0.771), (1.484, -1.526), 1920,
         special_type="emergency", lights=True, paint="police"),
    _Row("dodge.charger_police_2020", _CAR, (0.109, 0.817), (2.619, 0.965, 0.819), (1.542, -1.510),
         1930, generation=2, special_type="emergency", doors=True, lights=True, paint="police"),
    _Row("ford.crown", _CAR, (0.185, 0.768), (2.683, 0.900, 0.787), (1.600, -1.312), 1880,
         generation=2, special_type="taxi", doors=True, lights=True, paint="taxi"),
    _Row("ford.mustang", _CAR, (0.032, 0.650), (2.359, 0.947, 0.650), (1.562, -1.324), 1360,
         lights=True),
    _Row("jeep.wrangler_rubicon", _CAR, (0.0, 0.932), (1.933, 0.953, 0.939), (1.291, -1.017), 1750),
    _Row("lincoln.mkz_2017", _CAR, (0.004, 0.719), (2.451, 1.064, 0.755), (1.478, -1.393), 1705,
         lights=True),
    _Row("lincoln.mkz_2020", _CAR, (-0.006, 0.749), (2.446, 0.918, 0.745), (1.430, -1.420), 1720,
         generation=2, doors=True, lights=True),
    _Row("mercedes.coupe", _CAR, (0.0, 0.667), (2.513, 1.076, 0.825), (1.768, -1.521), 1880),
    _Row("mercedes.coupe_2020", _CAR, (-0.003, 0.720), (2.337, 0.906, 0.721), (1.440, -1.400), 1700,
         generation=2, doors=True, lights=True),
    _Row("micro.microlino", _CAR, (0.0, 0.677), (1.104, 0.740, 0.688), (0.682, -0.860), 540,
         special_type="electric"),
    _Row("mini.cooper_s", _CAR, (0.0, 0.693), (1.903, 0.985, 0.738), (1.145, -1.367), 1265),
    _Row("mini.cooper_s_2021", _CAR, (-0.031, 0.891), (2.276, 1.049, 0.884), (1.405, -1.300), 1390,
         generation=2, doors=True, lights=True),
    _Row("nissan.micra", _CAR, (0.0, 0.781), (1.817, 0.923, 0.751), (1.174, -1.316), 1020),
    _Row("nissan.patrol", _CAR, (-0.057, 0.935), (2.302, 0.966, 0.927), (1.419, -1.344), 2350),
    _Row("nissan.patrol_2021", _CAR, (0.028, 1.017), (2.783, 1.075, 1.023), (1.650, -1.535), 2800,
         generation=2, doors=True, lights=True),
    _Row("seat.leon", _CAR, (0.0, 0.740), (2.096, 0.908, 0.737), (1.316, -1.420), 1310),
    _Row("tesla.model3", _CAR, (0.029, 0.736), (2.396, 1.082, 0.744), (1.584, -1.415), 1845,
         special_type="electric", lights=True),
    _Row("toyota.prius", _CAR, (0.002, 0.724), (2.257, 1.003, 0.762), (1.420, -1.400), 1380),

    _Row("ford.ambulance", _VAN, (-0.289, 1.216), (3.183, 1.176, 1.216), (1.710, -1.940), 3200,
         generation=2, special_type="emergency", doors=True, lights=True, paint="ambulance"),
    _Row("mercedes.sprinter", _VAN, (-0.011, 1.288), (2.958, 0.994, 1.280), (1.830, -1.835), 2200,
         generation=2, doors=True, lights=True),
    _Row("volkswagen.t2", _VAN, (0.001, 1.014), (2.240, 1.035, 1.019), (1.167, -1.277), 1320,
         lights=True),
    _Row("volkswagen.t2_2021", _VAN, (0.117, 0.991), (2.221, 0.887, 0.994), (1.260, -1.140), 1400,
         generation=2, doors=True, lights=True),

    _Row("carlamotors.carlacola", _TRUCK, (0.0, 1.234), (2.602, 1.313, 1.234), (1.459, -1.206),
         5500),
    _Row("carlamotors.european_hgv", _TRUCK, (0.013, 1.731), (3.968, 1.446, 1.731), (2.560, -1.300),
         9800, generation=2, lights=True),
    _Row("carlamotors.firetruck", _TRUCK, (-0.253, 1.913), (4.234, 1.446, 1.914), (2.560, -1.900),
         12500, generation=2, special_type="emergency", lights=True, paint="fire"),
    _Row("tesla.cybertruck", _TRUCK, (0.0, 1.049), (3.137, 1.195, 1.049), (1.900, -1.900), 3000,
         special_type="electric", lights=True),

    # CARLA's model is 3.9 m wide and 4.3 m high: it cannot pass anybody in lanes of 3.5 m, and
    # stops the traffic around it. This one has the width and height of a real bus of its length.
    _Row("mitsubishi.fusorosa", _BUS, (-0.445, 1.630), (5.136, 1.275, 1.620), (2.700, -2.600), 7500,
         generation=2, lights=True),

    _Row("harley-davidson.low_rider", _MOTO, (0.0, 0.825), (1.175, 0.383, 0.825), (0.840, -0.780),
         370, lights=True),
    _Row("kawasaki.ninja", _MOTO, (0.0, 0.769), (1.022, 0.398, 0.762), (0.720, -0.680), 270,
         lights=True),
    _Row("vespa.zx125", _MOTO, (0.01, 0.795), (0.909, 0.433, 0.795), (0.650, -0.630), 190,
         lights=True),
    _Row("yamaha.yzf", _MOTO, (0.0, 0.775), (1.095, 0.433, 0.765), (0.720, -0.690), 270,
         lights=True),

    _Row("bh.crossbike", _BIKE, (0.0, 0.808), (0.755, 0.433, 0.806), (0.520, -0.530), 90),
    _Row("diamondback.century", _BIKE, (0.0, 0.816), (0.828, 0.291, 0.810), (0.510, -0.490), 88),
    _Row("gazelle.omafiets", _BIKE, (-0.01, 0.895), (0.922, 0.330, 0.888), (0.570, -0.560), 95),
)
# fmt: on

_TAGS: dict[str, tuple[int, ...]] = {
    _CAR: (CityObjectLabel.CAR,),
    _VAN: (CityObjectLabel.CAR,),
    _TRUCK: (CityObjectLabel.TRUCK,),
    _BUS: (CityObjectLabel.BUS,),
    _MOTO: (CityObjectLabel.MOTORCYCLE, CityObjectLabel.RIDER),
    _BIKE: (CityObjectLabel.BICYCLE, CityObjectLabel.RIDER),
}
_WHEEL_RADIUS_M = {_CAR: 0.34, _VAN: 0.36, _TRUCK: 0.50, _BUS: 0.48, _MOTO: 0.31, _BIKE: 0.34}
_MAX_STEER_DEG = 70.0
_DRIVER_IDS = tuple(str(number) for number in range(1, 51))


def _wheels(row: _Row, track_m: float) -> tuple[Wheel, ...]:
    radius = _WHEEL_RADIUS_M[row.base_type]
    front, rear = row.axles_m
    sides = (-track_m / 2.0, track_m / 2.0)
    return tuple(
        Wheel(
            position_m=(x, y, radius),
            radius_m=radius,
            max_steer_angle_deg=_MAX_STEER_DEG if x == front else 0.0,
            max_handbrake_torque=0.0 if x == front else 3000.0,
        )
        for x in (front, rear)
        for y in sides
    )


def _parameters(row: _Row) -> VehicleParameters:
    track_m = 0.0 if row.base_type in (_MOTO, _BIKE) else 1.56 * row.extent[1]
    front, rear = row.axles_m
    base = VehicleParameters(
        wheels=_wheels(row, track_m),
        front_axle_x_m=front,
        rear_axle_x_m=rear,
        track_m=track_m,
        mass_kg=row.mass_kg,
        box_center_x_m=row.center[0],
        half_length_m=row.extent[0],
        half_width_m=row.extent[1],
        height_m=row.center[1] + row.extent[2],
    )
    if row.base_type == _TRUCK and row.name != "tesla.cybertruck":
        base = replace(base, max_acceleration=3.0, power_per_mass=30.0, max_deceleration=8.0)
    elif row.base_type == _BUS:
        base = replace(base, max_acceleration=2.8, power_per_mass=25.0, max_deceleration=8.0)
    elif row.base_type == _BIKE:
        base = replace(base, max_acceleration=2.5, power_per_mass=14.0, max_reverse_speed=1.5)
    return calibrated(base)


def _attributes(row: _Row) -> tuple[Attribute, ...]:
    text, flag = AttributeType.STRING, AttributeType.BOOL
    type_id = f"vehicle.{row.name}"
    roles = ("autopilot", "scenario", "ego_vehicle")
    wheels = "2" if row.base_type in (_MOTO, _BIKE) else "4"
    paints = _PAINTS[row.paint or row.base_type]
    attributes = [
        Attribute("role_name", text, roles[0], roles),
        Attribute("sticky_control", flag, "true", ("true",)),
        Attribute("terramechanics", flag, "false", ("false",)),
        Attribute("ros_name", text, type_id, (type_id,)),
        Attribute("object_type", text, "", modifiable=False),
        Attribute("base_type", text, row.base_type, modifiable=False),
        Attribute("special_type", text, row.special_type, modifiable=False),
        Attribute("number_of_wheels", AttributeType.INT, wheels, modifiable=False),
        Attribute("generation", AttributeType.INT, str(row.generation), modifiable=False),
        Attribute("has_dynamic_doors", flag, str(row.doors).lower(), modifiable=False),
        Attribute("has_lights", flag, str(row.lights).lower(), modifiable=False),
    ]
    if row.name != "tesla.cybertruck":  # bare steel: CARLA offers no paint for it
        attributes.append(Attribute("color", AttributeType.COLOR, paints[0], paints))
    if row.base_type in (_MOTO, _BIKE):
        attributes.append(
            Attribute("driver_id", AttributeType.INT, _DRIVER_IDS[0], _DRIVER_IDS, restrict=True)
        )
    return tuple(attributes)


def vehicle_blueprints() -> list[Blueprint]:
    """All vehicles, not yet numbered; their origin is on the ground near the box's centre."""
    return [
        Blueprint(
            uid=0,
            id=f"vehicle.{row.name}",
            tags=f"vehicle,{row.name.replace('.', ',')}",
            attributes=_attributes(row),
            kind=ActorKind.VEHICLE,
            box_center=(row.center[0], 0.0, row.center[1]),
            box_extent=row.extent,
            semantic_tags=_TAGS[row.base_type],
            vehicle=_parameters(row),
        )
        for row in _ROWS
    ]
