"""The calls of the protocol, by topic. Importing this package registers all of them."""

from carstage_sim.wire.handlers import (
    actors,
    batch,
    bones,
    core,
    debug_shapes,
    environment,
    recorder,
    sensors,
    street_lights,
    traffic_lights,
    traffic_manager,
    vehicles,
    walkers,
)
from carstage_sim.wire.handlers.registry import (
    Call,
    Session,
    TickRequest,
    known_calls,
    parameters_of,
    serve,
)

__all__ = [
    "Call",
    "Session",
    "TickRequest",
    "actors",
    "batch",
    "bones",
    "core",
    "debug_shapes",
    "environment",
    "known_calls",
    "parameters_of",
    "recorder",
    "sensors",
    "serve",
    "street_lights",
    "traffic_lights",
    "traffic_manager",
    "vehicles",
    "walkers",
]
