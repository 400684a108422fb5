"""The sensors of an episode, those that were asked for and the hidden twins of labelled cameras."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Collection, Dict, Mapping, Optional, Tuple

from carstage.sensor_kinds import content_of
from carstage.spec.fields import Fields, SpecError
from carstage.spec.flash import FlashSpec
from carstage.spec.lenses import LensSpec
from carstage.spec.plain import LEFT_OUT
from carstage.spec.values import Value

EGO = "ego"
ON_MAP = "world"
RIGID = "rigid"
FOLLOW = "follow"
SPRING_ARM_GHOST = "spring_arm_ghost"
SPRING_ARMS = ("spring_arm", SPRING_ARM_GHOST)
ATTACHMENTS = (RIGID, FOLLOW, *SPRING_ARMS)


@dataclass(frozen=True, eq=False, repr=False)
class PoseSpec(Value):
    """Pose of a sensor on its carrier, or on the map: CARLA's left-handed axes, m and degrees."""

    x_m: float
    y_m: float
    z_m: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float


def read_pose(fields: Fields) -> PoseSpec:
    """Check and read a pose."""
    names = ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")
    return PoseSpec(*(fields.number(name) for name in names))


@dataclass(frozen=True, eq=False, repr=False)
class SensorSpec(Value):
    """A sensor to spawn.

    Attributes:
        kind: short name such as ``rgb``.
        blueprint: CARLA's id.
        hidden: recorded for the labels only, not part of the dataset.
        labelled: a camera that gets labels.
        attributes: CARLA's attribute strings.
        attach_to: ``ego``, ``world`` or a pattern of actor types; of an agent's sensor, ``ego`` is
            the agent.
        attach_index: which actor of that pattern, by distance from the ego at the start.
        attachment: ``rigid``, ``follow``, ``spring_arm`` or ``spring_arm_ghost``.
        depth, instance: of a labelled camera: ids of the sensors with its pose and intrinsics;
            ``instance`` also of a flash LiDAR that takes the tags of its points from there.
        lens: the camera model that its pictures are re-projected to; None: as they are recorded.
        faces: ids of the hidden sensors with the cube's other faces, in the order of ``FACES``;
            None where one picture holds all that the lens, or the flash LiDAR, looks at.
        flash: of a flash LiDAR: what it makes of its depth pictures.
    """

    id: str
    kind: str
    blueprint: str
    hidden: bool
    labelled: bool
    pose: PoseSpec
    attributes: Mapping[str, str]
    attach_to: str = EGO
    attach_index: int = 0
    attachment: str = RIGID
    depth: Optional[str] = None
    instance: Optional[str] = None
    lens: Optional[LensSpec] = field(default=None, metadata=LEFT_OUT)
    faces: Optional[Tuple[str, ...]] = field(default=None, metadata=LEFT_OUT)
    flash: Optional[FlashSpec] = field(default=None, metadata=LEFT_OUT)

    @property
    def streams(self) -> Tuple[str, ...]:
        """Streams of the raw log that its frames are made from; its own is the first."""
        faces = self.faces or ()
        if self.flash is None or self.instance is None:
            return (self.id, *faces)
        others = (face_of(self.instance, face) for face in faces)
        return (self.id, *faces, self.instance, *others)

    @property
    def content(self) -> str:
        """What a frame is, as the table of sensor kinds has it; empty for an unknown kind."""
        return content_of(self.kind)

    @classmethod
    def read(cls, fields: Fields, kinds: Optional[Collection[str]]) -> SensorSpec:
        """Check and read one sensor; ``kinds`` are those that are known, None: any."""
        return cls(
            id=fields.text("id"),
            kind=fields.text("kind", tuple(sorted(kinds)) if kinds is not None else ()),
            blueprint=fields.text("blueprint"),
            hidden=fields.flag("hidden") if "hidden" in fields else False,
            labelled=fields.flag("labelled") if "labelled" in fields else False,
            pose=read_pose(fields.object("pose")),
            attributes=fields.object("attributes").texts(),
            attach_to=fields.text("attach_to") if "attach_to" in fields else EGO,
            attach_index=fields.integer("attach_index", 0) if "attach_index" in fields else 0,
            attachment=fields.text("attachment", ATTACHMENTS) if "attachment" in fields else RIGID,
            depth=fields.text("depth") if "depth" in fields else None,
            instance=fields.text("instance") if "instance" in fields else None,
            lens=LensSpec.read(fields.object("lens")) if "lens" in fields else None,
            faces=fields.words("faces") if "faces" in fields else None,
            flash=FlashSpec.read(fields.object("flash")) if "flash" in fields else None,
        )


def face_of(sensor_id: str, face_id: str) -> str:
    """Id of a sensor's face that looks where that face of another sensor does."""
    return "%s.%s" % (sensor_id, face_id[-1])


def read_sensors(fields: Fields, kinds: Optional[Collection[str]]) -> Tuple[SensorSpec, ...]:
    """Check and read the list ``sensors``; ids are unique.

    Raises:
        SpecError: names the field and what is wrong with it.
    """
    sensors: Dict[str, SensorSpec] = {}
    for index, entry in enumerate(fields.objects("sensors")):
        sensor = SensorSpec.read(entry, kinds)
        if sensor.id in sensors:
            raise SpecError(
                "%s[%d].id: %r is taken already." % (fields.path("sensors"), index, sensor.id)
            )
        sensors[sensor.id] = sensor
    if not sensors:
        raise SpecError("%s: is empty." % fields.path("sensors"))
    return tuple(sensors.values())
