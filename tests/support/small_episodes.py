"""Committed episodes with documents and small label tables, and no sensor data."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import analytic_scene
from carstage.storage import CommitMarker, LocalStore

VERSIONS = {"client": "0.9.16", "server": "0.9.16"}
FRAMES = 4


def add_episode(
    folder: Path,
    episode_id: str,
    *,
    town: str = "Stage01",
    weather: str = "ClearNoon",
    sensors: Sequence[str] = ("rgb",),
    objects: Mapping[str, int] | None = None,
    attempt: str = "a1",
    rows_of_group: int | None = None,
    commit: bool = True,
    planned: Mapping[str, Any] | None = None,
) -> CommitMarker | None:
    """Add one to a dataset, which is made if it is missing.

    Args:
        folder: of the dataset.
        episode_id: of the episode.
        town, weather: of its spec.
        sensors: kinds of the rig.
        objects: how many of each class stand in each of the four frames.
        attempt: name of the attempt.
        rows_of_group: of the table of objects; default: all in one group.
        commit: else the attempt stays one.
        planned: its spec as a plan has it, in place of ``town`` and ``weather``.
    """
    store = LocalStore(folder)
    if not (folder / "dataset.json").exists():
        store.initialise("small")
    place = store.attempt_folder(episode_id, attempt)
    spec = analytic_scene.spec(steps=FRAMES)
    spec |= {"map": town, "weather": {**spec["weather"], "preset": weather}}
    if planned is not None:
        spec = dict(planned)
    header = analytic_scene.header(spec, attempt=attempt, ticks_per_segment=1)
    (place / "episode.json").write_text(json.dumps({**header, "episode_id": episode_id}))
    (place / "calibration.json").write_text(json.dumps(_calibration(sensors)))
    rows = _objects(episode_id, {"car": 2} if objects is None else objects)
    pq.write_table(rows, place / "objects.parquet", row_group_size=rows_of_group or len(rows))
    ids = [episode_id] * FRAMES
    table = pa.table({"k": list(range(FRAMES)), "episode_id": ids, "speed": np.arange(4.0)})
    pq.write_table(table, place / "ego.parquet")
    if not commit:
        return None
    return store.commit(episode_id, attempt, frames=FRAMES, versions=VERSIONS)


def _calibration(kinds: Sequence[str]) -> dict[str, Any]:
    unit = np.eye(4).tolist()
    return {
        "format_version": 1,
        "ego_box": {"location": [0, 0, 0], "extent": [2, 1, 1], "rotation_deg": [0, 0, 0]},
        "sensors": {
            kind.upper(): {
                "kind": kind,
                "blueprint": f"sensor.{kind}",
                "attributes": {},
                "attach_to": "ego",
                "attachment": "rigid",
                "carrier_from_sensor": unit,
                "ego_from_sensor": unit,
                "files": "png",
                "labelled": kind == "rgb",
                "depth": None,
                "instance": None,
            }
            for kind in kinds
        },
    }


def _objects(episode_id: str, counts: Mapping[str, int]) -> pa.Table:
    rows = [
        {
            "k": k,
            "track_id": 100 * place + number,
            "episode_id": episode_id,
            "class": name,
            "is_ego": False,
            "distance_ego": 5.0 + number + k,
        }
        for k in range(FRAMES)
        for place, (name, count) in enumerate([("ego", 1), *counts.items()])
        for number in range(count)
    ]
    for row in rows:
        if row["class"] == "ego":
            row |= {"class": "car", "is_ego": True, "distance_ego": None}
    return pa.Table.from_pylist(rows)
