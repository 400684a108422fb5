"""Datasets of the analytic scene: converted and committed, then damaged in one place."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

import analytic_scene
from carstage.conversion import EpisodeConversion
from carstage.dataset.tables import read_table, write_table
from carstage.files.hashing import hash_of
from carstage.geometry import GeoFrame
from carstage.storage import FolderFiles, LocalStore
from carstage.vector_map import to_table, vector_map
from carstage.vector_map.table import GEO_KEY

SIZE = (192, 128)
_ANGLES = ("roll_deg", "pitch_deg", "yaw_deg")
VERSIONS = {"client": "0.9.16", "server": "0.9.16"}


def convert(raw_folder: Path, attempt_folder: Path, **options: Any) -> EpisodeConversion:
    """Convert a whole raw log in threads."""
    with ThreadPoolExecutor(2) as pool:
        conversion = EpisodeConversion(raw_folder, FolderFiles(attempt_folder), pool, **options)
        conversion.finish()
    return conversion


def make_dataset(folder: Path, work: Path, **options: Any) -> Path:
    """A dataset of one episode; returns ``folder``."""
    header = analytic_scene.write_raw_log(work / "raw", **{"size": SIZE, **options})
    store = LocalStore(folder)
    store.initialise("analytic <scene>")
    convert(work / "raw", store.attempt_folder(header["episode_id"], "a1"))
    store.keep_map(analytic_scene.OPENDRIVE.encode())
    frames = -(-header["ticks"] // header["spec"]["save_every"])
    store.commit(header["episode_id"], "a1", frames=frames, versions=VERSIONS)
    return folder


def make_watched(folder: Path, work: Path) -> Path:
    """A dataset whose CAM_FRONT stands on the map, behind the ego; returns ``folder``."""
    spec = analytic_scene.spec
    place = {"x_m": -8.0, "z_m": 3.0, **dict.fromkeys(("y_m", *_ANGLES), 0.0)}

    def watched(**options: Any) -> dict[str, Any]:
        document = spec(**options)
        for sensor in document["sensors"]:
            if sensor["id"].endswith("_FRONT"):
                sensor |= {"attach_to": "world", "pose": place}
        return document

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analytic_scene, "spec", watched)
        return make_dataset(folder, work, steps=2)


def add_episode(folder: Path, work: Path, episode_id: str, steps: int) -> None:
    """Record the scene once more, under another id."""
    header = analytic_scene.header
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            analytic_scene, "header", lambda *a, **k: {**header(*a, **k), "episode_id": episode_id}
        )
        analytic_scene.write_raw_log(work / episode_id, size=SIZE, steps=steps)
    store = LocalStore(folder)
    convert(work / episode_id, store.attempt_folder(episode_id, "a1"))
    store.keep_map(analytic_scene.OPENDRIVE.encode())
    store.commit(episode_id, "a1", frames=steps, versions=VERSIONS)


def bare_dataset(folder: Path, weathers: Mapping[str, str], *, maps: Mapping[str, str]) -> Path:
    """A dataset of episodes without any data, by id their weather preset and map."""
    store = LocalStore(folder)
    store.initialise("bare")
    for episode_id, preset in weathers.items():
        spec = analytic_scene.spec(steps=1)
        spec |= {"map": maps[episode_id], "weather": {**spec["weather"], "preset": preset}}
        header = analytic_scene.header(spec, attempt="a1", ticks_per_segment=1)
        document = {**header, "episode_id": episode_id}
        path = store.attempt_folder(episode_id, "a1") / "episode.json"
        path.write_text(json.dumps(document))
        store.commit(episode_id, "a1", frames=1, versions=VERSIONS)
    return folder


def attempt_of(dataset: Path) -> Path:
    """The folder of the only episode's committed attempt."""
    return next((dataset / "episodes").glob("*/*"))


def recommit(dataset: Path, attempt: Path | None = None) -> None:
    """Make the marker fit the files as they are, so that only what they mean can be wrong."""
    folder = attempt or attempt_of(dataset)
    marker = dataset / "commits" / f"{folder.parent.name}.json"
    document = json.loads(marker.read_text())
    document["files"] = [
        {
            "path": path.relative_to(folder).as_posix(),
            "bytes": path.stat().st_size,
            "hash": hash_of(path.read_bytes()),
        }
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    ]
    marker.write_text(json.dumps(document))


def edit_rows(
    dataset: Path, name: str, edit: Callable[[list[dict[str, Any]]], list[dict[str, Any]]]
) -> None:
    """Rewrite the rows of a table and commit again."""
    path = attempt_of(dataset) / name
    table = read_table(path)
    write_table(pa.Table.from_pylist(edit(table.to_pylist()), schema=table.schema), path)
    recommit(dataset)


def add_vector_map(dataset: Path, opendrive: str) -> None:
    """Give the only episode the vector map of a text, as a run does."""
    give_vector_map(dataset, attempt_of(dataset), opendrive)


def give_vector_map(dataset: Path, attempt: Path, opendrive: str) -> None:
    """Give an episode the vector map of a text."""
    path = attempt / "episode.json"
    document = json.loads(path.read_text())
    table = to_table(vector_map(opendrive), GeoFrame.from_json(document["geo_reference"]))
    file = path.with_name("map.parquet")
    write_table(table, file, keep=(GEO_KEY,))
    named = LocalStore(dataset).keep_map(file.read_bytes(), "parquet")
    file.unlink()
    path.write_text(json.dumps({**document, "vector_map": named, "vector_map_problem": None}))
    recommit(dataset, attempt)
