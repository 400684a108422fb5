"""Camera models of an episode's sensors: to which picture a recorded one is re-projected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

from carstage.spec.fields import Fields, SpecError
from carstage.spec.values import Value

PINHOLE = "pinhole"
BROWN_CONRADY = "brown_conrady"
KANNALA_BRANDT = "kannala_brandt"
EQUIRECTANGULAR = "equirectangular"
COEFFICIENTS = {PINHOLE: 0, BROWN_CONRADY: 5, KANNALA_BRANDT: 4, EQUIRECTANGULAR: 0}
"""Number of distortion coefficients by model: k1, k2, p1, p2, k3; k1 to k4."""
CUBE_MODELS = (KANNALA_BRANDT, EQUIRECTANGULAR)
"""Models whose field of view no single pinhole picture covers: faces of a cube are recorded."""
FACES = ("front", "right", "left", "up", "down", "back")
"""Faces of the cube; the front face is the sensor itself."""
FACE_SUFFIXES = tuple(face[0] for face in FACES[1:])
"""Ids of the other faces' sensors end with a dot and one of these."""


@dataclass(frozen=True, eq=False, repr=False)
class LensSpec(Value):
    """A camera model in pixels of its picture; optical axes: x right, y down, z forward.

    Attributes:
        model: a key of :data:`COEFFICIENTS`.
        width, height: size of the picture (px).
        fx, fy: focal lengths (px); of an equirectangular picture px per radian.
        cx, cy: principal point (px); the centre of the first pixel is (0.5, 0.5).
        distortion: coefficients in the order of OpenCV.
        max_angle_deg: angle to the optical axis beyond which the lens shows nothing.
    """

    model: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: Tuple[float, ...]
    max_angle_deg: float

    @property
    def is_pinhole(self) -> bool:
        """Whether it has no distortion, so that the matrix of ``fx fy cx cy`` projects."""
        return self.model == PINHOLE

    @property
    def needs_cube(self) -> bool:
        """Whether it is re-projected from faces of a cube."""
        return self.model in CUBE_MODELS

    @classmethod
    def read(cls, fields: Fields) -> LensSpec:
        """Check and read a camera model.

        Raises:
            SpecError: names the field and what is wrong with it.
        """
        model = fields.text("model", tuple(COEFFICIENTS))
        given = fields.list("distortion")
        numbers = Fields(
            {"[%d]" % i: one for i, one in enumerate(given)}, fields.path("distortion")
        )
        if len(given) != COEFFICIENTS[model]:
            raise SpecError(
                "%s: %s has %d coefficients, not %d."
                % (fields.path("distortion"), model, COEFFICIENTS[model], len(given))
            )
        return cls(
            model=model,
            width=fields.integer("width", 1),
            height=fields.integer("height", 1),
            fx=fields.number("fx", above=0.0),
            fy=fields.number("fy", above=0.0),
            cx=fields.number("cx"),
            cy=fields.number("cy"),
            distortion=tuple(numbers.number("[%d]" % i) for i in range(len(given))),
            max_angle_deg=fields.number("max_angle_deg", above=0.0, most=180.0),
        )
