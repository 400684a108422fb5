"""Sensors in the configuration: what carries them, where they sit, a model per kind.

The models are made from the rows of ``carstage.sensor_kinds``.
"""

from __future__ import annotations

import re
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Discriminator, create_model, model_validator

from carstage.config.attributes import SensorAttributes, attributes_model
from carstage.config.fields import Section, problem, setting, shortened
from carstage.sensor_kinds import SensorKind, kinds, sensor_kind
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
RESERVED_IDS = frozenset({"world", "ledger"})
_ID_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
#: Families of actors that can carry a sensor.
_CARRIERS = ("vehicle.", "walker.", "traffic.", "static.")
_FARTHEST_M = 100_000.0


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
    return create_model(
        "".join(part.capitalize() for part in kind.name.split("_")) + "Sensor",
        __base__=Sensor,
        __doc__=kind.summary,
        __module__=__name__,
        **fields,
    )


SENSOR_KINDS: dict[str, type[Sensor]] = {kind.name: _model(kind) for kind in kinds()}
"""Model of a sensor by the short name of its kind."""

if TYPE_CHECKING:
    AnySensor = Sensor
else:
    AnySensor = Annotated[reduce(or_, SENSOR_KINDS.values()), Discriminator("kind")]
