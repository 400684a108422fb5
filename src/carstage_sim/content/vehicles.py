"""Procedural vehicles, scaled to their blueprint's bounding box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from carstage_sim.content.cabins import Cabin, add_cabin
from carstage_sim.content.car_body import BodyFrame, CarBody, Lamps
from carstage_sim.content.car_faces import add_front, add_rear
from carstage_sim.content.lettering import plate_number
from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.content.two_wheelers import add_two_wheeler
from carstage_sim.content.vehicle_shapes import SHAPES, Build, build_of, shape_of
from carstage_sim.content.wheels import add_wheel
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh

Vector = tuple[float, float, float]

_TAGS = {
    Build.PICKUP: CityObjectLabel.TRUCK,
    Build.LORRY: CityObjectLabel.TRUCK,
    Build.FIRE_ENGINE: CityObjectLabel.TRUCK,
    Build.DELIVERY: CityObjectLabel.TRUCK,
    Build.BUS: CityObjectLabel.BUS,
    Build.MOTORCYCLE: CityObjectLabel.MOTORCYCLE,
    Build.SCOOTER: CityObjectLabel.MOTORCYCLE,
    Build.BICYCLE: CityObjectLabel.BICYCLE,
}
_TWO_WHEELERS = (Build.MOTORCYCLE, Build.SCOOTER, Build.BICYCLE)
_CABINS = {
    Build.COUPE: Cabin(rows=1),
    Build.VAN: Cabin(rows=0),
    Build.BUBBLE: Cabin(rows=0),
    Build.CAMPER: Cabin(rows=2),
    Build.BUS: Cabin(rows=11, passengers=5),
}
_HEAVY = (Build.LORRY, Build.FIRE_ENGINE, Build.DELIVERY, Build.BUS)


@dataclass(frozen=True, slots=True)
class VehicleFrame:
    """A vehicle's measures in its own frame (metres).

    Attributes:
        low, high: corners of the box; nothing is below the ground or outside.
        axles: x of the front and the rear axle.
        wheel_radius: of the tyres.
        type_id: id of its blueprint.
        occupied: whether somebody sits in it.
    """

    low: Vector
    high: Vector
    axles: tuple[float, float]
    wheel_radius: float
    type_id: str
    occupied: bool

    @property
    def plate(self) -> str:
        """What its number plates say."""
        return plate_number(self.type_id)

    @property
    def half_width(self) -> float:
        """Half the width."""
        return (self.high[1] - self.low[1]) / 2

    def body(self, share: float, rear: float, front: float, height: float) -> BodyFrame:
        """A body from ``rear`` to ``front`` (x), ``share`` as wide as the box."""
        half = self.half_width
        return BodyFrame(
            center_x=(rear + front) / 2,
            half_length=(front - rear) / 2,
            half_width=half * share,
            reach=half,
            height=height,
            axles=tuple(a for a in self.axles if rear < a < front),
            wheel_radius=self.wheel_radius,
            tyre_width=0.235 if self.wheel_radius < 0.42 else 0.30,
        )


def vehicle_mesh(
    type_id: str,
    extent: Vector,
    box_center: Vector,
    *,
    axles_m: tuple[float, float] | None = None,
    wheel_radius_m: float | None = None,
    occupied: bool = True,
) -> TriangleMesh:
    """A vehicle in its actor's frame: x forward, y right, origin on the ground.

    Args:
        type_id: blueprint id; an unknown one becomes a sedan.
        extent: half sizes of the bounding box, metres.
        box_center: centre of the bounding box, metres.
        axles_m: x of the front and rear axle; default by the length.
        wheel_radius_m: default by the kind of vehicle.
        occupied: whether a car has a driver; riders are part of their machine.

    Returns:
        A mesh of which every vertex lies in the box, wheels on the ground.
    """
    build = build_of(type_id)
    builder = ShapeBuilder(_TAGS.get(build, CityObjectLabel.CAR))
    hx, hy, hz = extent
    cx, cy, cz = box_center
    high = (cx + hx, cy + hy, cz + hz)
    low = (cx - hx, cy - hy, max(cz - hz, 0.0))
    usual = 0.5 if build in _HEAVY else min(0.36, 0.24 * high[2])
    frame = VehicleFrame(
        low,
        high,
        axles_m if axles_m is not None else (cx + 0.62 * hx, cx - 0.60 * hx),
        wheel_radius_m if wheel_radius_m is not None else usual,
        type_id,
        occupied,
    )
    if build in _TWO_WHEELERS:
        add_two_wheeler(builder, build, low, high, frame.axles, frame.wheel_radius)
    else:
        _BODIES.get(build, _add_car)(builder, build, frame)
    mesh = builder.mesh()
    vertices = np.clip(mesh.vertices, np.array(low), np.array(high))
    return build_mesh(vertices, mesh.triangles, mesh.material, mesh.tag, normals=mesh.normals)


def _add_wheels(builder: ShapeBuilder, frame: VehicleFrame, body: BodyFrame, spokes: int) -> None:
    for axle in frame.axles:
        for sign in (-1.0, 1.0):
            y = sign * (body.half_width * 0.975 - body.tyre_width / 2)
            center = (axle, y, frame.wheel_radius)
            add_wheel(
                builder, center, frame.wheel_radius, body.tyre_width, outward=sign, spokes=spokes
            )


def _add_car(builder: ShapeBuilder, build: Build, frame: VehicleFrame) -> None:
    """Cars, vans and buses: one body with its wheels."""
    shape = shape_of(frame.type_id)
    if build is Build.BUBBLE:
        frame = replace(frame, wheel_radius=min(frame.wheel_radius, 0.27))
    share = 0.885 if shape.mirrors else 0.98
    body = frame.body(share, frame.low[0], frame.high[0], frame.high[2])
    car = CarBody(shape, body)
    car.add_to(builder)
    add_front(builder, car, frame.plate)
    add_rear(builder, car, frame.plate)
    add_cabin(builder, car, replace(_CABINS.get(build, Cabin()), occupied=frame.occupied))
    _add_wheels(builder, frame, body, 5)


def _add_ambulance(builder: ShapeBuilder, build: Build, frame: VehicleFrame) -> None:
    """A van's cab before a box that is as wide and high as the bounding box."""
    half, top = frame.half_width, frame.high[2]
    shape = replace(SHAPES[Build.VAN], side_glass=(0.36, 0.74), rear_glass=None)
    body = frame.body(0.80, frame.low[0], frame.high[0], top * 0.90)
    car = CarBody(shape, body)
    car.add_to(builder)
    add_front(builder, car, frame.plate)
    add_cabin(builder, car, Cabin(rows=0, occupied=frame.occupied))
    front = frame.low[0] + 0.62 * (frame.high[0] - frame.low[0])
    wide = half * 0.94
    rear = frame.low[0] + 0.01
    builder.box((rear, -wide, 0.42 * top), (front, wide, top * 0.965), Material.PAINT)
    stripe = (0.50 * top, 0.56 * top)
    for sign in (-1.0, 1.0):
        y = sorted((sign * wide, sign * (wide + 0.006)))
        builder.box((rear, y[0], stripe[0]), (front, y[1], stripe[1]), Material.SIGN_RED)
        builder.box(
            (front - 1.0, y[0], 0.66 * top), (front - 0.3, y[1], 0.84 * top), Material.GLASS
        )
        light = sorted((sign * 0.25 * wide, sign * 0.75 * wide))
        builder.box(
            (front - 0.35, light[0], top * 0.965),
            (front - 0.1, light[1], top),
            Material.BEACON_BLUE,
        )
    _add_rear_lamps(builder, rear, wide, 0.44 * top)
    _add_wheels(builder, frame, body, 6)


def _add_rear_lamps(builder: ShapeBuilder, x: float, wide: float, z: float) -> None:
    """Lamps, reflectors and plate on a flat rear end."""
    builder.box((x - 0.008, -0.26, z), (x, 0.26, z + 0.12), Material.LICENCE_PLATE)
    for sign, blinker in ((-1.0, Material.BLINKER_LEFT), (1.0, Material.BLINKER_RIGHT)):
        for y0, y1, material in (
            (0.70, 0.82, Material.REVERSE_LAMP),
            (0.82, 0.92, Material.TAIL_LAMP),
            (0.92, 0.99, blinker),
        ):
            y = sorted((sign * y0 * wide, sign * y1 * wide))
            builder.box((x - 0.008, y[0], z), (x, y[1], z + 0.16), material)


def _add_truck(builder: ShapeBuilder, build: Build, frame: VehicleFrame) -> None:
    """Lorries: a cab over the front axle, a chassis, and what they carry."""
    half, top = frame.half_width, frame.high[2]
    length = frame.high[0] - frame.low[0]
    wide = half * (0.97 if build is Build.DELIVERY else 0.90)
    cab_rear = frame.high[0] - (0.30 if build is not Build.FIRE_ENGINE else 0.36) * length
    shape = replace(
        SHAPES[Build.CAMPER],
        rear_window=(-1.2, -1.1),
        side_glass=(-0.55, 0.72),
        pillars=() if build is not Build.FIRE_ENGINE else (0.0,),
        clearance=0.14,
        tail_round=0.02,
        mirrors=build is not Build.DELIVERY,
        head_lamp=(0.62, 1.08, 0.19, 0.26),
        lamps=Lamps.SQUARE,
        grille=(0.29, 0.44, 0.72),
        intake=(0.155, 0.185, 0.6),
        tumblehome=0.08,
        tail_lamp=(0.0, 0.01, 0.3, 0.31),
        top=(
            (-1.0, 0.96), (-0.9, 0.985), (-0.2, 1.0), (0.40, 0.99), (0.62, 0.96), (0.90, 0.62),
            (0.93, 0.57), (0.99, 0.49), (1.0, 0.40),
        ),
        windscreen=(0.61, 0.905),
        belt=((-1.0, 0.54), (0.85, 0.54), (0.95, 0.50), (1.0, 0.36)),
    )  # fmt: skip
    cab_height = {Build.LORRY: 0.93, Build.FIRE_ENGINE: 0.86, Build.DELIVERY: 0.96}[build] * top
    body = frame.body(wide / half, cab_rear, frame.high[0], cab_height)
    cab = CarBody(shape, body)
    cab.add_to(builder)
    add_front(builder, cab, frame.plate)
    rows = 1 if build is Build.FIRE_ENGINE else 0
    add_cabin(builder, cab, Cabin(rows=rows, occupied=frame.occupied))
    rear = frame.low[0] + 0.012
    floor = frame.wheel_radius * (2.15 if build is not Build.DELIVERY else 2.05)
    load_front = cab_rear - (0.12 if build is not Build.DELIVERY else -0.02)
    builder.box(
        (rear + 0.1, -0.45 * half, frame.wheel_radius * 0.9),
        (frame.high[0] - 0.6, 0.45 * half, floor),
        Material.PLASTIC_DARK,
    )
    cargo = Material.CONCRETE if build is Build.LORRY else Material.PAINT
    builder.box((rear, -wide, floor), (load_front, wide, top - 0.01), cargo)
    skirt = (frame.axles[1] + frame.wheel_radius * 1.25, load_front)
    if skirt[1] - skirt[0] > 0.5:
        builder.box(
            (skirt[0], -wide * 0.99, frame.wheel_radius * 0.75),
            (skirt[1] - 0.1, wide * 0.99, floor),
            Material.PLASTIC_DARK,
        )
    for sign in (-1.0, 1.0):
        y = sorted((sign * wide, sign * (wide + 0.006)))
        band = (floor + 0.25 * (top - floor), floor + 0.33 * (top - floor))
        material = Material.SIGN_WHITE if build is not Build.LORRY else Material.PAINT
        builder.box((rear, y[0], band[0]), (load_front, y[1], band[1]), material)
        if build is Build.FIRE_ENGINE:
            step = (load_front - rear) / 4
            for k in range(4):
                x0 = rear + k * step + 0.06
                builder.box(
                    (x0, y[0], floor + 0.40 * (top - floor)),
                    (x0 + step - 0.12, y[1], top - 0.25),
                    Material.METAL,
                )
    _add_rear_lamps(builder, rear, wide, floor - 0.22)
    _add_wheels(builder, frame, body, 6)


_BODIES: dict[Build, Callable[[ShapeBuilder, Build, VehicleFrame], None]] = {
    Build.AMBULANCE: _add_ambulance,
    Build.LORRY: _add_truck,
    Build.FIRE_ENGINE: _add_truck,
    Build.DELIVERY: _add_truck,
}
