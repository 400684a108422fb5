"""Procedural vehicles, scaled to their blueprint's bounding box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.cabins import Cabin, add_cabin
from carstage_sim.content.car_body import CarBody
from carstage_sim.content.car_faces import LEDGE_M, SPARE_M, add_front, add_rear
from carstage_sim.content.car_trim import add_trim
from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.content.marks import LIGHT_BAR_M, add_bus_marks, add_police, add_taxi
from carstage_sim.content.offroad import add_offroader
from carstage_sim.content.trucks import add_ambulance, add_truck
from carstage_sim.content.two_wheelers import add_two_wheeler
from carstage_sim.content.van_sides import add_bus_sides, add_camper_trim, add_van_sides
from carstage_sim.content.vehicle_frame import Vector, VehicleFrame, add_wheels
from carstage_sim.content.vehicle_shapes import Build, build_of, makers_size, shape_of
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import TriangleMesh, build_mesh

_TAGS = {
    Build.PICKUP: CityObjectLabel.TRUCK,
    Build.LORRY: CityObjectLabel.TRUCK,
    Build.FIRE_ENGINE: CityObjectLabel.TRUCK,
    Build.DELIVERY: CityObjectLabel.TRUCK,
    Build.BUS: CityObjectLabel.BUS,
    Build.MOTORCYCLE: CityObjectLabel.MOTORCYCLE,
    Build.SCOOTER: CityObjectLabel.MOTORCYCLE,
    Build.CRUISER: CityObjectLabel.MOTORCYCLE,
    Build.BICYCLE: CityObjectLabel.BICYCLE,
    Build.CITY_BIKE: CityObjectLabel.BICYCLE,
}
_TWO_WHEELERS = (
    Build.MOTORCYCLE, Build.CRUISER, Build.SCOOTER, Build.BICYCLE, Build.CITY_BIKE,
)  # fmt: skip
_CABINS = {
    Build.COUPE: Cabin(rows=1),
    Build.VAN: Cabin(rows=0),
    Build.BUBBLE: Cabin(rows=0),
    Build.CAMPER: Cabin(rows=2),
    Build.BUS: Cabin(rows=8, passengers=6),
}
_STEEL_WHEELS = (Build.BUS, Build.VAN, Build.CAMPER)
_HEAVY = (Build.LORRY, Build.FIRE_ENGINE, Build.DELIVERY, Build.BUS)


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A vehicle in its actor's frame.

    Attributes:
        whole: all of it.
        wheels: numbers of the first triangle of each wheel and of the first behind it.
    """

    whole: TriangleMesh
    wheels: tuple[tuple[int, int], ...]

    @property
    def body(self) -> TriangleMesh:
        """All but the wheels, whose vertices stay: its bounds are those of the whole vehicle."""
        kept = np.ones(len(self.whole.triangles), np.bool_)
        for first, end in self.wheels:
            kept[first:end] = False
        return self._part(kept)

    def wheel(self, number: int) -> TriangleMesh:
        """One wheel, where it is on the vehicle."""
        part = self._part(slice(*self.wheels[number]))
        kept, index = np.unique(part.triangles, return_inverse=True)
        return replace(
            part,
            vertices=part.vertices[kept],
            triangles=index.reshape(-1, 3).astype(np.int32),
        )

    def _part(self, chosen: NDArray[np.bool_] | slice) -> TriangleMesh:
        mesh = self.whole
        return TriangleMesh(
            vertices=mesh.vertices,
            triangles=mesh.triangles[chosen],
            normals=mesh.normals[chosen],
            material=mesh.material[chosen],
            tag=mesh.tag[chosen],
            object_id=mesh.object_id[chosen],
        )


def vehicle_mesh(
    type_id: str,
    extent: Vector,
    box_center: Vector,
    *,
    axles_m: tuple[float, float] | None = None,
    wheel_radius_m: float | None = None,
    occupied: bool = True,
    coarse: bool = False,
) -> TriangleMesh:
    """All of a vehicle: see :func:`vehicle_of`."""
    return vehicle_of(
        type_id,
        extent,
        box_center,
        axles_m=axles_m,
        wheel_radius_m=wheel_radius_m,
        occupied=occupied,
        coarse=coarse,
    ).whole


def vehicle_of(
    type_id: str,
    extent: Vector,
    box_center: Vector,
    *,
    axles_m: tuple[float, float] | None = None,
    wheel_radius_m: float | None = None,
    occupied: bool = True,
    coarse: bool = False,
) -> Vehicle:
    """A vehicle in its actor's frame: x forward, y right, origin on the ground.

    Args:
        type_id: blueprint id; an unknown one becomes a sedan.
        extent: half sizes of the bounding box, metres.
        box_center: centre of the bounding box, metres.
        axles_m: x of the front and rear axle; default by the length.
        wheel_radius_m: default by the kind of vehicle.
        occupied: whether a car has a driver; riders are part of their machine.
        coarse: whether cars are of a third fewer triangles, as those that are part of a town.

    Returns:
        A mesh whose wheels stand on the ground; else every vertex lies in the box.
    """
    build = build_of(type_id)
    builder = ShapeBuilder(_TAGS.get(build, CityObjectLabel.CAR), coarse=coarse)
    hx, hy, hz = extent
    cx, cy, cz = box_center
    high = (cx + hx, cy + hy, cz + hz)
    # Boxes of some models begin a few centimetres above the ground; their tyres do not.
    low = (cx - hx, cy - hy, 0.0)
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
    whole = build_mesh(vertices, mesh.triangles, mesh.material, mesh.tag, normals=mesh.normals)
    return Vehicle(whole, tuple(builder.wheels))


def _add_offroad(builder: ShapeBuilder, build: Build, frame: VehicleFrame) -> None:
    """An off-road car: its wheels stand under wings beside the body."""
    half = 0.95 * frame.half_width
    length, width, _ = np.subtract(frame.high, frame.low).tolist()
    if (size := makers_size(frame.type_id, length, width)) is not None:
        half, frame = size.width / 2, replace(frame, wheel_radius=size.tyre_radius)
    tub = add_offroader(builder, frame, half)
    add_cabin(builder, tub, replace(_CABINS.get(build, Cabin()), occupied=frame.occupied))
    add_wheels(builder, frame, replace(tub.frame, half_width=half), 5)


def _add_car(builder: ShapeBuilder, build: Build, frame: VehicleFrame) -> None:
    """Cars, vans and buses: one body with its wheels."""
    shape = shape_of(frame.type_id)
    if build is Build.BUBBLE:
        radius = min(frame.wheel_radius, 0.27)
        axles = frame.axles[0], max(frame.axles[1], frame.low[0] + radius)
        frame = replace(frame, wheel_radius=radius, axles=axles)
    share = 0.885 if shape.mirrors else 0.98
    length, width, _ = np.subtract(frame.high, frame.low).tolist()
    if (size := makers_size(frame.type_id, length, width)) is not None:
        share = size.width / width
        frame = replace(frame, wheel_radius=size.tyre_radius)
    marks = _MARKS.get(frame.type_id.removeprefix("vehicle."))
    height = frame.high[2] - (LIGHT_BAR_M if marks is not None else 0.0)
    rear = frame.low[0] + (SPARE_M if shape.spare else LEDGE_M if shape.bumper else 0.0)
    body = frame.body(share, rear, frame.high[0], height)
    car = CarBody(shape, body, coarse=builder.coarse)
    car.add_to(builder)
    add_trim(builder, car)
    add_front(builder, car, frame.plate)
    add_rear(builder, car, frame.plate)
    add_cabin(builder, car, replace(_CABINS.get(build, Cabin()), occupied=frame.occupied))
    if marks is not None:
        marks(builder, car)
    if build is Build.BUS:
        add_bus_marks(builder, car)
    if build in _SIDES:
        _SIDES[build](builder, car)
    add_wheels(builder, frame, body, 0 if build in _STEEL_WHEELS else 5)


_MARKS = {
    "dodge.charger_police": add_police,
    "dodge.charger_police_2020": add_police,
    "ford.crown": add_taxi,
}
_SIDES: dict[Build, Callable[[ShapeBuilder, CarBody], None]] = {
    Build.VAN: add_van_sides,
    Build.CAMPER: add_camper_trim,
    Build.BUS: add_bus_sides,
}
_BODIES: dict[Build, Callable[[ShapeBuilder, Build, VehicleFrame], None]] = {
    Build.OFFROAD: _add_offroad,
    Build.AMBULANCE: add_ambulance,
    Build.LORRY: add_truck,
    Build.FIRE_ENGINE: add_truck,
    Build.DELIVERY: add_truck,
}
