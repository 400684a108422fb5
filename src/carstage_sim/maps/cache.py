"""Baked towns on disk: one ``.npz`` per content, written atomically."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import importlib.metadata
import json
import os
import zipfile
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import carstage_sim
from carstage_sim.cache import DAY_S, DRAFTS, remove_unused, written_atomically
from carstage_sim.maps.town import (
    LaneSamples,
    LevelObject,
    OrientedBox,
    Town,
    TrafficLightSite,
    TrafficSignSite,
)
from carstage_sim.mesh import TriangleMesh

_SOURCES = ("maps", "content", "mesh.py", "labels.py", "geometry.py")
_WAYS_IN = (
    "maps/background.py",
    "maps/bake_process.py",
    "maps/catalogue.py",
    "maps/loading.py",
)
"""What leads to a bake and does not change what comes out."""
_KEPT_OF_A_NAME = 3
_MOST_BYTES = 6_000_000_000
_PACKAGES = ("carla", "numpy", "shapely")


def cached_town(name: str, opendrive: str, bake: Callable[[], Town], folder: Path) -> Town:
    """The town from the cache, or baked now and put there.

    Args:
        name: for the file's name only.
        opendrive: the map's text; with the code that bakes, it is the key.
        bake: makes the town.
        folder: created if missing.
    """
    path = town_path(name, opendrive, folder)
    try:
        town = load(path)
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        # Not there, or not whole: the bake replaces it.
        town = bake()
        save(town, path)
        prune(folder)
    else:
        _mark_used(path)
    return town


def town_path(name: str, opendrive: str, folder: Path) -> Path:
    """The file in which :func:`cached_town` keeps a town."""
    return folder / f"{_key(name, opendrive)}.npz"


def prune(folder: Path) -> None:
    """Removes towns that were not used for longest: old ones of a name, and beyond a total size.

    So are drafts of bakes that were killed.
    """
    remove_unused(folder, DRAFTS, unused_s=DAY_S)
    files = []
    for path in folder.glob("*.npz"):
        with contextlib.suppress(FileNotFoundError):  # another server prunes too
            status = path.stat()
            files.append((status.st_mtime_ns, status.st_size, path))
    kept_of: Counter[str] = Counter()
    total = 0
    for _, size, path in sorted(files, reverse=True):
        name = path.stem.rpartition("-")[0]
        if kept_of[name] < _KEPT_OF_A_NAME and total + size <= _MOST_BYTES:
            kept_of[name] += 1
            total += size
        else:
            path.unlink(missing_ok=True)


def _mark_used(path: Path) -> None:
    # A shared cache may be read-only: then its order of use stays unknown.
    with contextlib.suppress(OSError):
        os.utime(path)


def _key(name: str, opendrive: str) -> str:
    # A client's text may hold what is no character; it is refused when it is baked.
    text = f"{_code_digest()}\n{opendrive}".encode(errors="surrogatepass")
    digest = hashlib.sha256(text).hexdigest()
    return f"{name}-{digest[:32]}"


@cache
def _code_digest() -> str:
    """Hash of all code that a bake runs, and of the versions of its geometry packages."""
    root = Path(carstage_sim.__file__).parent
    digest = hashlib.sha256()
    for package in _PACKAGES:
        digest.update(f"{package} {importlib.metadata.version(package)}\n".encode())
    for entry in _SOURCES:
        path = root / entry
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            relative = file.relative_to(root).as_posix()
            if relative not in _WAYS_IN:
                digest.update(relative.encode())
                digest.update(file.read_bytes())
    return digest.hexdigest()


def arrays_of(town: Town) -> dict[str, NDArray[Any]]:
    """Everything in a town but its digest, as arrays."""
    record = {
        "name": town.name,
        "opendrive": town.opendrive,
        "geo_reference": town.geo_reference,
        "traffic_lights": [dataclasses.asdict(site) for site in town.traffic_lights],
        "traffic_signs": [dataclasses.asdict(site) for site in town.traffic_signs],
        "level_objects": [dataclasses.asdict(entry) for entry in town.level_objects],
    }
    text = json.dumps(record, sort_keys=True).encode()
    arrays: dict[str, NDArray[Any]] = {
        "record": np.frombuffer(text, dtype=np.uint8),
        "spawn_points": town.spawn_points,
        "navigation": np.frombuffer(town.navigation, dtype=np.uint8),
    }
    for prefix, part in (("lanes", town.lanes), ("mesh", town.static_mesh)):
        for field in dataclasses.fields(part):
            arrays[f"{prefix}.{field.name}"] = getattr(part, field.name)
    return arrays


def digest_of(town: Town) -> str:
    """sha256 (hex) of all that a town holds."""
    digest = hashlib.sha256()
    for key, array in sorted(arrays_of(town).items()):
        digest.update(f"{key} {array.dtype.str} {array.shape}\n".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def save(town: Town, path: Path) -> None:
    """Writes a town so that a reader sees the whole file or none."""
    with written_atomically(path) as file:
        np.savez(file, allow_pickle=False, digest=np.array(town.digest), **arrays_of(town))


def load(path: Path) -> Town:
    """Reads what :func:`save` wrote.

    Raises:
        OSError: if the file is missing; KeyError, ValueError or BadZipFile if it is not whole.
    """
    # numpy leaves a file that it opened itself open when it turns out not to be whole.
    with path.open("rb") as file, np.load(file) as arrays:
        record = json.loads(arrays["record"].tobytes())
        return Town(
            name=record["name"],
            opendrive=record["opendrive"],
            geo_reference=(record["geo_reference"][0], record["geo_reference"][1]),
            spawn_points=arrays["spawn_points"],
            lanes=LaneSamples(
                **{f.name: arrays[f"lanes.{f.name}"] for f in dataclasses.fields(LaneSamples)}
            ),
            traffic_lights=tuple(_light(site) for site in record["traffic_lights"]),
            navigation=arrays["navigation"].tobytes(),
            static_mesh=TriangleMesh(
                **{f.name: arrays[f"mesh.{f.name}"] for f in dataclasses.fields(TriangleMesh)}
            ),
            level_objects=tuple(
                LevelObject(**{**entry, "box": _box(entry["box"])})
                for entry in record["level_objects"]
            ),
            digest=str(arrays["digest"]),
            traffic_signs=tuple(_sign(site) for site in record["traffic_signs"]),
        )


def _box(entry: dict[str, list[float]]) -> OrientedBox:
    return OrientedBox(**{key: (v[0], v[1], v[2]) for key, v in entry.items()})


def _sign(entry: dict[str, Any]) -> TrafficSignSite:
    return TrafficSignSite(
        sign_id=entry["sign_id"],
        type_id=entry["type_id"],
        location=tuple(entry["location"]),
        rotation_deg=tuple(entry["rotation_deg"]),
        trigger=tuple(_box(box) for box in entry["trigger"]),
    )


def _light(entry: dict[str, Any]) -> TrafficLightSite:
    return TrafficLightSite(
        sign_id=entry["sign_id"],
        location=tuple(entry["location"]),
        rotation_deg=tuple(entry["rotation_deg"]),
        head=tuple(entry["head"]),
        junction_id=entry["junction_id"],
        phase=entry["phase"],
        trigger=tuple(_box(box) for box in entry["trigger"]),
    )
