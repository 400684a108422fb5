"""Attributes of sensors in the configuration: models of the rows in ``carstage.sensor_kinds``.

Every row names CARLA's attribute; that name is accepted as the key, too. What goes beyond a row
stands here: the two numbers of a picture's size, and what of a LiDAR follows from the frame rate.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict, create_model, model_validator

from carstage.config.fields import Section, problem, setting
from carstage.geometry.flash_beams import flash_source
from carstage.geometry.lens_sources import SourceView
from carstage.sensor_kinds import Attribute, AttributeSet
from carstage.sensor_kinds.attributes import RAYS_PER_CHANNEL
from carstage.spec import FlashSpec

#: Recorded pixels per sample: where one line stands for a beam, and where several do.
_LINES_PX, _FOOTPRINTS_PX = 4.0, 2.0
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
            friendly = cls.friendly_name(key)
            if friendly in renamed:
                raise problem("the same attribute is given twice.", f"Keep {friendly}.", str(key))
            renamed[friendly] = value
        return renamed

    @classmethod
    def friendly_name(cls, key: Any) -> Any:
        """Our name of an attribute that is called so, or as CARLA does."""
        return cls._carla_names().get(key, key)

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


class CameraAttributes(SensorAttributes):
    """What goes beyond the rows of a camera: the size of its picture."""

    if TYPE_CHECKING:
        image_size: ImageSize | None

    other_keys: ClassVar[frozenset[str]] = frozenset({"image_size_x", "image_size_y"})

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


class SweepAttributes(SensorAttributes):
    """What goes beyond the rows of a rotating LiDAR. The defaults make one turn in a sweep."""

    if TYPE_CHECKING:
        channels: int
        points_per_second: Literal["auto"] | int
        rotation_frequency_hz: Literal["auto"] | float
        upper_fov_deg: float
        lower_fov_deg: float

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
        """Turns per second of a LiDAR that measures ``fps`` times a second."""
        return fps if self.rotation_frequency_hz == "auto" else self.rotation_frequency_hz

    def turns(self, fps: float) -> float:
        """Turns in a sweep of a LiDAR that measures ``fps`` times a second."""
        return self.rotation_hz(fps) / fps

    def rays_per_second(self, fps: float) -> int:
        """Rays of all lasers in a second, of a LiDAR that measures ``fps`` times in it."""
        if self.points_per_second == "auto":
            return round(self.channels * RAYS_PER_CHANNEL * fps)
        return self.points_per_second

    def carla(self, *, fps: float, image_size: tuple[int, int]) -> dict[str, str]:
        """CARLA's attribute strings, all of them."""
        strings = super().carla(fps=fps, image_size=image_size)
        strings["points_per_second"] = str(self.rays_per_second(fps))
        strings["rotation_frequency"] = carla_text(float(self.rotation_hz(fps)))
        return strings


class FlashAttributes(SensorAttributes):
    """What goes beyond the rows of a flash LiDAR: the depth picture that it is made from."""

    if TYPE_CHECKING:
        columns: int
        rows: int
        horizontal_fov_deg: float
        vertical_fov_deg: float
        min_range_m: float
        range_m: float
        horizontal_divergence_deg: Literal["auto"] | float
        vertical_divergence_deg: Literal["auto"] | float
        samples: int
        oversampling: Literal["auto"] | float
        range_reflectivity: float
        false_return_rate: float

    @model_validator(mode="after")
    def _check_range(self) -> FlashAttributes:
        if self.min_range_m >= self.range_m:
            raise problem(
                f"{self.min_range_m:g} m is not below range_m, {self.range_m:g}.",
                "Give less.",
                "min_range_m",
            )
        if self.false_return_rate and not self.range_reflectivity:
            raise problem(
                "without range_reflectivity there is no signal that light could pass for.",
                "Give range_reflectivity, such as 0.1.",
                "false_return_rate",
            )
        return self

    def spec(self) -> FlashSpec:
        """What it measures, as the specification has it."""
        values = {one.name: getattr(self, one.name) for one in fields(FlashSpec)}
        for axis, count in (("horizontal", self.columns), ("vertical", self.rows)):
            if values[f"{axis}_divergence_deg"] == "auto":
                values[f"{axis}_divergence_deg"] = values[f"{axis}_fov_deg"] / count
        return FlashSpec(**values)

    def source(self) -> SourceView:
        """The depth picture, or the cube's faces, that is recorded for it.

        Raises:
            BadInputError: it would be too large.
        """
        if self.oversampling == "auto":
            return flash_source(self.spec(), _LINES_PX if self.samples == 1 else _FOOTPRINTS_PX)
        return flash_source(self.spec(), self.oversampling)

    def carla(self, *, fps: float, image_size: tuple[int, int]) -> dict[str, str]:
        """CARLA's attribute strings of that picture."""
        del fps, image_size
        source = self.source()
        return {
            "image_size_x": str(source.width),
            "image_size_y": str(source.height),
            "fov": carla_text(source.fov_deg),
        }


class RayFlashAttributes(FlashAttributes):
    """What goes beyond the rows of a flash LiDAR by rays: they are what is recorded for it."""

    def carla(self, *, fps: float, image_size: tuple[int, int]) -> dict[str, str]:
        """The attribute strings of the embedded simulator's sensor."""
        del fps, image_size
        flash = self.spec()
        return {
            "columns": str(flash.columns),
            "rows": str(flash.rows),
            "samples": str(flash.samples),
            "range": carla_text(flash.range_m),
            **{
                f"{axis}_{what}": carla_text(getattr(flash, f"{axis}_{what}_deg"))
                for axis in ("horizontal", "vertical")
                for what in ("fov", "divergence")
            },
        }


def check_server_has(
    server_kind: str, rows: Iterable[Attribute], attributes: SensorAttributes, *path: str | int
) -> None:
    """Refuse attributes that a CARLA server does not have.

    Args:
        server_kind: ``server.kind``.
        rows: of the sensor's kind.
        attributes: what was given.
        path: of the sensor.

    Raises:
        PydanticCustomError: with the attribute's path.
    """
    if server_kind not in ("carla", "remote"):
        return
    for row in rows:
        if row.embedded_only and getattr(attributes, row.name) is not None:
            raise problem(
                f"a {server_kind} server has no {row.name}.",
                "Leave it out, or use `server: {kind: embedded}`.",
                *path,
                "attributes",
                row.name,
            )


_SHAPES: dict[str, type[SensorAttributes]] = {
    "plain": SensorAttributes,
    "flash": FlashAttributes,
    "flash rays": RayFlashAttributes,
    "camera": CameraAttributes,
    "sweep": SweepAttributes,
}
_TYPES: dict[str, Any] = {"float": float, "int": int, "bool": bool, "size": ImageSize}
_BOUNDS = ("gt", "ge", "le", "lt")
_OR_AUTO = " or auto"


@cache
def attributes_model(attributes: AttributeSet) -> type[SensorAttributes]:
    """The model of a set of attributes."""
    rows: dict[str, Any] = {row.name: _field(row) for row in attributes.rows}
    return create_model(
        attributes.name,
        __base__=_SHAPES[attributes.shape],
        __doc__=attributes.sentence,
        __module__=__name__,
        **rows,
    )


def _field(row: Attribute) -> tuple[Any, Any]:
    """Type and declaration of a row; its bounds stand with the number, not with ``auto``."""
    bounds = {name: bound for name in _BOUNDS if (bound := getattr(row, name)) is not None}
    if row.type.endswith(_OR_AUTO):
        number = _TYPES[row.type.removesuffix(_OR_AUTO)]
        kind: Any = Literal["auto"] | Annotated[number, Field(**bounds)]
        bounds = {}
    else:
        kind = Literal[row.words] if row.words else _TYPES[row.type]
    if row.default is None:
        kind = kind | None
    return kind, setting(
        row.default,
        title=row.title,
        description=row.sentence,
        unit=row.unit,
        carla=row.carla,
        group="rig",
        **bounds,
    )
