"""The whole specification of an episode, its JSON form and its id.

The JSON form is fixed in ``docs/formats/run-folder.md``; its hash is the episode's id. Nothing that
changes neither truth nor labels (paths, codecs, machine, time) may enter.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Collection, Dict, Optional, Tuple

from carstage.spec.agents import AgentSpec, read_agents, seen_by, stream_of
from carstage.spec.defaults import MAX_DISTANCE_M
from carstage.spec.fields import Fields, SpecError
from carstage.spec.labels import GroundTruthSpec, LabelsSpec
from carstage.spec.patches import PatchSpec, read_patches
from carstage.spec.plain import LEFT_OUT, plain
from carstage.spec.road_users import PedestriansSpec, TrafficSpec, VehiclesSpec
from carstage.spec.scenario import ScenarioSpec, read_scenario
from carstage.spec.scene import EgoSpec, WeatherSpec
from carstage.spec.sensors import SensorSpec, read_sensors
from carstage.spec.timing import SavedSteps, TimingSpec
from carstage.spec.values import Value
from carstage.spec.variants import VariantSpec

SPEC_VERSION = 1
_ID_DIGITS = 16
_MAX_SEED = 2**32 - 1
_VERSION = re.compile(r"\d+\.\d+\.\d+\Z")


@dataclass(frozen=True, eq=False, repr=False)
class Seeds(Value):
    """One integer per consumer of randomness. The order is part of how they are drawn."""

    traffic_manager: int
    walkers: int
    spawn: int
    ego: int
    sensor_noise: int
    driving: int

    @classmethod
    def read(cls, section: Fields) -> Seeds:
        """Check and read the section."""
        return cls(*(section.integer(seed.name, 0, _MAX_SEED) for seed in fields(cls)))


@dataclass(frozen=True, eq=False, repr=False)
class EpisodeSpec(Value):
    """One episode; attributes are the keys of the JSON form.

    Attributes:
        dialect: version of the wire protocol, such as ``0.9.16``.
        index: position in its configuration.
        map: name without folders.
        map_layers: layers of an ``_Opt`` map to load; None: all.
        steps: recorded ticks after ``warmup_ticks``; every ``save_every``-th of them is saved.
        fps: steps per simulated second.
        sensors: at least one; ids are unique.
        max_distance_m: objects farther away get no camera record.
        min_lidar_points: points below which an object is not visible, where the rig has a LiDAR.
        opendrive: named hash of the map's text, where it is a file of the user's; None: the
            server's own map.
        agents: further vehicles and roadside units with sensors of their own.
        wet_grip: whether the embedded simulator lets water on the road take grip of the tyres.
        variant: which variant of an episode this is; None: it has none.
        patches: pictures that are put on boards, see ``carstage.spec.patches``.
    """

    dialect: str
    index: int
    map: str
    map_layers: Optional[Tuple[str, ...]]
    weather: WeatherSpec
    steps: int
    fps: float
    save_every: int
    warmup_ticks: int
    timing: TimingSpec
    vehicles: VehiclesSpec
    pedestrians: PedestriansSpec
    traffic: TrafficSpec
    ego: EgoSpec
    scenario: ScenarioSpec
    sensors: Tuple[SensorSpec, ...]
    labels: LabelsSpec
    ground_truth: GroundTruthSpec
    max_distance_m: float
    min_lidar_points: int
    seeds: Seeds
    spec_version: int = SPEC_VERSION
    opendrive: Optional[str] = field(default=None, metadata=LEFT_OUT)
    agents: Tuple[AgentSpec, ...] = field(default=(), metadata=LEFT_OUT)
    wet_grip: bool = field(default=True, metadata=LEFT_OUT)
    variant: Optional[VariantSpec] = field(default=None, metadata=LEFT_OUT)
    patches: Tuple[PatchSpec, ...] = field(default=(), metadata=LEFT_OUT)

    @classmethod
    def from_json(
        cls, value: Any, path: str = "spec", *, kinds: Optional[Collection[str]] = None
    ) -> EpisodeSpec:
        """Check and read the JSON form.

        Args:
            value: what was read from JSON.
            path: of the value, as complaints begin with it.
            kinds: kinds of sensors that are known; None: any.

        Raises:
            SpecError: names the field and what is wrong with it.
        """
        given = Fields(value, path)
        version = given.integer("spec_version", 0)
        if version != SPEC_VERSION:
            raise SpecError("%s: %d is not known." % (given.path("spec_version"), version))
        dialect = given.text("dialect")
        if not _VERSION.match(dialect):
            raise SpecError(
                "%s: %r is not a CARLA version such as 0.9.16." % (given.path("dialect"), dialect)
            )
        fps, steps = given.number("fps", 0.0), given.integer("steps", 1)
        return cls(
            dialect=dialect,
            index=given.integer("index", 0) if "index" in given else 0,
            map=given.text("map"),
            map_layers=given.words("map_layers") if "map_layers" in given else None,
            weather=WeatherSpec.read(given.object("weather")),
            steps=steps,
            fps=fps,
            save_every=given.integer("save_every", 1),
            warmup_ticks=given.integer("warmup_ticks", 0),
            timing=TimingSpec.read(given.object("timing"), 1.0 / fps),
            vehicles=VehiclesSpec.read(given.object("vehicles")),
            pedestrians=PedestriansSpec.read(given.object("pedestrians")),
            traffic=TrafficSpec.read(given.object("traffic")),
            ego=EgoSpec.read(given.object("ego")),
            scenario=read_scenario(given.object("scenario"), steps),
            sensors=read_sensors(given, kinds),
            seeds=Seeds.read(given.object("seeds")),
            labels=LabelsSpec.read(given.object("labels")) if "labels" in given else LabelsSpec(),
            ground_truth=GroundTruthSpec.read(given.object("ground_truth"))
            if "ground_truth" in given
            else GroundTruthSpec(),
            max_distance_m=given.number("max_distance_m", 0.0)
            if "max_distance_m" in given
            else MAX_DISTANCE_M,
            min_lidar_points=given.integer("min_lidar_points", 0)
            if "min_lidar_points" in given
            else 0,
            opendrive=given.text("opendrive") if "opendrive" in given else None,
            agents=read_agents(given, kinds),
            wet_grip=given.flag("wet_grip") if "wet_grip" in given else True,
            variant=VariantSpec.read(given.object("variant")) if "variant" in given else None,
            patches=read_patches(given),
        )

    def to_json(self) -> Dict[str, Any]:
        """The JSON form: plain dictionaries, lists, numbers and words."""
        document: Dict[str, Any] = plain(self)
        document["scenario"] = self.scenario.to_json()
        return document

    def canonical_json(self) -> bytes:
        """Sorted keys, no spaces, UTF-8, floats as Python's ``repr``: equal specs, equal bytes."""
        text = json.dumps(
            self.to_json(),
            sort_keys=True,
            separators=(",", ":"),
            ensure_ascii=False,
            allow_nan=False,
        )
        return text.encode()

    @cached_property
    def episode_id(self) -> str:
        """First 16 hex digits of the SHA-256 of the canonical JSON."""
        import hashlib  # takes a twentieth of a collector's start, which needs no id

        return hashlib.sha256(self.canonical_json()).hexdigest()[:_ID_DIGITS]

    @property
    def step_s(self) -> float:
        """Simulated seconds of a step."""
        return 1.0 / self.fps

    @property
    def saved(self) -> SavedSteps:
        """Which steps are saved."""
        return SavedSteps(self.save_every)

    @property
    def saved_frames(self) -> int:
        """Number of saved frames."""
        return self.saved.count(self.steps)

    @property
    def saved_fps(self) -> float:
        """Saved frames per simulated second."""
        return self.fps / self.save_every

    @property
    def duration_s(self) -> float:
        """Simulated seconds of the recorded steps."""
        return self.steps / self.fps

    def agent(self, name: str) -> AgentSpec:
        """The agent of that name, which is not the ego's.

        Raises:
            KeyError: there is none.
        """
        for agent in self.agents:
            if agent.name == name:
                return agent
        raise KeyError(name)

    def agent_number(self, name: str) -> int:
        """Number of an agent, from 1 in the order of the list."""
        return self.agents.index(self.agent(name)) + 1

    def seen_by(self, name: str) -> EpisodeSpec:
        """This episode with one of its agents as the ego, see ``carstage.spec.agents``."""
        return seen_by(self, name)

    @property
    def streams(self) -> Dict[str, SensorSpec]:
        """All sensors, the ego's and the agents', by their streams in the raw log."""
        found = {sensor.id: sensor for sensor in self.sensors}
        for number, agent in enumerate(self.agents, 1):
            found.update((stream_of(sensor.id, number), sensor) for sensor in agent.sensors)
        return found

    def sensors_of(self, content: str) -> Tuple[SensorSpec, ...]:
        """The ego's sensors with frames of that content, hidden ones too, in the rig's order."""
        return tuple(sensor for sensor in self.sensors if sensor.content == content)

    @property
    def written_sensors(self) -> Tuple[SensorSpec, ...]:
        """The ego's sensors that the dataset has: those that are not hidden."""
        return tuple(sensor for sensor in self.sensors if not sensor.hidden)
