"""Sensors in the configuration: what carries them, where they sit, a model per kind.

The models are made from the rows of ``carstage.sensor_kinds``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    SerializerFunctionWrapHandler,
    create_model,
    model_serializer,
    model_validator,
)

from carstage.config.attributes import (
    FlashAttributes,
    RayFlashAttributes,
    SensorAttributes,
    attributes_model,
    carla_text,
)
from carstage.config.fields import Section, problem, setting, shortened
from carstage.config.lenses import AnyLens
from carstage.config.of_its_kind import OfItsKind
from carstage.config.products import PRODUCTS, products_of
from carstage.errors import BadInputError
from carstage.geometry import is_pinhole
from carstage.geometry.lens_sources import SourceView
from carstage.sensor_kinds import SensorKind, kinds, sensor_kind
from carstage.sensor_kinds.model import NORMALS
from carstage.spec.flash import MOST_RAYS
from carstage.spec.sensors import EGO, ON_MAP, RIGID, SensorSpec

#: Length of a stream's name in the raw log; twins append one of these to their sensor's id.
LONGEST_STREAM_NAME = 31
DEPTH_SUFFIX = ".depth"
INSTANCE_SUFFIX = ".instance"
SEMANTIC_SUFFIX = ".semantic"
VOXELS_SUFFIX = ".voxels"
LONGEST_SENSOR_ID = LONGEST_STREAM_NAME - len(INSTANCE_SUFFIX)
_DERIVED = (
    DEPTH_SUFFIX, INSTANCE_SUFFIX, SEMANTIC_SUFFIX, VOXELS_SUFFIX, ".tag", ".parquet",
)  # fmt: skip
RESERVED_IDS = frozenset({"world", "ledger", "ego", "map"})
_ID_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
#: Families of actors that can carry a sensor.
_CARRIERS = ("vehicle.", "walker.", "traffic.", "static.")
_FARTHEST_M = 100_000.0
#: What a face of a cube adds to its sensor's id.
CUBE_SUFFIX = ".x"
LONGEST_CUBE_ID = LONGEST_SENSOR_ID - len(CUBE_SUFFIX)
#: What each face of a cube would do by itself, and what is set in its place.
_WITHOUT_SEAMS: dict[str, str | float] = {
    "exposure_mode": "manual",
    "bloom_intensity": 0.0,
    "lens_flare_intensity": 0.0,
    "motion_blur_intensity": 0.0,
    "chromatic_aberration_intensity": 0.0,
}


def _metres(title: str, sentence: str) -> Any:
    return setting(
        0.0,
        title=title,
        description=sentence,
        unit="m",
        group="rig",
        ge=-_FARTHEST_M,
        le=_FARTHEST_M,
    )


def _degrees(title: str, sentence: str) -> Any:
    return setting(0.0, title=title, description=sentence, unit="deg", group="rig", ge=-360, le=360)


class Pose(Section):
    """Where a sensor sits on what carries it; with `attach_to: world`, where on the map.

    CARLA's left-handed axes from a vehicle's origin (on the ground, at its centre): x forward,
    y right, z up. Yaw turns right, pitch up, roll to the right side down, in CARLA's order.
    """

    x: float = _metres("x", "Forward.")
    y: float = _metres("y", "To the right.")
    z: float = _metres("z", "Up.")
    roll_deg: float = _degrees("Roll", "Positive: right side down.")
    pitch_deg: float = _degrees("Pitch", "Positive: up.")
    yaw_deg: float = _degrees("Yaw", "Positive: to the right.")

    @property
    def is_turned(self) -> bool:
        """Whether it looks elsewhere than its carrier."""
        return (self.roll_deg, self.pitch_deg, self.yaw_deg) != (0.0, 0.0, 0.0)


class Sensor(Section):
    """What all sensors have; the base of the kinds."""

    id: str = setting(
        title="Id",
        description="Name of the sensor's folder; unique in the rig.",
        group="rig",
    )
    kind: str
    pose: Pose = setting(
        Pose, title="Pose", description="Place on what carries it, or on the map.", group="rig"
    )
    attach_to: str = setting(
        SensorSpec.attach_to,
        title="Carried by",
        description="`ego`; `world`: fixed on the map; or a pattern of actor types, such as "
        "`vehicle.audi.*`: the nearest to the ego at the start.",
        group="rig",
        min_length=1,
    )
    attach_index: int = setting(
        SensorSpec.attach_index,
        title="Which of them",
        description="0: the nearest actor that attach_to matches, 1: the second nearest, …",
        group="rig",
        ge=0,
        le=1000,
    )
    attachment: Literal["rigid", "follow", "spring_arm", "spring_arm_ghost"] = setting(
        SensorSpec.attachment,
        title="Attachment",
        description="`rigid`; `follow`: like a drone, a step behind, with its own heading; spring "
        "arms swing, for unlabelled views only.",
        group="rig",
    )
    rate_hz: float | None = setting(
        None,
        title="Own rate",
        description="Measurements per second, without timing.sensor_sync; left out: every step.",
        unit="Hz",
        group="rig",
        gt=0,
        le=240,
    )
    attributes: SensorAttributes

    @model_validator(mode="before")
    @classmethod
    def _fill_from_product(cls, data: Any) -> Any:
        """What the data sheet says of the product, where the configuration says nothing."""
        name = data.get("product") if isinstance(data, dict) else None
        given = data.get("attributes", {}) if isinstance(data, dict) else None
        if not isinstance(name, str) or name not in PRODUCTS or not isinstance(given, dict):
            return data
        model: Any = cls.model_fields["attributes"].annotation
        friendly = {model.friendly_name(key) for key in given}
        sheet = {
            key: value
            for key, value in PRODUCTS[name].attributes.items()
            if key in model.model_fields and key not in friendly
        }
        return {**data, "attributes": {**sheet, **given}}

    @model_validator(mode="after")
    def _check_id(self) -> Sensor:
        if self.id in RESERVED_IDS:
            raise problem(
                f"{self.id!r} is a reserved name.", f"Call it {self.id + '_sensor'!r}.", "id"
            )
        if not _ID_PATTERN.fullmatch(self.id):
            raise problem(
                f"{shortened(repr(self.id))} is not a usable name.",
                "Use letters, digits, '_', '-' and '.', beginning with a letter or digit.",
                "id",
            )
        if len(self.id) > LONGEST_SENSOR_ID:
            raise problem(
                f"{shortened(repr(self.id))} has {len(self.id)} characters.",
                f"Use at most {LONGEST_SENSOR_ID}.",
                "id",
            )
        if self.id.endswith(_DERIVED):
            raise problem(
                f"{shortened(repr(self.id))} ends like the name of a derived sensor or of a file.",
                "Use '_' instead of the last '.'.",
                "id",
            )
        return self

    @model_validator(mode="after")
    def _check_carrier(self) -> Sensor:
        if self.attach_to in (EGO, ON_MAP):
            if self.attach_index:
                raise problem(
                    f"there is only one {self.attach_to}.",
                    "Leave it out, or give attach_to a pattern of actor types.",
                    "attach_index",
                )
        elif not self.attach_to.startswith(_CARRIERS):
            raise problem(
                f"{shortened(repr(self.attach_to))} names nothing that carries sensors.",
                "Give `ego`, `world` or a pattern such as `vehicle.*` or `traffic.traffic_light`.",
                "attach_to",
            )
        if self.attach_to == ON_MAP and self.attachment != RIGID:
            raise problem(
                f"a sensor that is fixed on the map cannot be attached by {self.attachment}.",
                "Leave attachment out.",
                "attachment",
            )
        return self

    @property
    def row(self) -> SensorKind:
        """What the table knows of its kind."""
        return sensor_kind(self.kind)

    def carla(self, *, fps: float, image_size: tuple[int, int]) -> dict[str, str]:
        """Attribute strings that it is spawned with, in a run with that default image size."""
        return self.attributes.carla(fps=self.measures_hz(fps), image_size=image_size)

    def measures_hz(self, fps: float) -> float:
        """How often it measures in a simulated second of a run at ``fps``."""
        return fps if self.rate_hz is None else self.rate_hz

    @property
    def needs_cube(self) -> bool:
        """Whether faces of a cube are recorded for it."""
        return False

    def source(self, image_size: tuple[int, int]) -> SourceView | None:
        """The pictures that its frames are made from; None: they are recorded as they are.

        Args:
            image_size: the run's default.

        Raises:
            BadInputError: no picture holds what it looks at.
        """
        del image_size
        return None

    def _check_cube(self) -> None:
        if self.attachment != RIGID:
            raise problem(
                "the faces of a cube must keep their places beside each other.",
                "Use `rigid`.",
                "attachment",
            )
        if len(self.id) > LONGEST_CUBE_ID:
            raise problem(
                f"{shortened(repr(self.id))} has {len(self.id)} characters, and the faces of its "
                "cube get two more.",
                f"Use at most {LONGEST_CUBE_ID}.",
                "id",
            )


class CameraSensor(Sensor):
    """What cameras have beyond: a model that is not CARLA's."""

    lens: AnyLens | None = setting(
        None,
        title="Camera model",
        description="A model that the recorded pictures are re-projected to; left out: CARLA's "
        "pinhole of attributes.fov_deg.",
        group="rig",
    )

    @model_validator(mode="after")
    def _check_lens(self) -> CameraSensor:
        if self.lens is None:
            return self
        # A default is none's wish: configurations that runs have kept hold it.
        given = {
            name
            for name, field in type(self.attributes).model_fields.items()
            if getattr(self.attributes, name) not in (None, field.default)
        }
        for name in sorted(given):
            if name == "fov_deg" or name.startswith("lens_"):
                raise problem(
                    "the sensor's `lens` says what its picture shows.",
                    "Leave it out.",
                    "attributes",
                    name,
                )
        if "rolling_shutter_s" in given:
            raise problem(
                "rows of the recorded pictures are not the rows of what `lens` makes of them.",
                "Leave it out, or leave lens out.",
                "attributes",
                "rolling_shutter_s",
            )
        if self.row.content == NORMALS:
            raise problem(
                "normals are in the axes of what recorded them, so they are not re-projected.",
                "Leave lens out.",
                "lens",
            )
        if self.needs_cube:
            self._check_cube()
            self._check_seams()
        return self

    @model_serializer(mode="wrap")
    def _without_field_of_view(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """As it would be written: beside a lens, no field of view."""
        dumped: dict[str, Any] = handler(self)
        if self.lens is not None:
            dumped.get("attributes", {}).pop("fov_deg", None)  # a dump may leave defaults out
        return dumped

    @property
    def needs_cube(self) -> bool:
        """See ``Sensor.needs_cube``."""
        return self.lens is not None and self.lens.needs_cube

    @property
    def is_pinhole(self) -> bool:
        """Whether its pictures have no distortion."""
        if self.lens is not None:
            return self.lens.model == "pinhole"
        return is_pinhole(self.carla(fps=1.0, image_size=(1, 1)))

    def source(self, image_size: tuple[int, int]) -> SourceView | None:
        """See ``Sensor.source``."""
        return None if self.lens is None else self.lens.source(self.picture_size(image_size))

    def _check_seams(self) -> None:
        for name, value in _WITHOUT_SEAMS.items():
            given = getattr(self.attributes, name, None)
            if given not in (None, value):
                raise problem(
                    "each face of the cube would do this by itself, and seams would show.",
                    f"Leave it out; it is {value} here.",
                    "attributes",
                    name,
                )

    def carla(self, *, fps: float, image_size: tuple[int, int]) -> dict[str, str]:
        """See ``Sensor.carla``: with a lens those of the picture that it is re-projected from."""
        strings = super().carla(fps=fps, image_size=image_size)
        source = self.source(image_size)
        if source is None:
            return strings
        if self.needs_cube:
            names = {row.name: row.carla for row in self.row.attributes.rows}
            for name, value in _WITHOUT_SEAMS.items():
                carla = names.get(name)
                if carla is not None:
                    strings[carla] = carla_text(value)
        return {
            **strings,
            "image_size_x": str(source.width),
            "image_size_y": str(source.height),
            "fov": carla_text(source.fov_deg),
        }

    def picture_size(self, image_size: tuple[int, int]) -> tuple[int, int]:
        """Width and height of its pictures in a run with that default image size."""
        return getattr(self.attributes, "image_size", None) or image_size


class FlashLidarSensor(Sensor):
    """What flash LiDARs have beyond: the depth pictures that they are made from."""

    if TYPE_CHECKING:
        attributes: FlashAttributes

    @model_validator(mode="after")
    def _check_pictures(self) -> FlashLidarSensor:
        try:
            cube = self.needs_cube
        except BadInputError as error:
            raise problem(error.message, error.hint, "attributes") from None
        if cube:
            self._check_cube()
        return self

    @property
    def needs_cube(self) -> bool:
        """See ``Sensor.needs_cube``."""
        return len(self.attributes.source().faces) > 1

    def source(self, image_size: tuple[int, int]) -> SourceView | None:
        """See ``Sensor.source``."""
        del image_size
        return self.attributes.source()


class RayFlashLidarSensor(Sensor):
    """What flash LiDARs by rays have beyond: how many rays the simulator casts."""

    if TYPE_CHECKING:
        attributes: RayFlashAttributes

    @model_validator(mode="after")
    def _check_rays(self) -> RayFlashLidarSensor:
        flash = self.attributes.spec()
        rays = flash.beams * flash.samples**2
        if rays > MOST_RAYS:
            raise problem(
                f"{flash.columns} x {flash.rows} beams of {flash.samples**2} rays are more than "
                f"{MOST_RAYS:,} rays.",
                "Give fewer columns, rows or samples.",
                "attributes",
            )
        return self


_BASES: dict[str, type[Sensor]] = {"flash": FlashLidarSensor, "flash rays": RayFlashLidarSensor}


def _base(kind: SensorKind) -> type[Sensor]:
    """What the models of its kind are derived from."""
    if kind.is_camera:
        return CameraSensor
    return _BASES.get(kind.attributes.shape, Sensor)


def _model(kind: SensorKind) -> type[Sensor]:
    """The model of a kind."""
    model = attributes_model(kind.attributes)
    attributes = setting(
        model, title="Attributes", description="Properties of the sensor.", group="rig"
    )
    name = setting(title="Kind", description=kind.description, group="rig")
    fields: dict[str, Any] = {
        "kind": (Literal[kind.name], name),
        "attributes": (model, attributes),
    }
    if products := products_of(kind.name):
        product = setting(
            None,
            title="Product",
            description="A product whose data sheet gives the attributes that are not set; see "
            "[LiDARs that one can buy](how-to/flash-lidar.md#lidars-that-one-can-buy).",
            group="rig",
        )
        fields["product"] = (Literal[products] | None, product)
    return create_model(
        "".join(part.capitalize() for part in kind.name.split("_")) + "Sensor",
        __base__=_base(kind),
        __doc__=kind.summary,
        __module__=__name__,
        **fields,
    )


class _Models(Mapping[str, type[Sensor]]):
    """The models of all kinds by their names; each is made when it is asked for."""

    def __init__(self, known: Iterable[SensorKind]) -> None:
        self._kinds = {kind.name: kind for kind in known}
        self._made: dict[str, type[Sensor]] = {}

    def __getitem__(self, name: str) -> type[Sensor]:
        if name not in self._made:
            self._made[name] = _model(self._kinds[name])
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)


SENSOR_KINDS: Mapping[str, type[Sensor]] = _Models(kinds())
"""Model of a sensor by the short name of its kind."""


AnySensor = Annotated[Sensor, OfItsKind(Sensor, lambda: SENSOR_KINDS)]
