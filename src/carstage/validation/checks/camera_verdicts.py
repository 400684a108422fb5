"""What the label tables say of how an object was seen, and whether it is visible."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from carstage.dataset.reading import Episode
from carstage.sensor_kinds.model import CLOUDS
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables

_COLUMNS = (
    "k", "track_id", "sensor_id", "visible_px", "visible_pixel", "visible_stage_vo", "visible",
    "visibility_method", "amodal_method", "instance_ambiguous", "pinhole",
)  # fmt: skip
_OBJECT_COLUMNS = ("k", "track_id", "class", "is_static", "parent_track_id", "num_lidar_points")
_VEHICLES = frozenset({"car", "van", "truck", "bus", "motorcycle", "bicycle"})
_LOW_IDS = 0xFFFF

_Row = Mapping[str, Any]


def check_camera_verdicts(episode: Episode, tables: LabelTables, findings: Findings) -> None:
    """Check methods, ``pinhole``, ``instance_ambiguous`` and ``visible`` (``camera_columns``).

    Args:
        episode: the episode.
        tables: its label tables.
        findings: where problems go.
    """
    objects: dict[int, dict[int, _Row]] = defaultdict(dict)
    for row in tables.objects.select(_OBJECT_COLUMNS).to_pylist():
        objects[row["k"]][row["track_id"]] = row
    shared = {k: _shared_low_ids(rows.values()) for k, rows in objects.items()}
    measuring = {
        k: frozenset(name for row in rows.values() for name, _ in row["num_lidar_points"] or ())
        for k, rows in objects.items()
    }
    sensors = {sensor.id: sensor.calibration for sensor in episode.sensors}
    beside = _lidars_beside(episode)
    problems: dict[str, list[_Row]] = defaultdict(list)
    for row in tables.camera_objects.select(_COLUMNS).to_pylist():
        frame = objects[row["k"]]
        own, camera = frame.get(row["track_id"]), sensors.get(row["sensor_id"])
        if own is None or camera is None:
            continue  # the check of references says so
        wrong = [*_wrong_methods(row, own, counted=episode.spec.labels.pixels)]
        if row["pinhole"] != camera.is_pinhole:
            wrong.append("pinhole")
        is_shared = own["class"] != "rider" and row["track_id"] & _LOW_IDS in shared[row["k"]]
        # Actors without labels share bits, too: only its absence can be refuted, but for things
        # of the map, of which no pixel tells an id.
        if own["is_static"] and row["instance_ambiguous"]:
            wrong.append("instance_ambiguous")
        if is_shared and not (own["is_static"] or row["instance_ambiguous"]):
            wrong.append("instance_ambiguous")
        verdict = row["visible_pixel" if episode.spec.labels.pixels else "visible_stage_vo"]
        lidars = measuring[row["k"]].intersection(beside[camera.id])
        enough = _has_points(own, frame, lidars, episode.spec.min_lidar_points)
        if row["visible"] != (bool(verdict) and enough):
            wrong.append("visible")
        for column in wrong:
            problems[column].append(row)
    for column, rows in problems.items():
        findings.add(
            "camera_columns",
            f"camera_objects.parquet: {column} of object {rows[0]['track_id']} is "
            f"{rows[0][column]!r}, which does not follow; so it is in {len(rows)} rows",
            frame=rows[0]["k"],
            sensor=rows[0]["sensor_id"],
        )


def _wrong_methods(row: _Row, own: _Row, *, counted: bool) -> Iterator[str]:
    """Columns that tell of another way to count pixels than there is."""
    by_depth = own["is_static"]  # no pixel carries its id
    methods = {"depth"} if by_depth else {"instance", "depth"}
    if row["visibility_method"] not in (methods if counted else {"none"}):
        yield "visibility_method"
    method = "hull_depth" if row["visible_px"] else "hull_prior"
    if row["amodal_method"] != (method if counted and own["class"] != "rider" else "none"):
        yield "amodal_method"


def _lidars_beside(episode: Episode) -> dict[str, list[str]]:
    """By sensor, the LiDARs that the same actor carries."""
    carriers = episode.carriers()
    swept = [sensor.id for sensor in episode.sensors if sensor.content in CLOUDS]
    return {
        sensor.id: [name for name in swept if carriers.get(name) == carriers.get(sensor.id)]
        for sensor in episode.sensors
    }


def _shared_low_ids(rows: Iterable[_Row]) -> frozenset[int]:
    """The low 16 bits that several actors' ids have in common."""
    low = Counter(
        row["track_id"] & _LOW_IDS
        for row in rows
        if not row["is_static"] and row["class"] != "rider"
    )
    return frozenset(bits for bits, count in low.items() if count > 1)


def _has_points(
    own: _Row, objects: Mapping[int, _Row], lidars: Collection[str], least: int
) -> bool:
    """Whether enough points lie in an object's box.

    All objects have enough where no LiDAR has measured, as have lights and signs.

    Args:
        own: the row of the object.
        objects: rows of the frame by track.
        lidars: those beside the camera that have measured in this frame.
        least: number of points that is enough.
    """
    if least <= 0 or not lidars or (own["is_static"] and own["class"] not in _VEHICLES):
        return True
    if own["class"] == "rider":
        own = objects.get(own["parent_track_id"], own)
    total = sum(count for name, count in own["num_lidar_points"] or () if name in lidars)
    return bool(total >= least)
