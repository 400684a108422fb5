"""What the form is generated from."""

from __future__ import annotations

from functools import cached_property

from carstage.web.errors import not_found
from carstage.web.messages import (
    RigPresetMessage,
    SchemaMessage,
    SensorKindMessage,
    SensorKindsMessage,
)
from carstage.web.messages.config import RigPresetSummary, SchemaGroup, SensorModality

_GROUPS = (
    ("scene", "Scene"),
    ("traffic", "Traffic"),
    ("ego", "Ego vehicle"),
    ("rig", "Sensors"),
    ("labels", "Labels"),
    ("timing", "Timing"),
    ("server", "Server"),
    ("conversion", "Conversion"),
    ("output", "Output"),
)

_MODALITIES = (
    ("camera", "Cameras"),
    ("truth", "Ground-truth cameras"),
    ("lidar", "LiDAR"),
    ("radar", "Radar"),
    ("inertial", "IMU, GNSS and V2X"),
)

_SHOWN = (
    *("name", "blueprint", "title", "short", "modality", "content", "icon", "viewer"),
    *("field_of_view", "is_camera"),
)


class SchemaService:
    """Schema, defaults and presets; all fixed, made at the first question."""

    def message(self) -> SchemaMessage:
        """All of it."""
        return self._message

    def rig_preset(self, name: str) -> RigPresetMessage:
        """A rig with its sensors.

        Raises:
            WebError: there is none of that name.
        """
        from carstage.config import RIG_PRESETS

        rig = RIG_PRESETS.get(name)
        if rig is None:
            raise not_found(f"rig {name}")
        sensors = [sensor.model_dump(mode="json", exclude_none=True) for sensor in rig.sensors()]
        return RigPresetMessage(name=name, title=rig.title, source=rig.source, sensors=sensors)

    def sensor_kinds(self) -> SensorKindsMessage:
        """The table of sensor kinds, as far as the page needs it."""
        from carstage.codecs import codec_names
        from carstage.sensor_kinds import kinds

        return SensorKindsMessage(
            kinds=[
                SensorKindMessage(
                    codecs=list(codec_names(kind.name)),
                    since=str(kind.since),
                    **{name: getattr(kind, name) for name in _SHOWN},
                )
                for kind in kinds()
            ],
            modalities=[
                SensorModality.model_validate({"name": name, "title": title, "colour": name})
                for name, title in _MODALITIES
            ],
        )

    @cached_property
    def _message(self) -> SchemaMessage:
        from carstage.config import (
            RIG_PRESETS,
            SENSOR_KINDS,
            WEATHER_PRESETS,
            Config,
            config_schema,
            dump_config,
            load_demo,
        )

        form = config_schema()
        for key in ("campaign", "variants"):  # edited as text; documents keep them
            del form["properties"][key]
        return SchemaMessage(
            config_schema=form,
            groups=[SchemaGroup(name=name, title=title) for name, title in _GROUPS],
            rig_presets=[
                RigPresetSummary(name=name, title=rig.title, source=rig.source)
                for name, rig in RIG_PRESETS.items()
            ],
            weather_presets=list(WEATHER_PRESETS),
            defaults=dump_config(Config()),
            demo=dump_config(load_demo()),
            sensor_defaults={
                kind: cls.model_validate({"id": "SENSOR", "kind": kind}).model_dump(mode="json")
                for kind, cls in SENSOR_KINDS.items()
            },
        )
