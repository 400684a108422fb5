"""What each of several workers on this machine gets: ports, cores, a graphics card."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import psutil

from carstage.config import Config, check_config, dump_config
from carstage.config.servers import CarlaServerConfig, ClassServerConfig, RemoteServerConfig
from carstage.errors import BadInputError
from carstage.execution.slots import MOST_WORKERS
from carstage.server import check_ports_free
from carstage.server.graphics import ADAPTER_OPTION, graphics_cards, wanted_card
from carstage.server.ports import BLOCK

Workers: TypeAlias = "int | Literal['auto']"
_MOST_CONVERTERS = 8
_WORKER_BYTES = 1_500_000_000
"""Of a worker with the embedded simulator: server, collector and converters, with room to spare."""
_CARLA_BYTES = 8_000_000_000
_LAST_PORT = 65_535
_CGROUP = Path("/sys/fs/cgroup")


@dataclass(frozen=True, slots=True)
class Machine:
    """What workers share.

    Attributes:
        cores: that this process may use.
        memory_bytes: that are free.
        cards: graphics cards of NVIDIA.
    """

    cores: int
    memory_bytes: int
    cards: int = 0

    @classmethod
    def here(cls, *, cards: bool = False) -> Machine:
        """This machine, or the part of it that its container may use.

        Args:
            cards: whether to count the graphics cards.
        """
        cores, memory = len(os.sched_getaffinity(0)), psutil.virtual_memory().available
        match _words(_CGROUP / "cpu.max"):
            case [quota, period] if quota.isdigit() and period.isdigit():
                cores = max(1, min(cores, int(quota) // max(1, int(period))))
        match _words(_CGROUP / "memory.max"), _words(_CGROUP / "memory.current"):
            case [most], [used] if most.isdigit() and used.isdigit():
                memory = max(0, min(memory, int(most) - int(used)))
        return cls(cores, memory, len(graphics_cards()) if cards else 0)


def _words(path: Path) -> list[str]:
    try:
        return path.read_text("ascii").split()
    except (OSError, UnicodeDecodeError):
        return []


def parse_workers(text: str) -> Workers:
    """A number of workers as users write it.

    Raises:
        BadInputError: it is neither a number nor ``auto``.
    """
    if text == "auto":
        return "auto"
    if text.isascii() and text.isdigit() and 1 <= int(text) <= MOST_WORKERS:
        return int(text)
    raise BadInputError(
        f"workers: {text[:40]!r} is not a number of workers.",
        f"Write a number from 1 to {MOST_WORKERS}, or auto.",
    )


def number_of_workers(config: Config, wanted: Workers, machine: Machine | None = None) -> int:
    """How many workers there are to be.

    ``auto``: with the embedded simulator one for each core as far as the memory lasts; with CARLA
    one for each graphics card; on a server that runs already or of a class of the user's, one.

    Args:
        config: what is recorded.
        wanted: as the user has said.
        machine: what they share; default: this one.

    Raises:
        BadInputError: that many cannot be.
    """
    server = config.server
    if isinstance(server, RemoteServerConfig):
        if wanted not in (1, "auto"):
            raise BadInputError(
                f"workers: {wanted} workers need a server each, and server.kind is remote.",
                "Let the run start the servers (kind: embedded or carla), or use one worker; other "
                "servers can record other shares at the same time (--shard).",
            )
        return 1
    if wanted != "auto":
        if not 1 <= wanted <= MOST_WORKERS:
            raise BadInputError(f"workers: {wanted} is not from 1 to {MOST_WORKERS}.")
        return wanted
    if isinstance(server, ClassServerConfig):
        return 1
    is_carla = isinstance(server, CarlaServerConfig)
    machine = machine or Machine.here(cards=is_carla)
    by_memory = machine.memory_bytes // (_CARLA_BYTES if is_carla else _WORKER_BYTES)
    most = max(1, machine.cards) if is_carla else machine.cores
    return max(1, min(most, by_memory, MOST_WORKERS))


def check_ports(config: Config, workers: int) -> None:
    """Refuse ports of several workers that are taken or do not exist.

    Raises:
        BadInputError: names the port.
    """
    server = config.server
    if isinstance(server, RemoteServerConfig | ClassServerConfig) or server.port == "auto":
        return
    last = server.port + workers * BLOCK - 1
    if last > _LAST_PORT:
        raise BadInputError(
            f"server.port: {workers} workers need the ports {server.port} to {last}.",
            "Choose a lower port, or leave it to `auto`.",
        )
    check_ports_free(range(server.port, last + 1))


def config_of_worker(
    config: Config, number: int, workers: int, machine: Machine | None = None
) -> Config:
    """The configuration with what one worker gets of the machine.

    What the user has set stays: only ports that he fixed move on by three per worker. Nothing of
    this changes a byte of what is recorded.

    Args:
        config: as the user has it.
        number: of the worker, from 1.
        workers: how many share the machine.
        machine: what they share; default: this one.
    """
    is_carla = isinstance(config.server, CarlaServerConfig)
    machine = machine or Machine.here(cards=is_carla)
    document = dump_config(config)
    server, conversion = document["server"], document["conversion"]
    cores = max(1, machine.cores // workers)
    if server.get("threads") == "auto":
        server["threads"] = cores
    if conversion["workers"] == "auto":
        conversion["workers"] = min(cores, _MOST_CONVERTERS)
    if server.get("port", "auto") != "auto":
        server["port"] += (number - 1) * BLOCK
    if is_carla and machine.cards > 1 and wanted_card(server["arguments"]) is None:
        card = (number - 1) % machine.cards
        server["arguments"] = [*server["arguments"], f"{ADAPTER_OPTION}{card}"]
    return check_config(document)
