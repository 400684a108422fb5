"""What the ego does in an episode, one class for each kind of scenario."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Dict, List, Mapping, Optional, Tuple, Type, Union

from carstage.spec.fields import Fields, SpecError, is_number, shown
from carstage.spec.plain import plain
from carstage.spec.scene import Place

Pose = Tuple[float, ...]
"""x, y, z (m), pitch, yaw, roll (deg) in CARLA's world axes."""
_POSE_NUMBERS = 6


class ScenarioSpec:
    """What the ego does.

    Attributes:
        kind: its name.
        json_kind: its name in the JSON form, which is part of the episode's id.
    """

    kind: ClassVar[str]
    json_kind: ClassVar[str]

    @classmethod
    def read(cls, fields: Fields, steps: int) -> ScenarioSpec:
        """Check and read the section of this kind, for an episode of so many steps."""
        del fields, steps
        return cls()

    def to_json(self) -> Dict[str, Any]:
        """The JSON form."""
        return {"kind": self.json_kind, **plain(self)}


@dataclass(frozen=True)
class AutopilotSpec(ScenarioSpec):
    """The Traffic Manager drives the ego through town."""

    kind = json_kind = "autopilot"


@dataclass(frozen=True)
class StationarySpec(ScenarioSpec):
    """The ego stands with its hand brake on; the others drive."""

    kind = "stationary"
    # What versions up to 0.1 called it: another word would give recorded episodes another id.
    json_kind = "hold"


@dataclass(frozen=True)
class RouteSpec(ScenarioSpec):
    """The Traffic Manager drives the ego through spawn points and places, in this order."""

    kind = json_kind = "route"
    through: Tuple[Union[int, Place], ...]

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
        return cls(tuple(places))


@dataclass(frozen=True)
class ReplayedActor:
    """A road user of a recorded episode.

    Attributes:
        poses: one for each step; None where it was not there.
    """

    blueprint: str
    attributes: Mapping[str, str]
    poses: Tuple[Optional[Pose], ...]


@dataclass(frozen=True)
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
            )
            for actor in fields.objects("actors")
        )
        if not actors:
            raise SpecError("%s: is empty." % fields.path("actors"))
        return cls(fields.text("episode_id"), actors)


def _read_poses(actor: Fields, steps: int) -> Tuple[Optional[Pose], ...]:
    poses = actor.list("poses")
    if len(poses) != steps:
        raise SpecError(
            "%s: %d poses are not one for each of %d steps."
            % (actor.path("poses"), len(poses), steps)
        )
    for index, pose in enumerate(poses):
        if pose is not None and not (
            isinstance(pose, list) and len(pose) == _POSE_NUMBERS and all(map(is_number, pose))
        ):
            raise SpecError(
                "%s[%d]: must be null or six numbers, not %s."
                % (actor.path("poses"), index, shown(pose))
            )
    return tuple(None if pose is None else tuple(pose) for pose in poses)


_KINDS: Tuple[Type[ScenarioSpec], ...] = (AutopilotSpec, StationarySpec, RouteSpec, ReplaySpec)


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
