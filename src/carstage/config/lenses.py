"""Camera models in the configuration: what a camera's pictures are re-projected to."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator

from carstage.config.fields import Section, setting
from carstage.geometry import Lens, lens_of
from carstage.geometry.lens_sources import SourceView, source_view
from carstage.spec.lenses import CUBE_MODELS, LensSpec


def _model(description: str) -> Any:
    return setting(title="Model", description=description, group="rig")


def _focal(axis: str) -> Any:
    return setting(
        title=f"f{axis}", description=f"Focal length along {axis}.", unit="px", group="rig", gt=0,
        le=100_000,
    )  # fmt: skip


def _center(axis: str) -> Any:
    return setting(
        None,
        title=f"c{axis}",
        description="Principal point from the picture's corner: OpenCV's value plus 0.5; left out: "
        "the middle.",
        unit="px",
        group="rig",
        ge=-100_000,
        le=100_000,
    )


def _coefficient(name: str, sentence: str) -> Any:
    return setting(0.0, title=name, description=sentence, group="rig", ge=-1000, le=1000)


def _coefficient_of(power: int) -> str:
    return f"Coefficient of the power {power}."


class _Lens(Section):
    """What the models share."""

    oversampling: float = setting(
        1.0,
        title="Oversampling",
        description="Recorded pixels per pixel of the picture, where the lens resolves most.",
        group="rig",
        ge=0.25,
        le=4,
    )
    coefficients: ClassVar[tuple[str, ...]] = ()

    def spec(self, image_size: tuple[int, int]) -> LensSpec:
        """The model in pixels of a picture of that size."""
        width, height = image_size
        values = self.model_dump()
        cx, cy = values.get("cx"), values.get("cy")
        return LensSpec(
            model=values["model"],
            width=width,
            height=height,
            fx=values.get("fx", width / (2.0 * math.pi)),
            fy=values.get("fy", height / math.pi),
            cx=width / 2.0 if cx is None else cx,
            cy=height / 2.0 if cy is None else cy,
            distortion=tuple(values[name] + 0.0 for name in self.coefficients),
            max_angle_deg=values.get("max_angle_deg", 180.0),
        )

    def lens(self, image_size: tuple[int, int]) -> Lens:
        """The model as geometry has it."""
        spec = self.spec(image_size)
        size, focal = (spec.width, spec.height), (spec.fx, spec.fy)
        center = (spec.cx, spec.cy)
        return lens_of(spec.model, size, focal, center, spec.distortion, spec.max_angle_deg)

    @property
    def needs_cube(self) -> bool:
        """Whether faces of a cube are recorded for it."""
        return self.model_dump()["model"] in CUBE_MODELS

    def source(self, image_size: tuple[int, int]) -> SourceView:
        """What is recorded for a picture of that size.

        Raises:
            BadInputError: no picture holds it.
        """
        cube = self.needs_cube
        return source_view(self.lens(image_size), cube=cube, oversampling=self.oversampling)


class _Focal(_Lens):
    """A model with focal lengths and a principal point."""

    fx: float = _focal("x")
    fy: float = _focal("y")
    cx: float | None = _center("x")
    cy: float | None = _center("y")


class PinholeLens(_Focal):
    """A pinhole whose focal lengths may differ and whose principal point may be off the middle."""

    model: Literal["pinhole"] = _model("No distortion.")


class BrownConradyLens(_Focal):
    """A pinhole with radial and tangential distortion, OpenCV's and ROS's `plumb_bob`."""

    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "p1", "p2", "k3")

    model: Literal["brown_conrady"] = _model("Radial and tangential distortion.")
    k1: float = _coefficient("k1", "Radial, of the squared radius.")
    k2: float = _coefficient("k2", "Radial, of the radius to the fourth.")
    p1: float = _coefficient("p1", "Tangential.")
    p2: float = _coefficient("p2", "Tangential.")
    k3: float = _coefficient("k3", "Radial, of the radius to the sixth.")


class KannalaBrandtLens(_Focal):
    """A fisheye, OpenCV's `fisheye`, ROS's and Kalibr's `equidistant`."""

    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "k3", "k4")

    model: Literal["kannala_brandt"] = _model("Fisheye.")
    k1: float = _coefficient("k1", _coefficient_of(3))
    k2: float = _coefficient("k2", _coefficient_of(5))
    k3: float = _coefficient("k3", _coefficient_of(7))
    k4: float = _coefficient("k4", _coefficient_of(9))
    max_angle_deg: float = setting(
        180.0,
        title="Largest angle",
        description="Angle to the optical axis beyond which the lens shows nothing, half its field "
        "of view.",
        unit="deg",
        group="rig",
        ge=10,
        le=180,
    )


class EquirectangularLens(_Lens):
    """The whole sphere: 360 degrees over the width, 180 over the height."""

    model: Literal["equirectangular"] = _model("The whole sphere.")


AnyLens = Annotated[
    PinholeLens | BrownConradyLens | KannalaBrandtLens | EquirectangularLens,
    Discriminator("model"),
]
LENS_MODELS = ("pinhole", "brown_conrady", "kannala_brandt", "equirectangular")
"""Names of the models."""
