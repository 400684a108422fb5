"""The calls of the protocol, by topic. Importing this package registers all of them."""

from carstage_sim.wire.handlers import (
    actors,
    batch,
    bones,
    core,
    environment,
    recorder,
    sensors,
    traffic_lights,
    traffic_manager,
    vehicles,
    walkers,
)
from carstage_sim.wire.handlers.registry import Call, Session, known_calls, serve

__all__ = [
    "Call",
    "Session",
    "actors",
    "batch",
    "bones",
    "core",
    "environment",
    "known_calls",
    "recorder",
    "sensors",
    "serve",
    "traffic_lights",
    "traffic_manager",
    "vehicles",
    "walkers",
]
