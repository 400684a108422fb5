"""A vehicle's measures, and what all four-wheeled ones get: wheels."""

from __future__ import annotations

from dataclasses import dataclass

from carstage_sim.content.body_shape import BodyFrame
from carstage_sim.content.lettering import plate_number
from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.content.wheels import add_wheel

Vector = tuple[float, float, float]


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


def add_wheels(builder: ShapeBuilder, frame: VehicleFrame, body: BodyFrame, spokes: int) -> None:
    """Add four wheels below a body; see :func:`carstage_sim.content.wheels.add_wheel`."""
    for axle in frame.axles:
        for sign in (-1.0, 1.0):
            y = sign * (body.half_width * 0.975 - body.tyre_width / 2)
            center = (axle, y, frame.wheel_radius)
            radius, width = frame.wheel_radius, body.tyre_width
            with builder.wheel():
                add_wheel(builder, center, radius, width, outward=sign, spokes=spokes)
