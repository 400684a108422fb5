"""The collector's plan: read from JSON and checked before anything is started.

The JSON is fixed in docs/formats/run-folder.md. Only what the collector acts on becomes a field
here; the whole specification is carried along and written into ``episode.json`` as it came.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Any, Dict, List, Mapping, Optional, Tuple

from carstage.collector.errors import PlanError
from carstage.collector.sensors import SENSOR_KINDS
from carstage.rawlog.format import LEDGER, WORLD, check_stream_name

PLAN_VERSION = 1
SPEC_VERSION = 1
DEFAULT_QUEUE_BYTES = 256 * 1024 * 1024
DEFAULT_TIMEOUT_S = 20.0
MAX_SEED = 2**32 - 1

_VERSION = re.compile(r"\d+\.\d+\.\d+\Z")


@dataclass(frozen=True)
class ServerPlan:
    """Where the server is, and how long one call to it may take."""

    host: str
    port: int
    timeout_s: float
    traffic_manager_port: int


@dataclass(frozen=True)
class Pose:
    """A sensor's pose on the ego: CARLA's left-handed axes, metres and degrees."""

    x_m: float
    y_m: float
    z_m: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float


@dataclass(frozen=True)
class SensorPlan:
    """One sensor, asked for or a hidden twin."""

    id: str
    kind: str
    blueprint: str
    pose: Pose
    attributes: Mapping[str, str]


@dataclass(frozen=True)
class TimingPlan:
    """How time runs: step, sub-steps, and what an incomplete frame means.

    Attributes:
        synchronous: we tick; else the server runs on its own and we follow.
        skip_incomplete: an incomplete frame is not waited for: as asked for, and always where
            frames may be incomplete by nature, without synchronous mode or sensor synchronisation.
    """

    synchronous: bool
    step_s: float
    max_substep_delta_time_s: float
    max_substeps: int
    skip_incomplete: bool


@dataclass(frozen=True)
class WeatherPlan:
    """A preset of ``carla.WeatherParameters`` (or none) and values that override it."""

    preset: Optional[str]
    parameters: Mapping[str, float]
    lights: str


@dataclass(frozen=True)
class CrowdPlan:
    """How many actors of which blueprints, and how near the ego they begin (None: anywhere)."""

    count: int
    filter: str
    radius_m: Optional[float] = None


@dataclass(frozen=True)
class EpisodeSpec:
    """What one episode is, as far as the collector acts on it; ``raw`` is all of it."""

    raw: Mapping[str, Any]
    dialect: str
    map: str
    weather: WeatherPlan
    steps: int
    fps: float
    save_every: int
    warmup_ticks: int
    timing: TimingPlan
    vehicles: CrowdPlan
    pedestrians: CrowdPlan
    ego_blueprint: str
    ego_spawn_index: int
    scenario: Mapping[str, Any]
    sensors: Tuple[SensorPlan, ...]
    seeds: Mapping[str, int]


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
    """

    server: ServerPlan
    queue_bytes: int
    sensor_warmup_ticks: Optional[int]
    episodes: Tuple[EpisodePlan, ...]


class _Fields:
    """Reads the fields of one JSON object and names the field's path in every complaint."""

    def __init__(self, value: Any, path: str) -> None:
        if not isinstance(value, dict):
            raise PlanError("%s: must be an object, not %s." % (path or "plan", _shown(value)))
        self._fields = value
        self._path = path

    def path(self, name: str) -> str:
        return "%s.%s" % (self._path, name) if self._path else name

    def __contains__(self, name: str) -> bool:
        return self._fields.get(name) is not None

    def any(self, name: str) -> Any:
        if name not in self._fields:
            raise PlanError("%s: is missing." % self.path(name))
        return self._fields[name]

    def object(self, name: str) -> _Fields:
        return _Fields(self.any(name), self.path(name))

    def list(self, name: str) -> List[Any]:
        value = self.any(name)
        if not isinstance(value, list):
            raise PlanError("%s: must be a list, not %s." % (self.path(name), _shown(value)))
        return value

    def text(self, name: str, choices: Tuple[str, ...] = ()) -> str:
        value = self.any(name)
        if not isinstance(value, str) or not value:
            raise PlanError("%s: must be a text, not %s." % (self.path(name), _shown(value)))
        if choices and value not in choices:
            raise PlanError(
                "%s: %r is not known." % (self.path(name), value),
                "Known are: %s." % ", ".join(choices),
            )
        return value

    def flag(self, name: str) -> bool:
        value = self.any(name)
        if not isinstance(value, bool):
            raise PlanError("%s: must be true or false." % self.path(name))
        return value

    def integer(self, name: str, least: int, most: Optional[int] = None) -> int:
        value = self.any(name)
        if isinstance(value, bool) or not isinstance(value, int):
            raise PlanError(
                "%s: must be a whole number, not %s." % (self.path(name), _shown(value))
            )
        if value < least or (most is not None and value > most):
            raise PlanError("%s: %d is out of range." % (self.path(name), value))
        return value

    def number(self, name: str, above: Optional[float] = None) -> float:
        value = self.any(name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
            raise PlanError("%s: must be a number, not %s." % (self.path(name), _shown(value)))
        if above is not None and value <= above:
            raise PlanError("%s: must be above %g, not %g." % (self.path(name), above, value))
        return float(value)


def read_plan(path: str) -> Plan:
    """Read and check a plan file.

    Raises:
        PlanError: names the field and what is wrong with it.
    """
    try:
        with open(path, encoding="utf-8") as file:
            value = json.load(file)
    except (OSError, ValueError) as error:
        raise PlanError("The plan %s cannot be read: %s." % (path, error)) from error
    return parse_plan(value)


def parse_plan(value: Any) -> Plan:
    """Check a plan that was read from JSON.

    Raises:
        PlanError: names the field and what is wrong with it.
    """
    plan = _Fields(value, "")
    version = plan.integer("plan_version", 0)
    if version != PLAN_VERSION:
        raise PlanError(
            "plan_version: %d is not known; this collector reads %d." % (version, PLAN_VERSION),
            "Use a collector and a Car-STAGE of the same version.",
        )
    server = plan.object("server")
    episodes = plan.list("episodes")
    if not episodes:
        raise PlanError("episodes: is empty.")
    return Plan(
        server=ServerPlan(
            host=server.text("host"),
            port=server.integer("port", 1, 65535),
            timeout_s=server.number("timeout_s", 0.0)
            if "timeout_s" in server
            else DEFAULT_TIMEOUT_S,
            traffic_manager_port=server.integer("traffic_manager_port", 1, 65535),
        ),
        queue_bytes=plan.integer("queue_bytes", 1)
        if "queue_bytes" in plan
        else DEFAULT_QUEUE_BYTES,
        sensor_warmup_ticks=plan.integer("sensor_warmup_ticks", 0)
        if "sensor_warmup_ticks" in plan
        else None,
        episodes=tuple(
            _episode(_Fields(episode, "episodes[%d]" % index))
            for index, episode in enumerate(episodes)
        ),
    )


def _episode(fields: _Fields) -> EpisodePlan:
    return EpisodePlan(
        episode_id=fields.text("episode_id"),
        attempt=fields.text("attempt"),
        folder=fields.text("folder"),
        spec=_spec(fields.object("spec"), fields.any("spec")),
    )


def _spec(fields: _Fields, raw: Mapping[str, Any]) -> EpisodeSpec:
    version = fields.integer("spec_version", 0)
    if version != SPEC_VERSION:
        raise PlanError("%s: %d is not known." % (fields.path("spec_version"), version))
    dialect = fields.text("dialect")
    if not _VERSION.match(dialect):
        raise PlanError(
            "%s: %r is not a CARLA version such as 0.9.16." % (fields.path("dialect"), dialect)
        )
    fps = fields.number("fps", 0.0)
    ego = fields.object("ego")
    seeds = fields.object("seeds")
    scenario = fields.object("scenario")
    scenario.text("kind")
    return EpisodeSpec(
        raw=raw,
        dialect=dialect,
        map=fields.text("map"),
        weather=_weather(fields.object("weather")),
        steps=fields.integer("steps", 1),
        fps=fps,
        save_every=fields.integer("save_every", 1),
        warmup_ticks=fields.integer("warmup_ticks", 0),
        timing=_timing(fields.object("timing"), 1.0 / fps),
        vehicles=_crowd(fields.object("vehicles")),
        pedestrians=_crowd(fields.object("pedestrians")),
        ego_blueprint=ego.text("blueprint"),
        ego_spawn_index=ego.integer("spawn_index", 0),
        scenario=fields.any("scenario"),
        sensors=_sensors(fields),
        seeds={
            name: seeds.integer(name, 0, MAX_SEED)
            for name in ("traffic_manager", "walkers", "spawn", "ego", "sensor_noise")
        },
    )


def _crowd(fields: _Fields) -> CrowdPlan:
    return CrowdPlan(
        count=fields.integer("count", 0),
        filter=fields.text("filter"),
        radius_m=fields.number("radius_m", 0.0) if "radius_m" in fields else None,
    )


def _weather(fields: _Fields) -> WeatherPlan:
    parameters = fields.object("parameters")
    names = fields.any("parameters")
    return WeatherPlan(
        preset=fields.text("preset") if "preset" in fields else None,
        parameters={name: parameters.number(name) for name in names},
        lights=fields.text("lights", ("auto", "on", "off")),
    )


def _timing(fields: _Fields, step_s: float) -> TimingPlan:
    substep_s = fields.number("max_substep_delta_time_s", 0.0)
    substeps = fields.integer("max_substeps", 1)
    if step_s > substep_s * substeps * (1.0 + 1e-9):
        raise PlanError(
            "%s: %d sub-steps of %g s do not cover a step of %g s."
            % (fields.path("max_substeps"), substeps, substep_s, step_s),
            "Raise max_substeps or max_substep_delta_time_s.",
        )
    synchronous = fields.text("mode", ("sync", "async")) == "sync"
    waited_for = fields.text("on_incomplete", ("wait", "skip")) == "wait"
    return TimingPlan(
        synchronous=synchronous,
        step_s=step_s,
        max_substep_delta_time_s=substep_s,
        max_substeps=substeps,
        skip_incomplete=not (synchronous and fields.flag("sensor_sync") and waited_for),
    )


def _sensors(fields: _Fields) -> Tuple[SensorPlan, ...]:
    sensors: Dict[str, SensorPlan] = {}
    for index, value in enumerate(fields.list("sensors")):
        sensor = _Fields(value, "%s[%d]" % (fields.path("sensors"), index))
        sensor_id = sensor.text("id")
        try:
            check_stream_name(sensor_id)
        except ValueError as error:
            raise PlanError("%s: %s." % (sensor.path("id"), error)) from error
        if sensor_id in (WORLD, LEDGER) or sensor_id in sensors:
            raise PlanError("%s: %r is taken already." % (sensor.path("id"), sensor_id))
        pose = sensor.object("pose")
        attributes = sensor.object("attributes")
        names = sensor.any("attributes")
        sensors[sensor_id] = SensorPlan(
            id=sensor_id,
            kind=sensor.text("kind", tuple(sorted(SENSOR_KINDS))),
            blueprint=sensor.text("blueprint"),
            pose=Pose(
                *(
                    pose.number(name)
                    for name in ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")
                )
            ),
            attributes={name: attributes.text(name) for name in names},
        )
    if not sensors:
        raise PlanError("%s: is empty." % fields.path("sensors"))
    return tuple(sensors.values())


def _shown(value: Any) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 40 else text[:37] + "..."
