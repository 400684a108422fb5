"""The collector's plan, as ``reading`` makes it from JSON.

The JSON is fixed in docs/formats/run-folder.md. Only what the collector acts on becomes a field
here; the whole specification is carried along and written into ``episode.json`` as it came.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Mapping, Optional, Tuple

DEFAULT_TIMEOUT_S = 20.0
DEFAULT_LOAD_TIMEOUT_S = 200.0
EGO = "ego"
ON_MAP = "world"
RIGID = "rigid"
FOLLOW = "follow"
ATTACHMENTS = (RIGID, FOLLOW, "spring_arm", "spring_arm_ghost")


@dataclass(frozen=True)
class ServerPlan:
    """Where the server is, and how long one call to it, or loading a map, may take."""

    host: str
    port: int
    timeout_s: float
    load_timeout_s: float
    traffic_manager_port: int


@dataclass(frozen=True)
class Pose:
    """A sensor's pose on its carrier or on the map: CARLA's left-handed axes, m and degrees."""

    x_m: float
    y_m: float
    z_m: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float


@dataclass(frozen=True)
class SensorPlan:
    """One sensor, asked for or a hidden twin.

    Attributes:
        attach_to: ``ego``, ``world`` or a pattern of actor types.
        attach_index: which actor of the pattern, by distance from the ego at the start.
        attachment: ``rigid``, ``follow``, ``spring_arm`` or ``spring_arm_ghost``.
    """

    id: str
    kind: str
    blueprint: str
    pose: Pose
    attributes: Mapping[str, str]
    attach_to: str = EGO
    attach_index: int = 0
    attachment: str = RIGID


@dataclass(frozen=True)
class TimingPlan:
    """How time runs: step, sub-steps, and what an incomplete frame means.

    Attributes:
        synchronous: we tick; else the server runs on its own and we follow.
        skip_incomplete: an incomplete frame is not waited for: as asked for, and always where
            frames may be incomplete by nature, without synchronous mode or sensor synchronisation.
        own_timelines: sensors need not deliver in every step.
    """

    synchronous: bool
    step_s: float
    max_substep_delta_time_s: float
    max_substeps: int
    skip_incomplete: bool
    own_timelines: bool


@dataclass(frozen=True)
class WeatherMoment:
    """The weather from ``at_s`` on: a preset (or none) and values that override it."""

    at_s: float
    preset: Optional[str]
    parameters: Mapping[str, float]


@dataclass(frozen=True)
class WeatherPlan:
    """The weather at the first step, what it becomes later, and when lamps shine."""

    begin: WeatherMoment
    changes: Tuple[WeatherMoment, ...]
    lights: str


@dataclass(frozen=True)
class GroupPlan:
    """So many actors of these blueprints; ``base_type`` and ``generation`` None: any."""

    count: int
    filter: str
    base_type: Optional[str] = None
    generation: Optional[str] = None


@dataclass(frozen=True)
class VehiclesPlan:
    """Vehicles besides the ego.

    Attributes:
        groups: spawned in this order.
        radius_m: how near the ego they begin; None: anywhere.
        shortfall: ``warn``, ``fail`` or ``fill``.
    """

    groups: Tuple[GroupPlan, ...]
    radius_m: Optional[float]
    shortfall: str

    @property
    def count(self) -> int:
        """Vehicles of all groups."""
        return sum(group.count for group in self.groups)


@dataclass(frozen=True)
class WalkersPlan:
    """Pedestrians; shares in per cent, the rest as for vehicles."""

    group: GroupPlan
    radius_m: Optional[float]
    shortfall: str
    running_percent: float
    crossing_percent: float


@dataclass(frozen=True)
class TrafficPlan:
    """How the Traffic Manager drives.

    Attributes:
        spreads: by name, the ends between which each vehicle draws its own value.
        lane_changes: vehicles may change lanes.
        include_ego: the ego draws like the others, else it keeps the law.
        hybrid_physics_radius_m: vehicles farther from the ego move without physics; None: none.
    """

    spreads: Mapping[str, Tuple[float, float]]
    lane_changes: bool
    include_ego: bool
    hybrid_physics_radius_m: Optional[float]


@dataclass(frozen=True)
class Place:
    """A place on the map and a heading: metres and degrees."""

    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float


@dataclass(frozen=True)
class EgoPlan:
    """The ego: its blueprint, its colour (None: a recommended one), and where it begins."""

    blueprint: str
    color: Optional[Tuple[int, int, int]]
    spawn_index: Optional[int]
    place: Optional[Place]


@dataclass(frozen=True)
class EpisodeSpec:
    """What one episode is, as far as the collector acts on it; ``raw`` is all of it."""

    raw: Mapping[str, Any]
    dialect: str
    map: str
    map_layers: Optional[Tuple[str, ...]]
    weather: WeatherPlan
    steps: int
    fps: float
    save_every: int
    warmup_ticks: int
    timing: TimingPlan
    vehicles: VehiclesPlan
    pedestrians: WalkersPlan
    traffic: TrafficPlan
    ego: EgoPlan
    scenario: Mapping[str, Any]
    sensors: Tuple[SensorPlan, ...]
    seeds: Mapping[str, int]
    level_objects: Tuple[str, ...] = ()


@dataclass(frozen=True)
class EpisodePlan:
    """One episode to record: where it goes and what it is."""

    episode_id: str
    attempt: str
    folder: str
    spec: EpisodeSpec


@dataclass(frozen=True)
class Plan:
    """Everything that one collector process does.

    Attributes:
        queue_bytes: sensor data that may wait for the disk; when more does, the tick waits.
        sensor_warmup_ticks: sensors are listened to from that many ticks before the first saved
            one; ``None`` listens through the whole warm-up, as a camera with automatic exposure
            needs.
        raw_store: how payloads of cameras are stored, see ``carstage.rawlog.writing``.
        durable: sealed segments outlive a crash of the machine; those that are converted at once
            and then removed need not, and large ones are written over each other.
    """

    server: ServerPlan
    queue_bytes: int
    raw_store: str
    durable: bool
    sensor_warmup_ticks: Optional[int]
    episodes: Tuple[EpisodePlan, ...]
