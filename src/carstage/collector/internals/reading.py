"""Reads a plan from JSON and checks all of it before anything is started."""

from __future__ import annotations

import json
import re
import sys
from typing import Any, Dict, Mapping, Optional, Tuple

from carstage.collector.internals.errors import PlanError
from carstage.collector.internals.fields import Fields, shown
from carstage.collector.internals.level_labels import LEVEL_OBJECTS
from carstage.collector.internals.plan import (
    ATTACHMENTS,
    DEFAULT_LOAD_TIMEOUT_S,
    DEFAULT_TIMEOUT_S,
    EGO,
    RIGID,
    EgoPlan,
    EpisodePlan,
    EpisodeSpec,
    GroupPlan,
    Place,
    Plan,
    Pose,
    SensorPlan,
    ServerPlan,
    TimingPlan,
    TrafficPlan,
    VehiclesPlan,
    WalkersPlan,
    WeatherMoment,
    WeatherPlan,
)
from carstage.rawlog.format import LEDGER, WORLD, check_stream_name
from carstage.rawlog.writing import CHUNKLOG, RAW_STORES
from carstage.sensor_kinds import import_plugins, kinds, known_kind

PLAN_VERSION = 1
SPEC_VERSION = 1
DEFAULT_QUEUE_BYTES = 256 * 1024 * 1024
MAX_SEED = 2**32 - 1
SEEDS = ("traffic_manager", "walkers", "spawn", "ego", "sensor_noise", "driving")
SPREADS = (
    "speed_difference_percent",
    "distance_m",
    "random_lane_change_percent",
    "ignore_lights_percent",
    "ignore_signs_percent",
    "ignore_vehicles_percent",
    "ignore_walkers_percent",
)

_VERSION = re.compile(r"\d+\.\d+\.\d+\Z")


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
    plan = Fields(value, "")
    version = plan.integer("plan_version", 0)
    if version != PLAN_VERSION:
        raise PlanError(
            "plan_version: %d is not known; this collector reads %d." % (version, PLAN_VERSION),
            "Use a collector and a Car-STAGE of the same version.",
        )
    _import_plugins(plan)
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
            load_timeout_s=server.number("load_timeout_s", 0.0)
            if "load_timeout_s" in server
            else DEFAULT_LOAD_TIMEOUT_S,
            traffic_manager_port=server.integer("traffic_manager_port", 1, 65535),
        ),
        queue_bytes=plan.integer("queue_bytes", 1)
        if "queue_bytes" in plan
        else DEFAULT_QUEUE_BYTES,
        raw_store=plan.text("raw_store", RAW_STORES) if "raw_store" in plan else CHUNKLOG,
        durable=plan.flag("durable") if "durable" in plan else True,
        sensor_warmup_ticks=plan.integer("sensor_warmup_ticks", 0)
        if "sensor_warmup_ticks" in plan
        else None,
        episodes=tuple(
            _episode(Fields(episode, "episodes[%d]" % index))
            for index, episode in enumerate(episodes)
        ),
    )


def _episode(fields: Fields) -> EpisodePlan:
    return EpisodePlan(
        episode_id=fields.text("episode_id"),
        attempt=fields.text("attempt"),
        folder=fields.text("folder"),
        spec=_spec(fields.object("spec"), fields.any("spec")),
    )


def _spec(fields: Fields, raw: Mapping[str, Any]) -> EpisodeSpec:
    version = fields.integer("spec_version", 0)
    if version != SPEC_VERSION:
        raise PlanError("%s: %d is not known." % (fields.path("spec_version"), version))
    dialect = fields.text("dialect")
    if not _VERSION.match(dialect):
        raise PlanError(
            "%s: %r is not a CARLA version such as 0.9.16." % (fields.path("dialect"), dialect)
        )
    fps = fields.number("fps", 0.0)
    seeds = fields.object("seeds")
    scenario = fields.object("scenario")
    scenario.text("kind")
    return EpisodeSpec(
        raw=raw,
        dialect=dialect,
        map=fields.text("map"),
        map_layers=_layers(fields),
        weather=_weather(fields.object("weather")),
        steps=fields.integer("steps", 1),
        fps=fps,
        save_every=fields.integer("save_every", 1),
        warmup_ticks=fields.integer("warmup_ticks", 0),
        timing=_timing(fields.object("timing"), 1.0 / fps),
        vehicles=_vehicles(fields.object("vehicles")),
        pedestrians=_walkers(fields.object("pedestrians")),
        traffic=_traffic(fields.object("traffic")),
        ego=_ego(fields.object("ego")),
        scenario=fields.any("scenario"),
        sensors=_sensors(fields),
        seeds={name: seeds.integer(name, 0, MAX_SEED) for name in SEEDS},
        level_objects=_level_objects(fields.object("labels")) if "labels" in fields else (),
    )


def _level_objects(labels: Fields) -> Tuple[str, ...]:
    names = labels.list("level_objects") if "level_objects" in labels else []
    for index, name in enumerate(names):
        if name not in LEVEL_OBJECTS:
            raise PlanError(
                "%s[%d]: %r is no kind of level objects."
                % (labels.path("level_objects"), index, name),
                "Known: %s." % ", ".join(LEVEL_OBJECTS),
            )
    return tuple(names)


def _group(fields: Fields) -> GroupPlan:
    generation = fields.text("generation") if "generation" in fields else None
    return GroupPlan(
        count=fields.integer("count", 0),
        filter=fields.text("filter"),
        base_type=fields.text("base_type") if "base_type" in fields else None,
        generation=None if generation == "all" else generation,
    )


def _radius_m(fields: Fields) -> Optional[float]:
    return fields.number("radius_m", 0.0) if "radius_m" in fields else None


def _shortfall(fields: Fields) -> str:
    return fields.text("shortfall", ("warn", "fail", "fill")) if "shortfall" in fields else "warn"


def _vehicles(fields: Fields) -> VehiclesPlan:
    groups = [*fields.objects("groups"), fields]
    return VehiclesPlan(
        tuple(_group(group) for group in groups), _radius_m(fields), _shortfall(fields)
    )


def _walkers(fields: Fields) -> WalkersPlan:
    return WalkersPlan(
        group=_group(fields),
        radius_m=_radius_m(fields),
        shortfall=_shortfall(fields),
        running_percent=_percent(fields, "running_percent"),
        crossing_percent=_percent(fields, "crossing_percent"),
    )


def _percent(fields: Fields, name: str) -> float:
    return fields.number(name) if name in fields else 0.0


def _traffic(fields: Fields) -> TrafficPlan:
    return TrafficPlan(
        spreads={name: fields.spread(name) for name in SPREADS if name in fields},
        lane_changes=fields.flag("lane_changes") if "lane_changes" in fields else True,
        include_ego=fields.flag("include_ego") if "include_ego" in fields else False,
        hybrid_physics_radius_m=fields.number("hybrid_physics_radius_m", 0.0)
        if "hybrid_physics_radius_m" in fields
        else None,
    )


def _ego(fields: Fields) -> EgoPlan:
    place = fields.object("spawn_place") if "spawn_place" in fields else None
    color = fields.list("color") if "color" in fields else None
    if color is not None and (
        len(color) != 3 or not all(isinstance(c, int) and 0 <= c <= 255 for c in color)
    ):
        raise PlanError("%s: must be three numbers from 0 to 255." % fields.path("color"))
    return EgoPlan(
        blueprint=fields.text("blueprint"),
        color=None if color is None else (color[0], color[1], color[2]),
        spawn_index=fields.integer("spawn_index", 0) if place is None else None,
        place=None
        if place is None
        else Place(*(place.number(name) for name in ("x_m", "y_m", "z_m", "yaw_deg"))),
    )


def _layers(fields: Fields) -> Optional[Tuple[str, ...]]:
    if "map_layers" not in fields:
        return None
    return tuple(str(name) for name in fields.list("map_layers"))


def _weather(fields: Fields) -> WeatherPlan:
    return WeatherPlan(
        begin=_moment(fields, 0.0),
        changes=tuple(
            _moment(change, change.number("at_s")) for change in fields.objects("changes")
        ),
        lights=fields.text("lights", ("auto", "on", "off")),
    )


def _moment(fields: Fields, at_s: float) -> WeatherMoment:
    parameters = fields.object("parameters")
    names = fields.any("parameters")
    return WeatherMoment(
        at_s=at_s,
        preset=fields.text("preset") if "preset" in fields else None,
        parameters={name: parameters.number(name) for name in names},
    )


def _timing(fields: Fields, step_s: float) -> TimingPlan:
    substep_s = fields.number("max_substep_delta_time_s", 0.0)
    substeps = fields.integer("max_substeps", 1)
    if step_s > substep_s * substeps * (1.0 + 1e-9):
        raise PlanError(
            "%s: %d sub-steps of %g s do not cover a step of %g s."
            % (fields.path("max_substeps"), substeps, substep_s, step_s),
            "Raise max_substeps or max_substep_delta_time_s.",
        )
    synchronous = fields.text("mode", ("sync", "async")) == "sync"
    in_step = fields.flag("sensor_sync")
    waited_for = fields.text("on_incomplete", ("wait", "skip")) == "wait"
    return TimingPlan(
        synchronous=synchronous,
        step_s=step_s,
        max_substep_delta_time_s=substep_s,
        max_substeps=substeps,
        skip_incomplete=not (synchronous and in_step and waited_for),
        own_timelines=not in_step,
    )


def _import_plugins(plan: Fields) -> None:
    """Import the modules that register the kinds of sensors that are not Car-STAGE's."""
    for index, module in enumerate(plan.list("plugins") if "plugins" in plan else ()):
        try:
            import_plugins([module])
        except Exception as error:
            raise PlanError(
                "plugins[%d]: %s cannot be imported by the collector's Python: %s."
                % (index, shown(module), error),
                "Install the package of the sensor kind for %s." % sys.executable,
            ) from error


def _kind(sensor: Fields) -> str:
    name = sensor.text("kind")
    if known_kind(name) is None:
        sensor.text("kind", tuple(sorted(kind.name for kind in kinds())))
    return name


def _sensors(fields: Fields) -> Tuple[SensorPlan, ...]:
    sensors: Dict[str, SensorPlan] = {}
    for index, value in enumerate(fields.list("sensors")):
        sensor = Fields(value, "%s[%d]" % (fields.path("sensors"), index))
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
            kind=_kind(sensor),
            blueprint=sensor.text("blueprint"),
            pose=Pose(
                *(
                    pose.number(name)
                    for name in ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")
                )
            ),
            attributes={name: attributes.text(name) for name in names},
            attach_to=sensor.text("attach_to") if "attach_to" in sensor else EGO,
            attach_index=sensor.integer("attach_index", 0) if "attach_index" in sensor else 0,
            attachment=sensor.text("attachment", ATTACHMENTS) if "attachment" in sensor else RIGID,
        )
    if not sensors:
        raise PlanError("%s: is empty." % fields.path("sensors"))
    return tuple(sensors.values())
