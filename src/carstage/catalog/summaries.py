"""From a committed episode to the rows that a catalog keeps of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from carstage.dataset import Episode
from carstage.dataset.tables import require_columns
from carstage.files.hashing import hash_of
from carstage.storage import CommitMarker, FileEntry

Row = dict[str, Any]
FRAMES_WITH: Final = (1, 3, 5, 10)
"""Numbers of objects for which the frames that have as many are counted."""
_COLUMNS: Final = ("k", "track_id", "class", "is_ego", "distance_ego")


@dataclass(frozen=True, slots=True)
class EpisodeRows:
    """What a catalog keeps of an episode, by table; ids of rows are not known yet.

    Attributes:
        episode: the row of ``episodes`` without ``dataset``, ``run_id`` and ``split``.
        sensors, artifacts, label_summaries: rows without ``episode``.
    """

    episode: Row
    sensors: tuple[Row, ...]
    artifacts: tuple[Row, ...]
    label_summaries: tuple[Row, ...]


def rows_of(episode: Episode) -> EpisodeRows:
    """Read an episode's documents and its table of objects.

    Raises:
        DatasetError: one of them is missing or damaged.
    """
    marker, spec = episode.marker, episode.spec
    tested = marker.self_test
    return EpisodeRows(
        {
            "episode_id": episode.id,
            "attempt": marker.attempt,
            "marker_hash": hash_of_marker(marker),
            "frames": marker.frames,
            "duration_s": spec.steps / spec.fps,
            "files": len(marker.files),
            "bytes": sum(entry.bytes for entry in marker.files),
            "map": spec.map,
            "weather": spec.weather.preset,
            "variant": episode.variant,
            "base_id": None if episode.variant is None else episode.base_id,
            "scenario": spec.scenario.kind,
            "carstage": marker.versions.get("carstage"),
            "client": marker.versions.get("client"),
            "server": marker.versions.get("server"),
            "self_test": None if tested is None else bool(tested.get("ok")),
        },
        tuple(
            {
                "sensor_id": _whose(view) + sensor.id,
                "kind": sensor.kind,
                "width": sensor.width,
                "height": sensor.height,
                "labelled": sensor.labelled,
            }
            for view in episode.views
            for sensor in view.calibration.sensors.values()
        ),
        tuple(artifacts_of(marker)),
        tuple(_label_summaries(episode)),
    )


def _whose(view: Episode) -> str:
    """What stands before ids of an agent's sensors."""
    return "" if view.agent_name is None else f"{view.agent_name}."


def hash_of_marker(marker: CommitMarker) -> str:
    """The named hash of a marker's content; it differs where any file of the episode does."""
    return hash_of(marker.to_bytes())


def artifacts_of(marker: CommitMarker) -> Iterable[Row]:
    """The files of an episode: its documents and tables one by one, a sensor's frames as one row.

    The hash of a row of several files is that of their lines in the marker. So a catalog has some
    twenty rows of an episode, and not thousands.
    """
    groups: dict[str, list[FileEntry]] = {}
    for entry in marker.files:
        folder, _, _ = entry.path.rpartition("/")
        groups.setdefault(entry.path if folder in ("", "sensors") else folder, []).append(entry)
    for path, entries in sorted(groups.items()):
        named = entries[0].hash
        if entries[0].path != path:
            lines = (f"{entry.path} {entry.bytes} {entry.hash}\n" for entry in entries)
            named = hash_of("".join(lines).encode())
        yield {
            "path": path,
            "files": len(entries),
            "bytes": sum(entry.bytes for entry in entries),
            "hash": named,
        }


def _label_summaries(episode: Episode) -> Iterable[Row]:
    """One row for each class of objects but the ego, sorted by class."""
    table = episode.objects()
    require_columns(table, _COLUMNS, "objects.parquet")
    others = ~table["is_ego"].to_numpy()
    # As objects: PyArrow's own filters differ between versions in how they treat null.
    classes = np.asarray(table["class"].to_pylist(), dtype=object)[others]
    frames = table["k"].to_numpy()[others]
    tracks = table["track_id"].to_numpy()[others]
    distances = table["distance_ego"].to_numpy().astype(np.float64)[others]
    for name in sorted(set(classes)):
        of_class = classes == name
        _, per_frame = np.unique(frames[of_class], return_counts=True)
        known = distances[of_class]
        known = known[~np.isnan(known)]
        yield {
            "class": name,
            "tracks": len(np.unique(tracks[of_class])),
            "rows": int(of_class.sum()),
            **{f"frames_{least}": int((per_frame >= least).sum()) for least in FRAMES_WITH},
            "most_in_frame": int(per_frame.max()),
            "nearest_m": float(known.min()) if len(known) else None,
        }
