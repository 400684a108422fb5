"""Agents beside the ego: further vehicles, roadside units and drones, each with its own sensors.

An agent sees the episode as if it were its ego: :func:`seen_by` is the specification that its
recording, its labels and its files follow from. So whatever knows an ego knows an agent.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Collection, Dict, Optional, Tuple

from carstage.spec.drones import DroneSpec
from carstage.spec.fields import Fields, SpecError
from carstage.spec.plain import LEFT_OUT
from carstage.spec.scenario import AutopilotSpec
from carstage.spec.scene import EgoSpec
from carstage.spec.sensors import PoseSpec, SensorSpec, read_pose, read_sensors
from carstage.spec.values import Value

if TYPE_CHECKING:
    from carstage.spec.episode import EpisodeSpec

VEHICLE = "vehicle"
ROADSIDE = "roadside"
JUNCTION = "junction"
DRONE = "drone"
AGENT_KINDS = (VEHICLE, ROADSIDE, JUNCTION, DRONE)
MOST_AGENTS = 99
CARRIER_BLUEPRINT = "sensor.other.gnss"
"""What carries the sensors of an agent that is no vehicle: an actor that nothing can touch or see,
whose place is in every snapshot of the world. Nobody listens to it."""
MAX_SEED = 2**32 - 1

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*\Z")
_LONGEST_NAME = 32
_OF_AGENT = "@"
"""Stands in no id of a sensor."""


@dataclass(frozen=True, eq=False, repr=False)
class AgentSeeds(Value):
    """One integer per consumer of randomness."""

    looks: int
    sensor_noise: int

    @classmethod
    def read(cls, section: Fields) -> AgentSeeds:
        """Check and read the section."""
        return cls(*(section.integer(name, 0, MAX_SEED) for name in ("looks", "sensor_noise")))


@dataclass(frozen=True, eq=False, repr=False)
class JunctionSpec(Value):
    """A mast at a junction, from which an agent looks at the junction's middle.

    The collector finds the place in the map: see ``carstage.collector.junctions``.

    Attributes:
        height_m: of the mast above the road.
        arm: by which of the roads that lead to the junction it stands, from 0.
        id: of the junction, as the map has it; None with ``draw`` and ``near_ego``.
        draw: or the share, from 0 to below 1, of the list of junctions at which it is.
        near_ego: or the junction that is nearest to where the ego begins.
    """

    height_m: float
    arm: int
    id: Optional[int] = field(default=None, metadata=LEFT_OUT)
    draw: Optional[float] = field(default=None, metadata=LEFT_OUT)
    near_ego: bool = field(default=False, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields) -> JunctionSpec:
        """Check and read the section."""
        given = [name for name in ("id", "draw", "near_ego") if name in fields]
        if len(given) != 1:
            raise SpecError("%s: needs one of id, draw and near_ego." % fields.path("id"))
        return cls(
            height_m=fields.number("height_m", 0.0),
            arm=fields.integer("arm", 0),
            id=fields.integer("id", 0) if "id" in fields else None,
            draw=fields.number("draw", least=0.0, most=1.0) if "draw" in fields else None,
            near_ego="near_ego" in fields and fields.flag("near_ego"),
        )


@dataclass(frozen=True, eq=False, repr=False)
class AgentSpec(Value):
    """An agent beside the ego.

    Attributes:
        name: unique in the episode; not ``ego``.
        kind: ``vehicle``, ``roadside``, ``junction`` or ``drone``.
        sensors: its own; ``attach_to: ego`` is the agent itself.
        seeds: its own, so that an agent more or less changes nobody else.
        vehicle: of a vehicle: what it is, where it begins, who drives it.
        pose: of a roadside unit: where it stands, in CARLA's world axes.
        junction: of a junction's camera mast: where it stands.
        drone: of a drone: how it flies.
    """

    name: str
    kind: str
    sensors: Tuple[SensorSpec, ...]
    seeds: AgentSeeds
    vehicle: Optional[EgoSpec] = field(default=None, metadata=LEFT_OUT)
    pose: Optional[PoseSpec] = field(default=None, metadata=LEFT_OUT)
    junction: Optional[JunctionSpec] = field(default=None, metadata=LEFT_OUT)
    drone: Optional[DroneSpec] = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields, kinds: Optional[Collection[str]]) -> AgentSpec:
        """Check and read one agent; ``kinds`` of sensors that are known, None: any."""
        kind = fields.text("kind", AGENT_KINDS)
        return cls(
            name=fields.text("name"),
            kind=kind,
            sensors=read_sensors(fields, kinds),
            seeds=AgentSeeds.read(fields.object("seeds")),
            vehicle=EgoSpec.read(fields.object("vehicle")) if kind == VEHICLE else None,
            pose=read_pose(fields.object("pose")) if kind == ROADSIDE else None,
            junction=JunctionSpec.read(fields.object("junction")) if kind == JUNCTION else None,
            drone=DroneSpec.read(fields.object("drone")) if kind == DRONE else None,
        )

    @property
    def ego(self) -> EgoSpec:
        """What carries its sensors, as the ego's section says it."""
        if self.vehicle is not None:
            return self.vehicle
        return EgoSpec(CARRIER_BLUEPRINT, None, None, None, is_vehicle=False)


def is_agent_name(text: str) -> bool:
    """Whether a text can be an agent's name: it becomes a folder's."""
    return bool(_NAME.match(text)) and len(text) <= _LONGEST_NAME and text.lower() != "ego"


def read_agents(fields: Fields, kinds: Optional[Collection[str]]) -> Tuple[AgentSpec, ...]:
    """Check and read the list ``agents``, which may be left out.

    Raises:
        SpecError: names the field and what is wrong with it.
    """
    agents: Dict[str, AgentSpec] = {}
    for index, entry in enumerate(fields.objects("agents")):
        agent = AgentSpec.read(entry, kinds)
        path = "%s[%d].name" % (fields.path("agents"), index)
        if not is_agent_name(agent.name):
            raise SpecError("%s: %r cannot be a name." % (path, agent.name))
        if agent.name in agents:
            raise SpecError("%s: %r is taken already." % (path, agent.name))
        agents[agent.name] = agent
    if len(agents) > MOST_AGENTS:
        raise SpecError("%s: more than %d." % (fields.path("agents"), MOST_AGENTS))
    return tuple(agents.values())


def seen_by(spec: EpisodeSpec, name: str) -> EpisodeSpec:
    """The specification of an episode with one of its agents as the ego.

    What is the ego's alone is not in it: the scenario's places and events.

    Args:
        spec: the episode.
        name: of the agent.

    Raises:
        KeyError: there is no such agent.
    """
    agent = spec.agent(name)
    seeds = agent.seeds
    return replace(
        spec,
        ego=agent.ego,
        sensors=agent.sensors,
        scenario=AutopilotSpec(),
        seeds=replace(spec.seeds, ego=seeds.looks, sensor_noise=seeds.sensor_noise),
        agents=(),
    )


def stream_of(sensor_id: str, number: int) -> str:
    """Stream of the raw log that a sensor of an agent is recorded in.

    Args:
        sensor_id: unique among the agent's.
        number: of the agent, from 1 in the order of the specification.
    """
    return "%s%s%d" % (sensor_id, _OF_AGENT, number)


def agent_of(stream: str) -> Tuple[str, int]:
    """Sensor and agent of a stream; 0: the ego, or a stream that is of nobody."""
    sensor_id, mark, number = stream.partition(_OF_AGENT)
    return (sensor_id, int(number)) if mark else (stream, 0)
