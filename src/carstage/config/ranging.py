"""Attributes of the sensors that measure distances by rays: LiDAR, semantic LiDAR, radar.

All strings are always given, because CARLA's own LiDAR defaults (10 m, 10 Hz, 45 % of the points
dropped) give half sweeps and thinned clouds. Source of names: CARLA's sensor reference, 0.9.16.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from carstage.config.attributes import SensorAttributes, carla_text
from carstage.config.fields import problem, setting

#: Rays of one LiDAR channel per sweep when points_per_second is ``auto``.
RAYS_PER_CHANNEL = 1024


def _ray(
    default: Any, title: str, sentence: str, carla: str, unit: str | None, **constraints: Any
) -> Any:
    return setting(
        default,
        title=title,
        description=sentence,
        unit=unit,
        carla=carla,
        group="rig",
        **constraints,
    )


Positive = Annotated[float, Field(gt=0)]


class SweepAttributes(SensorAttributes):
    """What every rotating LiDAR has. The defaults make one full sweep per tick."""

    channels: int = _ray(64, "Channels", "Number of lasers.", "channels", None, ge=1, le=512)
    range_m: float = _ray(100.0, "Range", "Longest distance.", "range", "m", gt=0, le=1000)
    points_per_second: Literal["auto"] | Annotated[int, Field(ge=1)] = _ray(
        "auto",
        "Points per second",
        f"Rays of all lasers; `auto`: {RAYS_PER_CHANNEL} per laser and step.",
        "points_per_second",
        "1/s",
    )
    rotation_frequency_hz: Literal["auto"] | Positive = _ray(
        "auto",
        "Rotation frequency",
        "Turns per second; `auto`: the frame rate, so that each step is one full sweep.",
        "rotation_frequency",
        "Hz",
    )
    upper_fov_deg: float = _ray(
        10.0, "Upper field of view", "Highest laser.", "upper_fov", "deg", ge=-90, le=90
    )
    lower_fov_deg: float = _ray(
        -30.0, "Lower field of view", "Lowest laser.", "lower_fov", "deg", ge=-90, le=90
    )
    horizontal_fov_deg: float = _ray(
        360.0,
        "Horizontal field of view",
        "Width of a sweep.",
        "horizontal_fov",
        "deg",
        gt=0,
        le=360,
    )

    @model_validator(mode="after")
    def _check_fan(self) -> SweepAttributes:
        if self.lower_fov_deg > self.upper_fov_deg:
            raise problem(
                f"{self.lower_fov_deg:g} is above upper_fov_deg, {self.upper_fov_deg:g}.",
                "Exchange the two.",
                "lower_fov_deg",
            )
        return self

    def rotation_hz(self, fps: float) -> float:
        """Turns per second in a run at ``fps``."""
        return fps if self.rotation_frequency_hz == "auto" else self.rotation_frequency_hz

    def rays_per_second(self, fps: float) -> int:
        """Rays of all lasers in a simulated second at ``fps``."""
        if self.points_per_second == "auto":
            return round(self.channels * RAYS_PER_CHANNEL * fps)
        return self.points_per_second

    def carla(self, *, fps: float, image_size: tuple[int, int]) -> dict[str, str]:
        """CARLA's attribute strings, all of them."""
        strings = super().carla(fps=fps, image_size=image_size)
        strings["points_per_second"] = str(self.rays_per_second(fps))
        strings["rotation_frequency"] = carla_text(float(self.rotation_hz(fps)))
        return strings


class LidarAttributes(SweepAttributes):
    """A ray-cast LiDAR's. The defaults lose no points."""

    atmosphere_attenuation_rate: float = _ray(
        0.004,
        "Attenuation",
        "Intensity is exp(-rate x distance).",
        "atmosphere_attenuation_rate",
        "1/m",
        ge=0,
    )
    dropoff_general_rate: float = _ray(
        0.0,
        "General drop-off",
        "Share of points lost at random.",
        "dropoff_general_rate",
        None,
        ge=0,
        le=1,
    )
    dropoff_intensity_limit: float = _ray(
        0.0,
        "Drop-off limit",
        "Intensity above which no point is lost.",
        "dropoff_intensity_limit",
        None,
        ge=0,
        le=1,
    )
    dropoff_zero_intensity: float = _ray(
        0.0,
        "Drop-off at zero",
        "Share of points lost at intensity 0.",
        "dropoff_zero_intensity",
        None,
        ge=0,
        le=1,
    )
    noise_stddev_m: float = _ray(
        0.0, "Noise", "Standard deviation along the ray.", "noise_stddev", "m", ge=0
    )


class SemanticLidarAttributes(SweepAttributes):
    """A semantic LiDAR's; CARLA gives it neither noise nor drop-off."""


class RadarAttributes(SensorAttributes):
    """A radar's: its cone, and how many rays it casts at random into it."""

    horizontal_fov_deg: float = _ray(
        30.0,
        "Horizontal field of view",
        "Width of the cone.",
        "horizontal_fov",
        "deg",
        gt=0,
        lt=180,
    )
    vertical_fov_deg: float = _ray(
        30.0, "Vertical field of view", "Height of the cone.", "vertical_fov", "deg", gt=0, lt=180
    )
    range_m: float = _ray(100.0, "Range", "Longest distance.", "range", "m", gt=0, le=1000)
    points_per_second: int = _ray(
        1500,
        "Rays per second",
        "Rays cast; those that hit something are returned.",
        "points_per_second",
        "1/s",
        ge=1,
        le=10_000_000,
    )
