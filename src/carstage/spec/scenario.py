"""What the ego does in an episode, one class for each kind of scenario."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import (
    TYPE_CHECKING,
    Any,
    ClassVar,
    Dict,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Tuple,
    Type,
    Union,
)

from carstage.spec.drivers import Parameter, read_parameters
from carstage.spec.fields import Fields, SpecError, is_number, shown
from carstage.spec.plain import LEFT_OUT, plain
from carstage.spec.scene import Place
from carstage.spec.values import Value

if TYPE_CHECKING:
    from carstage.spec.events import EventSpec
    from carstage.spec.story_parts import StoryPart
    from carstage.spec.storyboard import StoryAct, StoryEntity, Trigger

Pose = Tuple[float, ...]
"""x, y, z (m), pitch, yaw, roll (deg) in CARLA's world axes."""
_POSE_NUMBERS = 6


class Control(NamedTuple):
    """What the driver of a vehicle does, as in ``ego.parquet``; flags are 0 or 1."""

    throttle: float
    steer: float
    brake: float
    hand_brake: float
    reverse: float
    gear: float


def _events(section: Fields) -> Optional[Tuple[EventSpec, ...]]:
    """Check and read ``events`` of a scenario; None where there are none."""
    if "events" not in section:
        return None
    from carstage.spec.events import read_events  # few episodes have any

    return read_events(section.objects("events"))


class ScenarioSpec(Value):
    """What the ego does.

    Attributes:
        kind: its name.
        json_kind: its name in the JSON form, which is part of the episode's id.
        events: what happens to the ego on its way; None: nothing that was asked for.
    """

    kind: ClassVar[str]
    json_kind: ClassVar[str]
    events: Optional[Tuple[EventSpec, ...]] = None

    @classmethod
    def read(cls, fields: Fields, steps: int) -> ScenarioSpec:
        """Check and read the section of this kind, for an episode of so many steps."""
        del fields, steps
        return cls()

    def planned_events(self) -> Tuple[Union[EventSpec, StoryPart], ...]:
        """What is to happen, one for each object that the record has in ``events``."""
        return self.events or ()

    def to_json(self) -> Dict[str, Any]:
        """The JSON form."""
        return {"kind": self.json_kind, **plain(self)}


@dataclass(frozen=True, eq=False, repr=False)
class AutopilotSpec(ScenarioSpec):
    """The Traffic Manager drives the ego through town."""

    kind = json_kind = "autopilot"
    events: Optional[Tuple[EventSpec, ...]] = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields, steps: int) -> AutopilotSpec:
        """Check and read the section."""
        del steps
        return cls(_events(fields))


@dataclass(frozen=True, eq=False, repr=False)
class StationarySpec(ScenarioSpec):
    """The ego stands with its hand brake on; the others drive."""

    kind = "stationary"
    # What versions up to 0.1 called it: another word would give recorded episodes another id.
    json_kind = "hold"


@dataclass(frozen=True, eq=False, repr=False)
class RouteSpec(ScenarioSpec):
    """The Traffic Manager drives the ego through spawn points and places, in this order."""

    kind = json_kind = "route"
    through: Tuple[Union[int, Place], ...]
    events: Optional[Tuple[EventSpec, ...]] = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields, steps: int) -> RouteSpec:
        """Check and read the section."""
        del steps
        places: List[Union[int, Place]] = []
        for index, value in enumerate(fields.list("through")):
            path = "%s[%d]" % (fields.path("through"), index)
            if type(value) is int:
                places.append(Fields({path: value}, "").integer(path, 0))
            else:
                place = Fields(value, path)
                places.append(Place(place.number("x_m"), place.number("y_m")))
        if not places:
            raise SpecError("%s: is empty." % fields.path("through"))
        return cls(tuple(places), _events(fields))


@dataclass(frozen=True, eq=False, repr=False)
class ReplayedActor(Value):
    """A road user of a recorded episode.

    Attributes:
        poses: one for each step; None where it was not there.
        run_up: poses of the steps before the first one, the oldest first, which give it the speed
            and the acceleration that it had; None: it stood.
        controls: one for each step; None where nobody drove it, or nothing is known.
    """

    blueprint: str
    attributes: Mapping[str, str]
    poses: Tuple[Optional[Pose], ...]
    run_up: Optional[Tuple[Pose, ...]] = field(default=None, metadata=LEFT_OUT)
    controls: Optional[Tuple[Control, ...]] = field(default=None, metadata=LEFT_OUT)


@dataclass(frozen=True, eq=False, repr=False)
class ReplaySpec(ScenarioSpec):
    """All road users move as in a recorded episode; the ego is the first of ``actors``."""

    kind = json_kind = "replay"
    episode_id: str
    actors: Tuple[ReplayedActor, ...]

    @classmethod
    def read(cls, fields: Fields, steps: int) -> ReplaySpec:
        """Check and read the section."""
        actors = tuple(
            ReplayedActor(
                blueprint=actor.text("blueprint"),
                attributes=actor.object("attributes").texts(),
                poses=_read_poses(actor, steps),
                run_up=_read_run_up(actor) if "run_up" in actor else None,
                controls=_read_controls(actor, steps) if "controls" in actor else None,
            )
            for actor in fields.objects("actors")
        )
        if not actors:
            raise SpecError("%s: is empty." % fields.path("actors"))
        return cls(fields.text("episode_id"), actors)


@dataclass(frozen=True, eq=False, repr=False)
class ScenicSpec(ScenarioSpec):
    """A Scenic program places and moves everybody.

    Attributes:
        program: named hash of its text.
        version: Scenic's.
        parameters: global parameters that override the program's.
        mode_2d: it is compiled in Scenic's 2D compatibility mode.
    """

    kind = json_kind = "scenic"
    program: str
    version: str
    parameters: Mapping[str, Parameter]
    mode_2d: bool

    @classmethod
    def read(cls, fields: Fields, steps: int) -> ScenicSpec:
        """Check and read the section."""
        del steps
        return cls(
            program=fields.text("program"),
            version=fields.text("version"),
            parameters=read_parameters(fields),
            mode_2d=fields.flag("mode_2d"),
        )


@dataclass(frozen=True, eq=False, repr=False)
class OpenScenarioSpec(ScenarioSpec):
    """scenario_runner plays an OpenSCENARIO file.

    Attributes:
        program: named hash of the file.
        runner: named hash of scenario_runner's modules.
        parameters: values of the file's parameters that override it.
    """

    kind = json_kind = "openscenario"
    program: str
    runner: str
    parameters: Mapping[str, Parameter]

    @classmethod
    def read(cls, fields: Fields, steps: int) -> OpenScenarioSpec:
        """Check and read the section."""
        del steps
        return cls(
            program=fields.text("program"),
            runner=fields.text("runner"),
            parameters=read_parameters(fields),
        )


@dataclass(frozen=True, eq=False, repr=False)
class StoryboardSpec(ScenarioSpec):
    """Car-STAGE itself plays an OpenSCENARIO file; the ego is the first of ``entities``.

    What it is made of is imported when it is read: few episodes have any.
    """

    kind = json_kind = "storyboard"
    entities: Tuple[StoryEntity, ...]
    acts: Tuple[StoryAct, ...]
    stop: Trigger

    @classmethod
    def read(cls, fields: Fields, steps: int) -> StoryboardSpec:
        """Check and read the section."""
        from carstage.spec.storyboard import StoryAct, StoryEntity, read_trigger

        del steps
        entities = tuple(map(StoryEntity.read, fields.objects("entities")))
        if not entities:
            raise SpecError("%s: is empty." % fields.path("entities"))
        acts = tuple(map(StoryAct.read, fields.objects("acts")))
        return cls(entities, acts, read_trigger(fields, "stop"))

    def planned_events(self) -> Tuple[StoryPart, ...]:
        """Each event of the storyboard, followed by its actions."""
        from carstage.spec.story_parts import story_parts

        return story_parts(self.acts)


@dataclass(frozen=True, eq=False, repr=False)
class RecordedSpec(ScenarioSpec):
    """Another program made the ticks and moved everybody; this was recorded beside it.

    Attributes:
        recording: random digits, so that no other recording has episodes of these ids.
        part: number of the episode in its recording, from 0.
        ego_id: the ego's id on the server.
        role: the ego's ``role_name``.
        client: version of the client that recorded.
        server: version that the server reported.
        reproducible: always false: who ticked is not known here, and cannot be made to again.
    """

    kind = json_kind = "recorded"
    recording: str
    part: int
    ego_id: int
    role: str
    client: str
    server: str
    reproducible: bool = False

    @classmethod
    def read(cls, fields: Fields, steps: int) -> RecordedSpec:
        """Check and read the section."""
        del steps
        if fields.flag("reproducible"):
            raise SpecError("%s: no recording is." % fields.path("reproducible"))
        return cls(
            recording=fields.text("recording"),
            part=fields.integer("part", 0),
            ego_id=fields.integer("ego_id", 0),
            role=fields.text("role"),
            client=fields.text("client"),
            server=fields.text("server"),
        )


def _read_poses(actor: Fields, steps: int) -> Tuple[Optional[Pose], ...]:
    poses = actor.list("poses")
    if len(poses) != steps:
        raise SpecError(
            "%s: %d poses are not one for each of %d steps."
            % (actor.path("poses"), len(poses), steps)
        )
    return tuple(
        None if pose is None else _numbers(pose, _POSE_NUMBERS, actor.path("poses"), index)
        for index, pose in enumerate(poses)
    )


def _read_run_up(actor: Fields) -> Tuple[Pose, ...]:
    return tuple(
        _numbers(pose, _POSE_NUMBERS, actor.path("run_up"), index)
        for index, pose in enumerate(actor.list("run_up"))
    )


def _read_controls(actor: Fields, steps: int) -> Tuple[Control, ...]:
    controls = actor.list("controls")
    if len(controls) != steps:
        raise SpecError(
            "%s: %d controls are not one for each of %d steps."
            % (actor.path("controls"), len(controls), steps)
        )
    path = actor.path("controls")
    return tuple(
        Control(*_numbers(control, len(Control._fields), path, index))
        for index, control in enumerate(controls)
    )


def _numbers(value: Any, count: int, path: str, index: int) -> Tuple[float, ...]:
    if isinstance(value, list) and len(value) == count and all(map(is_number, value)):
        return tuple(value)
    raise SpecError("%s[%d]: must be %d numbers, not %s." % (path, index, count, shown(value)))


_KINDS: Tuple[Type[ScenarioSpec], ...] = (
    AutopilotSpec,
    StationarySpec,
    RouteSpec,
    ReplaySpec,
    ScenicSpec,
    OpenScenarioSpec,
    StoryboardSpec,
    RecordedSpec,
)


def read_scenario(fields: Fields, steps: int) -> ScenarioSpec:
    """Check and read the section by its kind, for an episode of so many steps."""
    word = fields.text("kind")
    for cls in _KINDS:
        if word in (cls.kind, cls.json_kind):
            return cls.read(fields, steps)
    raise SpecError(
        "%s: %r is not known." % (fields.path("kind"), word),
        "Known are: %s." % ", ".join(sorted(cls.kind for cls in _KINDS)),
    )
