"""Servers: the embedded one, a CARLA release here, one that runs already, a class of a user's.

All of them give an :class:`Endpoint` and are context managers; what started a process ends it by
its own process group.
"""

from carstage.server.asking import ask_server, ask_spawn_points
from carstage.server.base import Endpoint, Server
from carstage.server.description import (
    BlueprintDescription,
    SimulatorDescription,
    ask_embedded,
    code_fingerprint,
    describe_embedded,
)
from carstage.server.embedded import EmbeddedServer
from carstage.server.interpreters import ClientPython, find_client
from carstage.server.loading import load_server
from carstage.server.owned import OwnedServer
from carstage.server.ports import (
    ANY_PORTS,
    PortBlock,
    PortRange,
    allot_ports,
    check_ports_free,
    free_port,
)
from carstage.server.probe import probe_version
from carstage.server.process import ServerProcess
from carstage.server.release import CarlaServer
from carstage.server.remote import RemoteServer

__all__ = [
    "ANY_PORTS",
    "BlueprintDescription",
    "CarlaServer",
    "ClientPython",
    "EmbeddedServer",
    "Endpoint",
    "OwnedServer",
    "PortBlock",
    "PortRange",
    "RemoteServer",
    "Server",
    "ServerProcess",
    "SimulatorDescription",
    "allot_ports",
    "ask_embedded",
    "ask_server",
    "ask_spawn_points",
    "check_ports_free",
    "code_fingerprint",
    "describe_embedded",
    "find_client",
    "free_port",
    "load_server",
    "probe_version",
]
