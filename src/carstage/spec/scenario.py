"""What the ego does in an episode, one class for each kind of scenario."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Dict, List, Mapping, Optional, Tuple, Type, Union

from carstage.spec.fields import Fields, SpecError
from carstage.spec.plain import plain
from carstage.spec.scene import Place

Pose = Tuple[float, ...]
"""x, y, z (m), pitch, yaw, roll (deg) in CARLA's world axes."""


@dataclass(frozen=True)
class ScenarioSpec:
    """What the ego does.

    Attributes:
        kind: its name.
        json_kind: its name in the JSON form, which is part of the episode's id.
    """

    kind: ClassVar[str]
    json_kind: ClassVar[str]

    @classmethod
    def read(cls, fields: Fields) -> ScenarioSpec:
        """Check and read the section of this kind."""
        del fields
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
    def read(cls, fields: Fields) -> RouteSpec:
        """Check and read the section."""
        places: List[Union[int, Place]] = []
        for index, value in enumerate(fields.list("through")):
            path = "%s[%d]" % (fields.path("through"), index)
            if isinstance(value, int) and not isinstance(value, bool):
                places.append(value)
            else:
                place = Fields(value, path)
                places.append(Place(place.number("x_m"), place.number("y_m")))
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
    def read(cls, fields: Fields) -> ReplaySpec:
        """Check and read the section."""
        actors = []
        for actor in fields.objects("actors"):
            attributes = actor.object("attributes")
            actors.append(
                ReplayedActor(
                    blueprint=actor.text("blueprint"),
                    attributes=attributes.texts(),
                    poses=tuple(
                        None if pose is None else tuple(pose) for pose in actor.list("poses")
                    ),
                )
            )
        return cls(fields.text("episode_id"), tuple(actors))


_KINDS: Tuple[Type[ScenarioSpec], ...] = (AutopilotSpec, StationarySpec, RouteSpec, ReplaySpec)


def read_scenario(fields: Fields) -> ScenarioSpec:
    """Check and read the section by its kind."""
    word = fields.text("kind")
    for cls in _KINDS:
        if word in (cls.kind, cls.json_kind):
            return cls.read(fields)
    raise SpecError(
        "%s: %r is not known." % (fields.path("kind"), word),
        "Known are: %s." % ", ".join(sorted(cls.kind for cls in _KINDS)),
    )
