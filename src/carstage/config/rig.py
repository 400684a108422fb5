"""The sensor rig: which sensors, where on the ego vehicle, with what attributes.

The table of kinds is the set of classes at the end: one class per kind, its CARLA id beside its
attributes. A new kind is one more of them in ``AnySensor``.
"""

from __future__ import annotations

import re
from functools import cache
from importlib import resources
from typing import Annotated, Any, ClassVar, Literal, get_args

import yaml
from pydantic import Discriminator, Strict, model_validator

from carstage.config.attributes import (
    CameraAttributes,
    GnssAttributes,
    ImuAttributes,
    LidarAttributes,
    RgbAttributes,
    SensorAttributes,
)
from carstage.config.fields import Section, problem, setting

#: Length of a stream's name in the raw log; hidden twins append one of these to the camera's id.
LONGEST_STREAM_NAME = 31
DEPTH_SUFFIX = ".depth"
INSTANCE_SUFFIX = ".instance"
LONGEST_SENSOR_ID = LONGEST_STREAM_NAME - len(INSTANCE_SUFFIX)
RESERVED_IDS = frozenset({"world", "ledger"})
_ID_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


def _metres(title: str, sentence: str) -> Any:
    return setting(0.0, title=title, description=sentence, unit="m", group="rig", ge=-1000, le=1000)


def _degrees(title: str, sentence: str) -> Any:
    return setting(0.0, title=title, description=sentence, unit="deg", group="rig", ge=-360, le=360)


class Pose(Section):
    """Where a sensor sits on the ego vehicle.

    CARLA's left-handed axes from the vehicle's origin (on the ground, at its centre): x forward,
    y right, z up; yaw turns right, pitch up, roll to the right side down, applied in CARLA's order.
    """

    x: float = _metres("x", "Forward.")
    y: float = _metres("y", "To the right.")
    z: float = _metres("z", "Up.")
    roll_deg: float = _degrees("Roll", "Positive: right side down.")
    pitch_deg: float = _degrees("Pitch", "Positive: up.")
    yaw_deg: float = _degrees("Yaw", "Positive: to the right.")


class Sensor(Section):
    """What all sensors have; the base of the kinds."""

    blueprint: ClassVar[str]
    is_camera: ClassVar[bool] = False

    id: str = setting(
        title="Id",
        description="Name of the sensor's folder; unique in the rig.",
        group="rig",
    )
    kind: str
    pose: Pose = setting(Pose, title="Pose", description="Place on the ego vehicle.", group="rig")
    attributes: SensorAttributes

    @model_validator(mode="after")
    def _check_id(self) -> Sensor:
        if self.id in RESERVED_IDS:
            raise problem(
                f"{self.id!r} is a reserved name.", f"Call it {self.id + '_sensor'!r}.", "id"
            )
        if not _ID_PATTERN.fullmatch(self.id):
            raise problem(
                f"{self.id!r} is not a usable name.",
                "Use letters, digits, '_', '-' and '.', beginning with a letter or digit.",
                "id",
            )
        if len(self.id) > LONGEST_SENSOR_ID:
            raise problem(
                f"{self.id!r} has {len(self.id)} characters.",
                f"Use at most {LONGEST_SENSOR_ID}.",
                "id",
            )
        if self.id.endswith((DEPTH_SUFFIX, INSTANCE_SUFFIX, ".tag", ".parquet")):
            raise problem(
                f"{self.id!r} ends like the name of a derived sensor or of a file.",
                "Use '_' instead of the last '.'.",
                "id",
            )
        return self


def _attributes(model: type[SensorAttributes]) -> Any:
    return setting(model, title="Attributes", description="Properties of the sensor.", group="rig")


class RgbSensor(Sensor):
    """A colour camera."""

    blueprint = "sensor.camera.rgb"
    is_camera = True
    kind: Literal["rgb"] = setting(title="Kind", description="Colour camera.", group="rig")
    attributes: RgbAttributes = _attributes(RgbAttributes)


class DepthSensor(Sensor):
    """A depth camera: distance along the optical axis."""

    blueprint = "sensor.camera.depth"
    is_camera = True
    kind: Literal["depth"] = setting(title="Kind", description="Depth camera.", group="rig")
    attributes: CameraAttributes = _attributes(CameraAttributes)


class SemanticSensor(Sensor):
    """A semantic segmentation camera: a tag per pixel."""

    blueprint = "sensor.camera.semantic_segmentation"
    is_camera = True
    kind: Literal["semantic"] = setting(
        title="Kind", description="Semantic segmentation camera.", group="rig"
    )
    attributes: CameraAttributes = _attributes(CameraAttributes)


class InstanceSensor(Sensor):
    """An instance segmentation camera: a tag and an object per pixel."""

    blueprint = "sensor.camera.instance_segmentation"
    is_camera = True
    kind: Literal["instance"] = setting(
        title="Kind", description="Instance segmentation camera.", group="rig"
    )
    attributes: CameraAttributes = _attributes(CameraAttributes)


class LidarSensor(Sensor):
    """A rotating ray-cast LiDAR."""

    blueprint = "sensor.lidar.ray_cast"
    kind: Literal["lidar"] = setting(title="Kind", description="Rotating LiDAR.", group="rig")
    attributes: LidarAttributes = _attributes(LidarAttributes)


class ImuSensor(Sensor):
    """An inertial measurement unit: acceleration, turn rate, compass."""

    blueprint = "sensor.other.imu"
    kind: Literal["imu"] = setting(
        title="Kind", description="Inertial measurement unit.", group="rig"
    )
    attributes: ImuAttributes = _attributes(ImuAttributes)


class GnssSensor(Sensor):
    """A satellite receiver: latitude, longitude, altitude."""

    blueprint = "sensor.other.gnss"
    kind: Literal["gnss"] = setting(title="Kind", description="Satellite receiver.", group="rig")
    attributes: GnssAttributes = _attributes(GnssAttributes)


AnySensor = Annotated[
    RgbSensor
    | DepthSensor
    | SemanticSensor
    | InstanceSensor
    | LidarSensor
    | ImuSensor
    | GnssSensor,
    Discriminator("kind"),
]

_CLASSES: tuple[type[Sensor], ...] = get_args(get_args(AnySensor)[0])
#: Class of a sensor by the short name of its kind.
SENSOR_KINDS: dict[str, type[Sensor]] = {
    get_args(cls.model_fields["kind"].annotation)[0]: cls for cls in _CLASSES
}

RigPreset = Literal["demo"]


@cache
def preset_rig(name: str) -> tuple[Sensor, ...]:
    """The sensors of a rig that ships with Car-STAGE; ``demo`` is the demo configuration's."""
    text = resources.files("carstage.config").joinpath(f"{name}.yaml").read_text("utf-8")
    return Rig.model_validate(yaml.safe_load(text)["rig"]).sensors


class Rig(Section):
    """All sensors of the ego vehicle: those of a preset, then those listed."""

    preset: RigPreset | None = setting(
        None,
        title="Preset",
        description="A rig that ships with Car-STAGE; listed sensors are added to it.",
        group="rig",
    )
    sensors: Annotated[tuple[AnySensor, ...], Strict(strict=False)] = setting(
        (), title="Sensors", description="The sensors.", group="rig"
    )

    @model_validator(mode="after")
    def _check_ids(self) -> Rig:
        if not self.all_sensors:
            raise problem("the rig has no sensor.", "Add at least one.", "sensors")
        taken = {sensor.id.lower() for sensor in preset_rig(self.preset)} if self.preset else set()
        for position, sensor in enumerate(self.sensors):
            if sensor.id.lower() in taken:
                raise problem(
                    f"{sensor.id!r} is the id of another sensor.",
                    "Give every sensor its own id (upper and lower case do not make a difference).",
                    "sensors",
                    position,
                    "id",
                )
            taken.add(sensor.id.lower())
        return self

    @property
    def all_sensors(self) -> tuple[Sensor, ...]:
        """Preset first, then the listed ones."""
        return (*(preset_rig(self.preset) if self.preset else ()), *self.sensors)


def default_rig() -> Rig:
    """One colour camera above the windscreen."""
    return Rig(sensors=(RgbSensor(id="CAM_FRONT", kind="rgb", pose=Pose(x=1.5, z=1.6)),))
