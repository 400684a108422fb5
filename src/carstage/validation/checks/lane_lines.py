"""Whether lines in pictures are what vector map, poses and depth images make them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.schema import LANE_LINE_COLUMNS, LANE_LINES
from carstage.dataset.reading import Episode
from carstage.dataset.saved_frames import RowsByFrame
from carstage.errors import DatasetError
from carstage.geometry import pose_matrix
from carstage.lane_lines import PictureView, TownLines, lines_in_view
from carstage.lane_lines.town import AREAS
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labelled_cameras import LabelledCameras
from carstage.validation.checks.table_schema import require_rows

_TOLERANCE = 0.011
"""Pixels and metres: values are rounded."""
_PLACES = ("u", "v", "x", "y", "z")
_SAME = ("kind", "map_id", "part", "type", "colour", "width")
_Key = tuple[str, str, int]


class LaneLineChecks:
    """Makes the rows of an episode again, frame after frame.

    Args:
        episode: the episode.
        findings: check ``lane_lines``.
    """

    def __init__(self, episode: Episode, findings: Findings) -> None:
        self._findings = findings
        self._town: TownLines | None = None
        table = episode.lane_lines()
        self._rows: RowsByFrame | None = None
        if table is None:
            return
        require_rows(table, LANE_LINE_COLUMNS, LANE_LINES)
        try:
            town = episode.vector_map()
        except DatasetError:
            return  # the check of vector maps says so
        self._rows = RowsByFrame(table)
        self._town = None if town is None else TownLines.of(town)
        self._poses = RowsByFrame(
            episode.sensor_poses().select(["k", "sensor_id", "location", "rotation_deg"])
        )
        self._range_m = episode.spec.max_distance_m
        self._cameras, self._depth = LabelledCameras.of(episode)

    def check(self, k: int, data: Mapping[str, NDArray[Any]]) -> None:
        """Compare the rows of frame ``k`` with what follows.

        Without a depth image, what is visible is taken as it is stored.

        Args:
            k: the frame.
            data: by sensor, as they are decoded.
        """
        if self._rows is None:
            return
        stored: dict[str, dict[_Key, dict[str, Any]]] = {}
        for row in self._rows.rows(k):
            of_camera = stored.setdefault(row["sensor_id"], {})
            if _key(row) in of_camera:
                self._report(k, row["sensor_id"], f"{row['kind']} {row['map_id']} is there twice")
            of_camera[_key(row)] = row
        for name in stored.keys() - self._cameras.keys():
            self._report(k, name, "it has lines, but is no labelled pinhole camera")
        poses = {row["sensor_id"]: row for row in self._poses.rows(k)}
        for name, sensor in self._cameras.items():
            if name not in poses:
                continue
            depth = self._depth.get(name)
            image = None if depth is None else data.get(depth.id)
            camera = sensor.calibration
            if image is None:
                image = np.full((camera.height, camera.width), np.inf, np.float32)
            pose = pose_matrix(poses[name]["location"], poses[name]["rotation_deg"])
            view = PictureView(camera.k, pose, image, self._range_m)
            lines = [] if self._town is None else lines_in_view(self._town, view)
            expected = {_key(row): row for row in lines}
            found = stored.get(name, {})
            if depth is None or depth.id not in data:
                expected = {
                    key: {**row, **_seen(found[key])}
                    for key, row in expected.items()
                    if key in found
                }
            self._compare(k, name, found, expected)

    def _compare(
        self,
        k: int,
        sensor: str,
        stored: Mapping[_Key, Mapping[str, Any]],
        expected: Mapping[_Key, Mapping[str, Any]],
    ) -> None:
        for key in sorted(stored.keys() ^ expected.keys()):
            why = "is not seen there" if key in stored else "is missing"
            self._report(k, sensor, f"{key[0]} {key[1]} {why}")
        for key in sorted(stored.keys() & expected.keys()):
            one, other = stored[key], expected[key]
            wrong = [n for n in _SAME if one[n] != other[n]]
            wrong += [n for n in _PLACES if not _close(one[n], other[n])]
            if list(one["visible"]) != list(other["visible"]) or not _is_seen(one):
                wrong.append("visible")
            if abs(one["visible_share"] - other["visible_share"]) > _TOLERANCE:
                wrong.append("visible_share")
            if wrong:
                self._report(k, sensor, f"{key[0]} {key[1]}: {', '.join(wrong)} of it is wrong")

    def _report(self, k: int, sensor: str, message: str) -> None:
        self._findings.add("lane_lines", f"{sensor}: {message}", frame=k, sensor=sensor)


def _key(row: Mapping[str, Any]) -> _Key:
    return row["kind"], row["map_id"], row["part"]


def _seen(row: Mapping[str, Any]) -> dict[str, Any]:
    """What a row says of its visibility, as far as no depth image is needed to tell."""
    visible, share = row["visible"], row["visible_share"]
    if row["kind"] not in AREAS and visible:
        share = float(np.mean(visible))
    return {"visible": visible, "visible_share": min(max(share, 0.0), 1.0)}


def _is_seen(row: Mapping[str, Any]) -> bool:
    """Whether each place of a row is said to be visible or not."""
    return len(row["visible"]) == len(row["u"]) and set(row["visible"]) <= {0, 1}


def _close(a: Any, b: Any) -> bool:
    return len(a) == len(b) and bool(np.allclose(a, b, rtol=0.0, atol=_TOLERANCE))
