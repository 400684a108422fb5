"""The collector's plan: where the server is, how to record, and the episodes.

The JSON is fixed in docs/formats/run-folder.md.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from typing import Any, Optional, Tuple

from carstage.collector.internals.errors import PlanError
from carstage.rawlog.format import LEDGER, WORLD, check_stream_name
from carstage.rawlog.writing import RAW_STORES
from carstage.releases import NORTHS, PROJECTIONS, GnssConvention
from carstage.sensor_kinds import import_plugins, registered_kinds
from carstage.spec import EpisodeSpec, Fields, SpecError, stream_of
from carstage.spec.defaults import QUEUE_BYTES, RAW_STORE

PLAN_VERSION = 1
DEFAULT_TIMEOUT_S = 20.0
DEFAULT_LOAD_TIMEOUT_S = 200.0


@dataclass(frozen=True)
class ServerPlan:
    """Where the server is, and how long one call to it, or loading a map, may take.

    ``gnss``: what a self-test found; None takes what its release does. ``shared``: others may use
    it, and a preview must leave it to them. ``exact_sensor_tick``: its ``sensor_tick`` counts whole
    steps from the first in which somebody listens.
    """

    host: str
    port: int
    timeout_s: float
    load_timeout_s: float
    traffic_manager_port: int
    gnss: Optional[GnssConvention] = None
    shared: bool = False
    exact_sensor_tick: bool = False


@dataclass(frozen=True)
class ProgramPlan:
    """Where the program of a scenario is.

    Attributes:
        file: the Scenic program, or the OpenSCENARIO file.
        python: an interpreter that has what plays it, and the client wheel.
        maps: folder for OpenDRIVE files and for what Scenic keeps of them.
        scenario_runner: its folder; only for OpenSCENARIO.
    """

    file: str
    python: str
    maps: str
    scenario_runner: Optional[str] = None


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
        driver_folders: where the ego's driver is looked for after the installed packages.
        inputs_file: where the page's server writes what a driver at the page presses.
    """

    server: ServerPlan
    queue_bytes: int
    raw_store: str
    durable: bool
    sensor_warmup_ticks: Optional[int]
    episodes: Tuple[EpisodePlan, ...]
    driver_folders: Tuple[str, ...] = ()
    inputs_file: str = ""
    program: Optional[ProgramPlan] = None


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
    try:
        return _plan(Fields(value, ""))
    except SpecError as error:
        raise PlanError(error.message, error.hint) from error


def _program(fields: Fields) -> ProgramPlan:
    return ProgramPlan(
        file=fields.text("file"),
        python=fields.text("python"),
        maps=fields.text("maps"),
        scenario_runner=fields.text("scenario_runner") if "scenario_runner" in fields else None,
    )


def _gnss(found: Fields) -> GnssConvention:
    return GnssConvention(
        found.text("projection", PROJECTIONS),
        found.text("north", NORTHS),
    )


def _plan(plan: Fields) -> Plan:
    version = plan.integer("plan_version", 0)
    if version != PLAN_VERSION:
        raise PlanError(
            "plan_version: %d is not known; this collector reads %d." % (version, PLAN_VERSION),
            "Use a collector and a Car-STAGE of the same version.",
        )
    _import_plugins(plan)
    server = plan.object("server")
    episodes = plan.objects("episodes")
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
            gnss=_gnss(server.object("gnss")) if "gnss" in server else None,
            shared=server.flag("shared") if "shared" in server else False,
            exact_sensor_tick=server.flag("exact_sensor_tick")
            if "exact_sensor_tick" in server
            else False,
        ),
        queue_bytes=plan.integer("queue_bytes", 1) if "queue_bytes" in plan else QUEUE_BYTES,
        raw_store=plan.text("raw_store", RAW_STORES) if "raw_store" in plan else RAW_STORE,
        durable=plan.flag("durable") if "durable" in plan else True,
        sensor_warmup_ticks=plan.integer("sensor_warmup_ticks", 0)
        if "sensor_warmup_ticks" in plan
        else None,
        episodes=tuple(_episode(episode) for episode in episodes),
        driver_folders=plan.words("driver_folders"),
        inputs_file=plan.text("inputs_file") if "inputs_file" in plan else "",
        program=_program(plan.object("program")) if "program" in plan else None,
    )


def _import_plugins(plan: Fields) -> None:
    """Import the modules that register the kinds of sensors that are not Car-STAGE's."""
    for index, module in enumerate(plan.list("plugins") if "plugins" in plan else ()):
        try:
            import_plugins([module])
        except Exception as error:
            raise PlanError(
                "plugins[%d]: %r cannot be imported: %s." % (index, module, error),
                "Install the package of the sensor kind for the collector's Python, %s."
                % sys.executable,
            ) from error


def _episode(fields: Fields) -> EpisodePlan:
    path = fields.path("spec")
    spec = EpisodeSpec.from_json(fields.any("spec"), path, kinds=registered_kinds())
    lists = [("sensors", spec.sensors, 0)]
    lists += [
        ("agents[%d].sensors" % (number - 1), agent.sensors, number)
        for number, agent in enumerate(spec.agents, 1)
    ]
    for place, sensors, number in lists:
        for index, sensor in enumerate(sensors):
            try:
                check_stream_name(stream_of(sensor.id, number) if number else sensor.id)
            except ValueError as error:
                raise PlanError("%s.%s[%d].id: %s." % (path, place, index, error)) from error
            if sensor.id in (WORLD, LEDGER):
                raise PlanError(
                    "%s.%s[%d].id: %r is taken already." % (path, place, index, sensor.id)
                )
    return EpisodePlan(
        episode_id=fields.text("episode_id"),
        attempt=fields.text("attempt"),
        folder=fields.text("folder"),
        spec=spec,
    )
