"""``carstage doctor``: is everything here that a run needs?"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from carstage import __version__
from carstage.cli import unsupported
from carstage.errors import CarStageError
from carstage.files.home import without_tilde
from carstage.runs import left_runs, pending_recordings, size_text
from carstage.storage import open_store

_WANTED_FREE_BYTES = 1_000_000_000
_WANTED_MEMORY_BYTES = 2_000_000_000
_CARLA_PORTS = (2000, 2001, 2002, 8000)


@dataclass(frozen=True, slots=True)
class Finding:
    """One check.

    Attributes:
        ok: False when a run would fail.
        hint: what to do, when something is to be done.
    """

    name: str
    ok: bool
    text: str
    hint: str = ""

    def to_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return asdict(self)

    def line(self) -> str:
        """For people."""
        mark = "ok  " if self.ok else "FAIL"
        return f"{mark} {self.name}: {self.text}" + (f" {self.hint}" if self.hint else "")


def examine(out: Path) -> list[Finding]:
    """All checks; ``out`` is where a dataset would be written."""
    checks: list[Callable[[], Iterator[Finding]]] = [
        _platform,
        _memory,
        _client,
        _simulator,
        _caches,
        lambda: _disk(out),
        _ports,
        _interpreters,
        lambda: _leftovers(out),
    ]
    return [finding for check in checks for finding in check()]


def server_setting(server: str) -> str:
    """The override that makes a configuration mean a server.

    Args:
        server: ``embedded``, ``HOST:PORT``, or the folder of a CARLA release.
    """
    if server == "embedded":
        return "server={kind: embedded}"
    host, colon, port = server.rpartition(":")
    if colon and port.isdigit() and "/" not in host:
        return f"server={{kind: remote, host: {json.dumps(host)}, port: {port}}}"
    return f"server={{kind: carla, path: {json.dumps(server)}}}"


def _platform() -> Iterator[Finding]:
    problem = unsupported(platform.system(), platform.machine(), sys.version_info[:2])
    text = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    yield Finding("platform", problem is None, text, problem or "")
    yield Finding("carstage", True, __version__)


def _memory() -> Iterator[Finding]:
    import psutil

    memory = psutil.virtual_memory()
    cores = len(os.sched_getaffinity(0))
    text = f"{cores} cores, {size_text(memory.available)} of {size_text(memory.total)} memory free"
    enough = memory.available >= _WANTED_MEMORY_BYTES
    hint = "" if enough else "A run of the demo needs about 2 GB: close other programs."
    yield Finding("machine", True, text, hint)


def _client() -> Iterator[Finding]:
    try:
        version = importlib.metadata.version("carla")
    except importlib.metadata.PackageNotFoundError:
        yield Finding(
            "carla client", False, "not installed.", "Install it: pip install carla==0.9.16"
        )
        return
    from carstage.server.interpreters import import_problem

    problem = import_problem(Path(sys.executable))
    if problem is None:
        yield Finding("carla client", True, version)
    else:
        yield Finding(
            "carla client", False, f"{version} cannot be imported: {problem}", "Reinstall it."
        )


def _simulator() -> Iterator[Finding]:
    from carstage.server import describe_embedded

    try:
        description = describe_embedded()
    except CarStageError as error:
        yield Finding("embedded simulator", False, error.message, error.hint)
        return
    maps = ", ".join(f"{name} ({count} spawn points)" for name, count in description.maps.items())
    text = f"{maps}; {len(description.blueprints)} blueprints"
    yield Finding("embedded simulator", True, text)


def _caches() -> Iterator[Finding]:
    from carstage.cache import CACHE_VARIABLE, cache_folder, private_folder

    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        yield Finding(
            "cache",
            False,
            f"{folder} is not writable ({error.strerror}).",
            f"Compiled kernels could not be kept; change its permissions, or set {CACHE_VARIABLE}.",
        )
        return
    if folder.is_relative_to(private_folder()):
        text = f"{folder}, as the home of this user cannot be written"
        yield Finding("cache", True, text, f"Set {CACHE_VARIABLE} to keep what is computed.")
        return
    used = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    yield Finding("cache", True, f"{folder}, {size_text(used)} used")


def _disk(out: Path) -> Iterator[Finding]:
    from carstage.runs.preflight import check_output

    try:
        check_output(out)
    except CarStageError as error:
        yield Finding("disk", False, error.message, error.hint)
        return
    existing = without_tilde(out).absolute()
    while not existing.exists():
        existing = existing.parent
    free = shutil.disk_usage(existing).free
    enough = free >= _WANTED_FREE_BYTES
    hint = "" if enough else "The demo needs about 0.5 GB; `carstage config check` says for others."
    yield Finding("disk", enough, f"{size_text(free)} free at {existing}", hint)


def _ports() -> Iterator[Finding]:
    from carstage.server.ports import is_free

    taken = [str(port) for port in _CARLA_PORTS if not is_free(port)]
    if taken:
        hint = "No matter: the embedded simulator takes free ports."
        yield Finding("ports", True, f"{', '.join(taken)} in use (by a CARLA server?).", hint)
    else:
        yield Finding("ports", True, "CARLA's usual ports are free")


def _interpreters() -> Iterator[Finding]:
    from carstage.server.interpreters import clients_here

    found = [f"{python.path} (carla {python.client})" for python in clients_here()]
    text = "; ".join(found) if found else "none besides this one"
    yield Finding("interpreters with a client wheel", True, text)


def _leftovers(out: Path) -> Iterator[Finding]:
    store = open_store(out)
    for run in left_runs(out, store):
        if run.dead:
            text = f"{run.folder} was killed and left {len(run.attempts)} unfinished attempts."
            hint = "The next run into this dataset removes them."
        else:
            text = f"The {run.describe} is silent and cannot be seen from here."
            hint = f"If it is gone for good, delete {run.folder / 'raw'}."
        yield Finding("dead run" if run.dead else "silent run", True, text, hint)
    for recording in pending_recordings(out):
        text = f"episode {recording.episode_id} is recorded and waits to be converted."
        yield Finding("pending recording", True, text, "The same command again goes on with it.")
    try:
        lost = store.lost(store.committed().values())
    except CarStageError as error:
        yield Finding("dataset", False, error.message, error.hint)
        return
    for marker in lost:
        yield Finding(
            "lost episode",
            False,
            f"Episode {marker.episode_id} was committed, and none of its files is there.",
            "The next run into this dataset records it again.",
        )
