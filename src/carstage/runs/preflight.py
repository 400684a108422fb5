"""What is checked before anything is recorded, for a run and for whoever only asks."""

from __future__ import annotations

import os
import re
import resource
import shutil
import socket
import tempfile
from pathlib import Path
from typing import Literal

from carstage.cache import cache_folder
from carstage.config import Config
from carstage.config.dimensions import maps_of
from carstage.config.drivers import ReplayDriver
from carstage.config.fields import unknown
from carstage.config.own_maps import own_maps
from carstage.config.patches import check_patch_files
from carstage.config.scene import (
    LogScenario,
    OpenScenarioScenario,
    ReplayScenario,
    ScenicScenario,
    map_name,
)
from carstage.config.servers import (
    CarlaServerConfig,
    ClassServerConfig,
    EmbeddedServerConfig,
    RemoteServerConfig,
)
from carstage.errors import BadInputError, ConfigError
from carstage.files.hashing import hash_of
from carstage.files.home import without_tilde
from carstage.plan import (
    EpisodePlan,
    RunEstimate,
    ServerFacts,
    Source,
    plan_episodes,
)
from carstage.runs.programs import read_program
from carstage.runs.server_lock import server_lock
from carstage.runs.servers import ServerSetup
from carstage.server import check_ports_free
from carstage.server.embedded import PORTS
from carstage.server.interpreters import AUTO, check_interpreter
from carstage.server.ports import BLOCK
from carstage.server.release import find_script
from carstage.storage import DatasetPath, RemotePath, local_folder

_RESERVE = 1.1
_OPEN_FILES = 1024
_FEWEST_OPEN_FILES = 256
_ANY_SPAWN_POINT = 1 << 30
"""Of a map of which nobody knows how many it has."""
_UNITS = ("B", "kB", "MB", "GB", "TB", "PB")


def size_text(size_bytes: float) -> str:
    """A size with a decimal unit, such as ``482 MB``."""
    size = float(size_bytes)
    for unit in _UNITS:
        if size < 1000 or unit == _UNITS[-1]:
            return f"{size:.0f} {unit}" if size >= 10 or unit == "B" else f"{size:.1f} {unit}"
        size /= 1000
    raise AssertionError


def check_before_server(config: Config, *, offline: bool = False) -> None:
    """Refuse what can be known to be wrong without the server.

    Args:
        config: the configuration.
        offline: leave out whether a remote server is there.

    Raises:
        BadInputError: with the field's path.
    """
    check_codecs(config)
    if not (offline and isinstance(config.server, RemoteServerConfig)):
        check_server(config)
    if not isinstance(config.server, ClassServerConfig) and config.server.client_python != AUTO:
        check_interpreter(without_tilde(config.server.client_python))
    own_maps(config)
    check_patch_files(config)
    recording_of(config)


def judge(config: Config, *, offline: bool = False) -> EpisodePlan:
    """The episodes that a run of a configuration would record, or why it would refuse.

    The embedded simulator describes itself without being started. Another server is asked, which
    starts a CARLA release; ``offline`` leaves that out, and with it what only the server knows.

    Raises:
        BadInputError: with the field's path.
        ServerError: the server does not start or answer.
    """
    check_before_server(config, offline=offline)
    recording = recording_of(config)
    if offline and not isinstance(config.server, EmbeddedServerConfig):
        names = [*maps_of(config), *([] if recording is None else [recording.map])]
        maps = {map_name(name) for name in names}
        facts = ServerFacts(maps=dict.fromkeys({*maps, "any"}, _ANY_SPAWN_POINT))
        return plan_episodes(config, facts, recording)
    with server_lock(config), ServerSetup(config).facts() as facts:
        return plan_episodes(config, facts, recording)


def check_output(out: Path) -> None:
    """Refuse an output folder that cannot be written to; nothing is created.

    Raises:
        BadInputError: it is a file, or it (or the folder that it would be made in) is not writable.
    """
    try:
        os.fspath(out).encode("utf-8")
    except UnicodeEncodeError as error:
        raise BadInputError(
            f"output: {os.fspath(out)!r} is no UTF-8 text as Python reads it here.",
            "Choose another --out, or set PYTHONUTF8=1 if this locale is not the path's.",
        ) from error
    existing = _existing(out)
    if not existing.is_dir():
        raise BadInputError(f"output: {existing} is not a folder.", "Choose another --out.")
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise BadInputError(
            f"output: {existing} is not writable: {error.strerror}.",
            "Choose another --out or change the folder's permissions.",
        ) from error


def check_open_files() -> None:
    """Let this process and its children open as many files as a run needs.

    Raises:
        BadInputError: that is not allowed.
    """
    allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _OPEN_FILES if most == resource.RLIM_INFINITY else min(_OPEN_FILES, most)
    if 0 <= allowed < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))
    if wanted < _FEWEST_OPEN_FILES:
        raise BadInputError(
            f"Only {most} files may be open at once here; a run needs {_FEWEST_OPEN_FILES}.",
            f"Raise the limit, as by `ulimit -n {_OPEN_FILES}`.",
        )


def work_folder(root: DatasetPath, work: Path | str | None) -> Path:
    """The folder of this machine for raw recordings, logs and the state of runs.

    Args:
        root: of the dataset.
        work: what the user chose; None: the dataset's folder, or for an object store one in the
            user's cache, which is the same one every time.

    Raises:
        BadInputError: ``work`` is no folder of this machine.
    """
    if work is not None:
        return local_folder(work).absolute()
    if isinstance(root, RemotePath):
        readable = re.sub(r"[^A-Za-z0-9]+", "-", root.root)[:60]
        return cache_folder() / "runs" / f"{readable}-{hash_of(root.root.encode())[-12:]}"
    return root.absolute()


def check_disk(
    work: Path,
    estimate: RunEstimate,
    *,
    dataset_elsewhere: bool = False,
    what: str = "the run needs",
) -> None:
    """Refuse a run that will not fit on the disk.

    Args:
        work: folder of the run.
        estimate: of the run.
        dataset_elsewhere: only raw recordings need room here.
        what: needs the room, in words.

    Raises:
        BadInputError: the estimate is above the free space.
    """
    free_bytes = shutil.disk_usage(_existing(work)).free
    dataset_bytes = 0 if dataset_elsewhere else estimate.dataset_bytes
    peak_bytes = disk_need(estimate, dataset_elsewhere=dataset_elsewhere)
    if not fits(peak_bytes, free_bytes):
        raise BadInputError(
            f"output: {what} about {size_text(peak_bytes)} "
            f"({size_text(dataset_bytes)} of them for the dataset), but only "
            f"{size_text(free_bytes)} are free at {work}.",
            "Record fewer or shorter episodes or smaller images, or choose another --out.",
        )


def disk_need(estimate: RunEstimate, *, dataset_elsewhere: bool = False) -> int:
    """The most that a run has on the disk of its work folder at once, bytes.

    Args:
        estimate: of the run.
        dataset_elsewhere: only raw recordings need room there.
    """
    return estimate.peak_bytes - (estimate.dataset_bytes if dataset_elsewhere else 0)


def fits(need_bytes: int, free_bytes: int) -> bool:
    """Whether a run is begun where so much is free."""
    return need_bytes * _RESERVE <= free_bytes


def check_server(config: Config) -> None:
    """Refuse ports that are taken and a CARLA folder without a server.

    Raises:
        BadInputError: with the field's path.
    """
    server = config.server
    if isinstance(server, CarlaServerConfig):
        find_script(without_tilde(server.path))
        _check_ports(server.port, BLOCK)
    if isinstance(server, EmbeddedServerConfig):
        _check_ports(server.port, PORTS)
    if isinstance(server, RemoteServerConfig):
        _check_remote(server)


def check_codecs(config: Config) -> None:
    """Refuse codecs that do not exist for their sensor's kind.

    Raises:
        ConfigError: with the field's path.
    """
    from carstage.codecs import codec_names

    for _, sensor in config.sensors_of_all_variants():
        codec = config.conversion.codecs.get(sensor.id)
        known = codec_names(sensor.kind)
        if codec is not None and codec not in known:
            message, hint = unknown("codec", codec, known)
            raise ConfigError(f"conversion.codecs.{sensor.id}: {message}", hint)


def recording_of(config: Config, folder: Path | None = None) -> Source | None:
    """The recorded episode, log or program that scenario or driver plays; None for others.

    Args:
        config: the configuration.
        folder: what the path of a log or program is relative to; None: the working directory.

    Raises:
        ConfigError: there is no such episode or log.
    """
    if isinstance(config.ego.driver, ReplayDriver):
        from carstage.dataset.drives import read_drive

        return read_drive(config.ego.driver.episode)
    if isinstance(config.scenario, ScenicScenario | OpenScenarioScenario):
        return read_program(config.scenario, folder)
    if isinstance(config.scenario, LogScenario):
        from carstage.dataset.recorder_log import read_log

        return read_log(config.scenario, folder)
    if not isinstance(config.scenario, ReplayScenario):
        return None
    from carstage.dataset.trajectories import read_recording

    return read_recording(config.scenario.episode)


def _existing(path: Path) -> Path:
    """The path, or its nearest parent that exists."""
    path = without_tilde(path).absolute()
    while not path.exists() and path != path.parent:
        path = path.parent
    return path


def _check_ports(first: int | Literal["auto"], count: int) -> None:
    if first != "auto":
        check_ports_free(range(first, first + count))


def _check_remote(server: RemoteServerConfig) -> None:
    try:
        socket.create_connection((server.host, server.port), timeout=5.0).close()
    except (OSError, UnicodeError) as error:  # the latter where a name cannot be one
        raise ConfigError(
            f"server.host: nothing answers at {server.host}:{server.port} ({error}).",
            "Start CARLA there, or correct host and port.",
        ) from error
