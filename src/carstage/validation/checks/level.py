"""Boxes of the level hold what they are said to hold: servers do not always place them well."""

from __future__ import annotations

from typing import Any

import pyarrow.compute as pc

from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables

MIN_OPEN_PX = 500
MIN_FILL = 0.1
_SOLID = ("car", "van", "truck", "bus", "motorcycle", "bicycle", "traffic_light", "traffic_sign")
"""Classes whose objects fill their boxes; a street lamp or a tree leaves most of its box empty."""


def check_level_boxes(tables: LabelTables, findings: Findings) -> None:
    """Warn of boxes of the level that are empty to the cameras (check ``level_boxes``).

    Over an episode, of the pixels of a box's silhouette that nothing hides, at least a tenth show
    the parked vehicle, light or sign, if there are 500 or more.

    Args:
        tables: the label tables of an episode.
        findings: where problems go.
    """
    objects, seen = tables.objects, tables.camera_objects
    static = objects.filter(objects["is_static"])
    tracks: list[Any] = static["track_id"].to_pylist()
    names: list[Any] = static["class"].to_pylist()
    classes = {track: name for track, name in zip(tracks, names, strict=True) if name in _SOLID}
    ids = static["track_id"].combine_chunks()
    columns = ("visible_px", "front_px", "hull_px")
    known: Any = pc.is_in(seen["track_id"], value_set=ids)
    for name in columns:
        known = pc.and_(known, pc.is_valid(seen[name]))
    sums = seen.filter(known).group_by("track_id").aggregate([(name, "sum") for name in columns])
    for row in sorted(sums.to_pylist(), key=lambda row: row["track_id"]):
        track, own_px = row["track_id"], row["visible_px_sum"]
        open_px = row["hull_px_sum"] - row["front_px_sum"]
        if track in classes and open_px >= MIN_OPEN_PX and own_px < MIN_FILL * open_px:
            findings.add(
                "level_boxes",
                f"object {track}: {own_px} of the {open_px} pixels of its box that nothing hides "
                f"show a {classes[track]}; at least {MIN_FILL:.0%} are expected",
                severity="warning",
            )
