"""Attributes of sensors: friendly names with units, and the strings that CARLA wants.

Every field names CARLA's attribute; that name is accepted as the key, too. What is not set stays at
the server's own default, except where a class says otherwise: cameras always get size and field of
view. Source of names and defaults: CARLA's sensor reference, 0.9.16. Sensors that measure distances
by rays are in ``ranging``.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict, model_validator

from carstage.config.fields import Section, problem, setting

#: Attributes that a user may not set, and what to use instead.
_SET_BY_THE_RUN = {
    "sensor_tick": "Use save_every to record every n-th step, or the sensor's rate_hz.",
    "noise_seed": "It is drawn from the run's seed.",
    "role_name": "Use the sensor's id.",
}

ImageSize = Annotated[
    tuple[Annotated[int, Field(ge=1, le=16_384)], Annotated[int, Field(ge=1, le=16_384)]],
    Strict(strict=False),
]


def carla_text(value: float | bool | str) -> str:
    """A value as CARLA's attribute strings spell it; floats in full precision."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


class SensorAttributes(Section):
    """Attributes that all sensors share: none; the base of the others."""

    @model_validator(mode="before")
    @classmethod
    def _accept_carla_names(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        renamed: dict[Any, Any] = {}
        for key, value in data.items():
            if key in _SET_BY_THE_RUN:
                raise problem("this attribute is set by the run.", _SET_BY_THE_RUN[key], str(key))
            friendly = cls._carla_names().get(key, key)
            if friendly in renamed:
                raise problem("the same attribute is given twice.", f"Keep {friendly}.", str(key))
            renamed[friendly] = value
        return renamed

    @classmethod
    def _carla_names(cls) -> dict[str, str]:
        """Friendly name by CARLA's name."""
        names: dict[str, str] = {}
        for friendly, field in cls.model_fields.items():
            extra = field.json_schema_extra
            if isinstance(extra, dict) and isinstance(extra.get("carla"), str):
                names[str(extra["carla"])] = friendly
        return names

    def carla(self, *, fps: float, image_size: tuple[int, int]) -> dict[str, str]:
        """CARLA's attribute strings, for a run at ``fps`` with that default image size."""
        del fps, image_size
        return {
            name: carla_text(value)
            for name, friendly in self._carla_names().items()
            if (value := getattr(self, friendly)) is not None
        }


def _optional(
    title: str, sentence: str, carla: str, *, unit: str | None = None, **constraints: Any
) -> Any:
    return setting(
        None, title=title, description=sentence, unit=unit, carla=carla, group="rig", **constraints
    )


class CameraAttributes(SensorAttributes):
    """Attributes of every camera; two cameras with equal ones and one pose see the same pixels."""

    other_keys: ClassVar[frozenset[str]] = frozenset({"image_size_x", "image_size_y"})

    image_size: ImageSize | None = setting(
        None,
        title="Image size",
        description="Width and height; left out, the run's `image_size`.",
        unit="px",
        group="rig",
    )
    fov_deg: float = setting(
        90.0,
        title="Field of view",
        description="Horizontal field of view.",
        unit="deg",
        carla="fov",
        group="rig",
        gt=0,
        lt=180,
    )
    lens_circle_falloff: float | None = _optional(
        "Lens circle fall-off", "How fast the lens darkens to the edge.", "lens_circle_falloff"
    )
    lens_circle_multiplier: float | None = _optional(
        "Lens circle multiplier", "How strongly the lens darkens.", "lens_circle_multiplier"
    )
    lens_k: float | None = _optional("Lens k", "Distortion.", "lens_k")
    lens_kcube: float | None = _optional("Lens k cube", "Cubic distortion.", "lens_kcube")
    lens_x_size: float | None = _optional("Lens x size", "Distortion along x.", "lens_x_size")
    lens_y_size: float | None = _optional("Lens y size", "Distortion along y.", "lens_y_size")

    @model_validator(mode="before")
    @classmethod
    def _join_image_size(cls, data: Any) -> Any:
        axes = ("image_size_x", "image_size_y")
        if not isinstance(data, dict) or not set(axes) & set(data):
            return data
        rest = {key: value for key, value in data.items() if key not in axes}
        given = [data.get(axis) for axis in axes]
        if "image_size" in data or None in given:
            raise problem(
                "image_size_x and image_size_y belong together and replace image_size.",
                "Write image_size: [width, height].",
                next(axis for axis in axes if axis in data),
            )
        return {**rest, "image_size": given}

    def carla(self, *, fps: float, image_size: tuple[int, int]) -> dict[str, str]:
        """CARLA's attribute strings; the size is always among them."""
        width, height = self.image_size or image_size
        strings = super().carla(fps=fps, image_size=image_size)
        return {"image_size_x": str(width), "image_size_y": str(height), **strings}


class RgbAttributes(CameraAttributes):
    """A colour camera's: geometry, exposure and the effects of CARLA's post-processing."""

    enable_postprocess_effects: bool | None = _optional(
        "Post-processing",
        "Bloom, exposure, motion blur and the rest.",
        "enable_postprocess_effects",
    )
    exposure_mode: Literal["histogram", "manual"] | None = _optional(
        "Exposure mode", "Automatic by histogram, or manual.", "exposure_mode"
    )
    gamma: float | None = _optional("Gamma", "Target gamma.", "gamma", gt=0)
    shutter_speed_hz: float | None = _optional(
        "Shutter speed", "Reciprocal of the exposure time.", "shutter_speed", unit="1/s", gt=0
    )
    iso: float | None = _optional("ISO", "Sensitivity.", "iso", gt=0)
    fstop: float | None = _optional("F-stop", "Opening of the lens.", "fstop", gt=0)
    min_fstop: float | None = _optional("Smallest f-stop", "Largest opening.", "min_fstop", gt=0)
    blade_count: int | None = _optional("Blades", "Blades of the diaphragm.", "blade_count", ge=0)
    exposure_compensation: float | None = _optional(
        "Exposure compensation", "Brighter or darker.", "exposure_compensation", unit="EV"
    )
    exposure_min_bright: float | None = _optional(
        "Lowest brightness", "Bound of automatic exposure.", "exposure_min_bright"
    )
    exposure_max_bright: float | None = _optional(
        "Highest brightness", "Bound of automatic exposure.", "exposure_max_bright"
    )
    exposure_speed_up: float | None = _optional(
        "Exposure speed up", "Speed of adaptation from dark to bright.", "exposure_speed_up"
    )
    exposure_speed_down: float | None = _optional(
        "Exposure speed down", "Speed of adaptation from bright to dark.", "exposure_speed_down"
    )
    calibration_constant: float | None = _optional(
        "Calibration constant", "Grey that exposure aims at.", "calibration_constant"
    )
    focal_distance_cm: float | None = _optional(
        "Focal distance", "Where the image is sharp.", "focal_distance", unit="cm", ge=0
    )
    blur_amount: float | None = _optional("Blur amount", "Strength of defocus.", "blur_amount")
    blur_radius: float | None = _optional("Blur radius", "Radius of defocus.", "blur_radius")
    motion_blur_intensity: float | None = _optional(
        "Motion blur", "Strength of motion blur.", "motion_blur_intensity", ge=0, le=1
    )
    motion_blur_max_distortion: float | None = _optional(
        "Motion blur limit", "Longest smear, share of the width.", "motion_blur_max_distortion"
    )
    motion_blur_min_object_screen_size: float | None = _optional(
        "Motion blur threshold",
        "Share of the screen below which nothing smears.",
        "motion_blur_min_object_screen_size",
    )
    lens_flare_intensity: float | None = _optional(
        "Lens flare", "Strength of lens flares.", "lens_flare_intensity", ge=0
    )
    bloom_intensity: float | None = _optional("Bloom", "Strength of bloom.", "bloom_intensity")
    slope: float | None = _optional("Slope", "Steepness of the tone curve.", "slope")
    toe: float | None = _optional("Toe", "Dark end of the tone curve.", "toe")
    shoulder: float | None = _optional("Shoulder", "Bright end of the tone curve.", "shoulder")
    black_clip: float | None = _optional("Black clip", "Where black is cut.", "black_clip")
    white_clip: float | None = _optional("White clip", "Where white is cut.", "white_clip")
    temp_k: float | None = _optional("Temperature", "White balance.", "temp", unit="K", gt=0)
    tint: float | None = _optional("Tint", "White balance, green to magenta.", "tint")
    chromatic_aberration_intensity: float | None = _optional(
        "Chromatic aberration", "Strength of colour fringes.", "chromatic_aberration_intensity"
    )
    chromatic_aberration_offset: float | None = _optional(
        "Chromatic aberration offset", "Where fringes start.", "chromatic_aberration_offset"
    )


def _noise(title: str, carla: str, unit: str, **constraints: Any) -> Any:
    return _optional(
        title, "Noise that is added; none by default.", carla, unit=unit, **constraints
    )


class ImuAttributes(SensorAttributes):
    """An inertial measurement unit's: its noise."""

    noise_accel_stddev_x: float | None = _noise("x", "noise_accel_stddev_x", "m/s²", ge=0)
    noise_accel_stddev_y: float | None = _noise("y", "noise_accel_stddev_y", "m/s²", ge=0)
    noise_accel_stddev_z: float | None = _noise("z", "noise_accel_stddev_z", "m/s²", ge=0)
    noise_gyro_stddev_x: float | None = _noise("x", "noise_gyro_stddev_x", "rad/s", ge=0)
    noise_gyro_stddev_y: float | None = _noise("y", "noise_gyro_stddev_y", "rad/s", ge=0)
    noise_gyro_stddev_z: float | None = _noise("z", "noise_gyro_stddev_z", "rad/s", ge=0)
    noise_gyro_bias_x: float | None = _noise("x", "noise_gyro_bias_x", "rad/s")
    noise_gyro_bias_y: float | None = _noise("y", "noise_gyro_bias_y", "rad/s")
    noise_gyro_bias_z: float | None = _noise("z", "noise_gyro_bias_z", "rad/s")


class GnssAttributes(SensorAttributes):
    """A satellite receiver's: its noise."""

    noise_lat_stddev: float | None = _noise("Latitude", "noise_lat_stddev", "deg", ge=0)
    noise_lon_stddev: float | None = _noise("Longitude", "noise_lon_stddev", "deg", ge=0)
    noise_alt_stddev: float | None = _noise("Altitude", "noise_alt_stddev", "m", ge=0)
    noise_lat_bias: float | None = _noise("Latitude bias", "noise_lat_bias", "deg")
    noise_lon_bias: float | None = _noise("Longitude bias", "noise_lon_bias", "deg")
    noise_alt_bias: float | None = _noise("Altitude bias", "noise_alt_bias", "m")
