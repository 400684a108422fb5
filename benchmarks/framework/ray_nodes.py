"""A Ray cluster of several nodes on this machine, of which one can be removed at once.

Ray listens on all interfaces, so whoever uses it here has to be in a network of its own
(``benchmarks.loopback_only``).
"""

from __future__ import annotations

import os
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from carstage.execution.ray_slots import OFF
from carstage.server.ports import free_port

_START_S = 90.0
_END_S = 10.0
_MB = 1_000_000


class RayNodes:
    """The nodes of a cluster: a head, which takes no worker, and others with one core each.

    Args:
        environment: variables that workers are to have.
        folder: for logs.
    """

    def __init__(self, environment: Mapping[str, str], folder: Path) -> None:
        self.variables = {
            **dict.fromkeys(OFF, "0"),
            "RAY_TMPDIR": tempfile.gettempdir(),  # names of sockets are short
            "RAY_raylet_start_wait_time_s": f"{_START_S:.0f}",
            "RAY_AUTH_MODE": "token",
            "RAY_AUTH_TOKEN": secrets.token_hex(32),
        }
        """What whoever uses the cluster has to have in its environment."""
        self._environment = {**os.environ, **environment, **self.variables}
        self._folder = folder
        self._nodes: list[psutil.Popen] = []
        self.address = f"127.0.0.1:{free_port()}"

    def start(self, count: int) -> None:
        """Start the head and so many nodes, and wait until they can take work.

        Raises:
            RuntimeError: one does not start; with the end of what it said.
        """
        head = ("--head", "--port", self.address.rpartition(":")[2], "--num-cpus", "0")
        self._start(*head, "--include-dashboard", "false")
        self._wait_for(1)
        for number in range(count):
            self._start("--address", self.address, "--num-cpus", "1")
            self._wait_for(2 + number)

    def processes(self) -> list[psutil.Process]:
        """All processes of the nodes but for the head's own."""
        return [one for node in self._nodes[1:] for one in _below(node)]

    def remove(self) -> None:
        """Kill all processes of the last node, as a machine that loses its power."""
        node = self._nodes.pop()
        _kill([*_below(node), node])

    def end(self) -> None:
        """End all nodes."""
        while self._nodes:
            self.remove()

    def _start(self, *options: str) -> None:
        log = (self._folder / f"ray-{len(self._nodes)}.log").open("wb")
        program = [sys.executable, "-m", "ray.scripts.scripts", "start", *options, "--block"]
        program += ["--node-ip-address", "127.0.0.1"]
        program += ["--object-store-memory", str(100 * _MB), "--disable-usage-stats"]
        with log:
            node = psutil.Popen(
                program,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=self._environment,
                start_new_session=True,
            )
        self._nodes.append(node)

    def _wait_for(self, count: int) -> None:
        """Wait until so many nodes are in the cluster."""
        deadline_s = time.monotonic() + _START_S
        program = "import ray, sys; ray.init(address=sys.argv[1], log_to_driver=False); "
        program += "print(sum(node['Alive'] for node in ray.nodes()))"
        while True:
            asked = subprocess.run(
                [sys.executable, "-c", program, self.address],
                env=self._environment,
                capture_output=True,
                text=True,
                stdin=subprocess.DEVNULL,
            )
            if asked.stdout.strip() == str(count):
                return
            ended = any(node.poll() is not None for node in self._nodes)
            if ended or time.monotonic() > deadline_s:
                logs = [path.read_text("utf-8", "replace")[-800:] for path in self._logs()]
                raise RuntimeError("\n".join([asked.stderr[-800:], *logs]))

    def _logs(self) -> list[Path]:
        return sorted(self._folder.glob("ray-*.log"))


@contextmanager
def ray_nodes(count: int, environment: Mapping[str, str], folder: Path) -> Iterator[RayNodes]:
    """A cluster with so many nodes beside its head; it is gone afterwards."""
    nodes = RayNodes(environment, folder)
    try:
        nodes.start(count)
        yield nodes
    finally:
        nodes.end()


def _below(process: psutil.Process) -> list[psutil.Process]:
    with suppress(psutil.Error):
        return list(process.children(recursive=True))
    return []


def _kill(processes: list[psutil.Process]) -> None:
    for process in processes:
        with suppress(psutil.Error):
            process.kill()
    psutil.wait_procs(processes, timeout=_END_S)
