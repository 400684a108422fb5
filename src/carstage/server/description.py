"""What the embedded simulator offers, known without starting it."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from carstage import __version__
from carstage.cache import cache_folder, keep_in_cache
from carstage.errors import ServerError
from carstage.releases import NEWEST
from carstage.sensor_kinds import simulator_plugins
from carstage.server.embedded import MODULE, START_S, plugin_options

DESCRIBE_S = 120.0


@dataclass(frozen=True, slots=True)
class BlueprintDescription:
    """One blueprint: its id, tags and attributes with their default values as texts.

    Attributes:
        recommended: by attribute, the values that the server recommends.
    """

    id: str
    tags: tuple[str, ...]
    attributes: Mapping[str, str]
    recommended: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SimulatorDescription:
    """What a server offers.

    Attributes:
        protocol: the CARLA version that it speaks.
        maps: map name, without folders, to the number of its spawn points.
        blueprints: by id.
        limits: largest values of sensors' attributes by name, and of a picture's ``pixels``.
    """

    protocol: str
    maps: Mapping[str, int]
    blueprints: Mapping[str, BlueprintDescription]
    limits: Mapping[str, float] = field(default_factory=dict)


@lru_cache(maxsize=8)
def describe_embedded(
    folder: Path | None = None, carla_version: str = str(NEWEST)
) -> SimulatorDescription:
    """Maps and blueprints of the embedded simulator.

    The answer is kept in memory and on disk, there by a fingerprint of the simulator's code.

    Args:
        folder: where it is kept; None uses :func:`cache_folder`.
        carla_version: the version of CARLA that it is to speak.

    Raises:
        ServerError: the simulator could not describe itself.
    """
    folder = folder or cache_folder()
    path = folder / f"simulator-{code_fingerprint()}.json"
    try:
        return _parse(json.loads(path.read_text("utf-8")), carla_version)
    except (OSError, ValueError, KeyError, TypeError):
        pass  # not there yet, or not whole: ask, and write it anew
    text = _ask()
    try:
        description = _parse(json.loads(text), carla_version)
    except (ValueError, KeyError, TypeError) as error:
        raise ServerError(
            f"The embedded simulator's description cannot be read: {error!r}.",
            f"Compare with the output of `python -m {MODULE} --describe`.",
        ) from error
    keep_in_cache(path, text)
    return description


def ask_embedded(
    option: str, name: str, folder: Path | None = None, *, own_map: Path | None = None
) -> dict[str, Any]:
    """What the embedded simulator prints for a question; kept on disk like its description.

    Args:
        option: ``--vehicle`` or ``--lanes``.
        name: of a vehicle's blueprint or a map, as the description has it.
        folder: where it is kept; None uses :func:`cache_folder`.
        own_map: the OpenDRIVE file of the map; the simulator makes the town, which takes a while.

    Raises:
        ServerError: the simulator did not answer.
        OSError: the file cannot be read.
    """
    question = [option, name]
    key, limit_s = name, DESCRIBE_S
    if own_map is not None:
        question += ["--maps", str(own_map)]
        key = f"{name}-{hashlib.sha256(own_map.read_bytes()).hexdigest()[:16]}"
        limit_s = START_S
    path = (folder or cache_folder()) / f"simulator-{code_fingerprint()}{option[1:]}-{key}.json"
    try:
        kept: dict[str, Any] = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        pass  # not there yet, or not whole
    else:
        return kept
    text = _ask(*question, limit_s=limit_s)
    try:
        answer: dict[str, Any] = json.loads(text)
    except ValueError as error:
        raise ServerError(f"The embedded simulator's answer cannot be read: {error!r}.") from error
    keep_in_cache(path, text)
    return answer


def _ask(*question: str, limit_s: float = DESCRIBE_S) -> str:
    command = [sys.executable, "-m", MODULE, *plugin_options(), *(question or ("--describe",))]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit_s, check=False)
    except subprocess.TimeoutExpired as error:
        raise ServerError(f"The embedded simulator said nothing for {limit_s:g} s.") from error
    except OSError as error:  # no process or memory left; the environment changed meanwhile
        raise ServerError(f"The embedded simulator cannot be started: {error}.") from error
    if done.returncode != 0:
        raise ServerError(
            f"The embedded simulator does not answer (exit status {done.returncode}):\n"
            f"{done.stderr[-2000:]}",
            f"Run `{' '.join(['python', *command[1:]])}`.",
        )
    return done.stdout


def _parse(document: Mapping[str, Any], carla_version: str) -> SimulatorDescription:
    """What a document says of one of the versions that the simulator speaks."""
    if carla_version not in document["protocols"]:
        raise ValueError(f"it speaks {document['protocols']}, not {carla_version}")
    return SimulatorDescription(
        protocol=carla_version,
        maps={entry["name"]: int(entry["spawn_points"]) for entry in document["maps"]},
        limits={name: float(value) for name, value in document["limits"].items()},
        blueprints={
            entry["id"]: BlueprintDescription(
                id=entry["id"],
                tags=tuple(entry["tags"]),
                attributes={
                    attribute["id"]: str(attribute["default"]) for attribute in entry["attributes"]
                },
                recommended={
                    attribute["id"]: tuple(map(str, attribute["recommended"]))
                    for attribute in entry["attributes"]
                },
            )
            for entry in document["blueprints"]
            if carla_version in entry["protocols"]
        },
    )


def code_fingerprint(*packages: str) -> str:
    """Changes with every edit of the simulator's code or a plug-in's, without importing it.

    Args:
        packages: further ones whose code counts.
    """
    digest = hashlib.sha256(f"{__version__} {sys.version}".encode())
    for name in (MODULE, *simulator_plugins(), *packages):
        spec = find_spec(name)
        files = [] if spec is None or spec.origin is None else [Path(spec.origin)]
        for location in (spec.submodule_search_locations or ()) if spec is not None else ():
            files += sorted(Path(location).rglob("*.py"))
        for file in files:
            status = file.stat()
            digest.update(f"{file} {status.st_size} {status.st_mtime_ns}\n".encode())
    return digest.hexdigest()[:16]
