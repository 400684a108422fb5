"""The sensor rig: the sensors of a preset, then the listed ones."""

from __future__ import annotations

from typing import Annotated

from pydantic import Strict, model_validator

from carstage.config.fields import Section, problem, setting
from carstage.config.presets import RIG_PRESETS, RigPreset
from carstage.config.sensors import (
    DEPTH_SUFFIX,
    INSTANCE_SUFFIX,
    SENSOR_KINDS,
    AnySensor,
    Pose,
    Sensor,
)
from carstage.spec.lenses import FACE_SUFFIXES


class Rig(Section):
    """All sensors: those of a preset, then those listed."""

    preset: RigPreset | None = setting(
        None,
        title="Preset",
        basic=True,
        description="A rig that ships with Car-STAGE; listed sensors are added to it.",
        group="rig",
    )
    sensors: Annotated[tuple[AnySensor, ...], Strict(strict=False)] = setting(
        (), title="Sensors", basic=True, description="The sensors.", group="rig"
    )

    @model_validator(mode="after")
    def _check_ids(self) -> Rig:
        if not self.all_sensors:
            raise problem("the rig has no sensor.", "Add at least one.", "sensors")
        taken = {sensor.id.lower() for sensor in self.preset_sensors}
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
        for position, sensor in enumerate(self.sensors):
            owner, _, face = sensor.id.rpartition(".")
            if face in FACE_SUFFIXES and owner in self._cubes:
                raise problem(
                    f"{sensor.id!r} is a face of the cube of {owner!r}.",
                    "Give it another id.",
                    "sensors",
                    position,
                    "id",
                )
        return self

    @property
    def _cubes(self) -> set[str]:
        """Ids of the sensors that faces of a cube are recorded for, and of their hidden twins."""
        cubes = {sensor.id for sensor in self.all_sensors if sensor.needs_cube}
        return cubes | {name + twin for name in cubes for twin in (DEPTH_SUFFIX, INSTANCE_SUFFIX)}

    @property
    def preset_sensors(self) -> tuple[Sensor, ...]:
        """The sensors of the preset."""
        return () if self.preset is None else RIG_PRESETS[self.preset].sensors()

    @property
    def all_sensors(self) -> tuple[Sensor, ...]:
        """Preset first, then the listed ones."""
        return (*self.preset_sensors, *self.sensors)


def default_rig() -> Rig:
    """One colour camera above the windscreen."""
    camera = SENSOR_KINDS["rgb"].model_validate(
        {"id": "CAM_FRONT", "kind": "rgb", "pose": Pose(x=1.5, z=1.6)}
    )
    return Rig(sensors=(camera,))
