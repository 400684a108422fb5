"""What the conversion knows of an episode's sensors, taken from the raw log's header."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from carstage.codecs import codec_for, codec_names
from carstage.errors import BadInputError
from carstage.rawlog.format import LEDGER, WORLD
from carstage.sensor_kinds.model import CLOUDS, DETECTIONS, POINTS, ROWS, VOXELS
from carstage.spec import EpisodeSpec, SensorSpec

ROWS_CODEC = "parquet"


@dataclass(frozen=True, slots=True)
class RecordedSensor:
    """A sensor that becomes files.

    Attributes:
        id: the user's name of it, also its stream.
        kind: short name of the kind, such as ``rgb``.
        codec: name of the codec of its files; ``parquet`` for sensors that become table rows.
        faces: further streams that its files are made from: faces of the cube, instance pictures.
    """

    id: str
    kind: str
    codec: str
    faces: tuple[str, ...] = ()

    @property
    def streams(self) -> tuple[str, ...]:
        """All streams that its files are made from; its own is the first."""
        return (self.id, *self.faces)


@dataclass(frozen=True, slots=True)
class SensorPlan:
    """Which streams of an episode become what.

    Attributes:
        written: the sensors of the dataset, in the order of the spec.
        label_streams: every stream that labels are made from, ``world`` and ``ledger`` included.
    """

    written: tuple[RecordedSensor, ...]
    label_streams: frozenset[str]


def plan_sensors(spec: EpisodeSpec, codecs: Mapping[str, str]) -> SensorPlan:
    """Decide what each sensor of a spec becomes.

    Args:
        spec: the episode's spec, see ``docs/formats/run-folder.md``.
        codecs: codec name by sensor id, where it is not the kind's default.

    Raises:
        BadInputError: a codec that does not exist, or one for a sensor that does not.
    """
    shown = spec.written_sensors
    unknown = set(codecs) - {sensor.id for sensor in shown}
    if unknown:
        raise BadInputError(
            f"conversion.codecs: the rig has no sensor {sorted(unknown)[0]!r}.",
            f"Sensors: {', '.join(sensor.id for sensor in shown)}.",
        )
    label_streams = {WORLD, LEDGER}
    by_id = {sensor.id: sensor for sensor in spec.sensors}
    for sensor in spec.sensors:
        if sensor.labelled:
            for name in (sensor.depth, sensor.instance):
                label_streams |= set(by_id[name].streams) if name else set()
        around = spec.labels.birds_eye is not None or spec.labels.occupancy is not None
        swept = around and not sensor.hidden
        if sensor.content in (POINTS, DETECTIONS, VOXELS) or (swept and sensor.content in CLOUDS):
            label_streams |= set(sensor.streams)
    return SensorPlan(
        tuple(_recorded(sensor, codecs.get(sensor.id)) for sensor in shown),
        frozenset(label_streams),
    )


def _recorded(sensor: SensorSpec, codec: str | None) -> RecordedSensor:
    kind = sensor.kind
    if sensor.content in ROWS:
        if codec not in (None, ROWS_CODEC):
            raise BadInputError(
                f"conversion.codecs.{sensor.id}: no codec {codec!r} for sensors of kind {kind!r}.",
                f"Codecs of that kind: {ROWS_CODEC}.",
            )
        return RecordedSensor(sensor.id, kind, ROWS_CODEC)
    names = codec_names(kind)
    # The default one is loaded where it encodes.
    name = names[0] if codec is None and names else codec_for(kind, codec)[0]
    return RecordedSensor(sensor.id, kind, name, sensor.streams[1:])
