"""Whether outlines of patches are what corners, poses and depth images make them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.patches import PatchView, patch_in_view
from carstage.annotation.schema import PATCH_COLUMNS, PATCHES
from carstage.dataset.reading import Episode
from carstage.dataset.saved_frames import RowsByFrame
from carstage.geometry import pose_matrix
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labelled_cameras import LabelledCameras
from carstage.validation.checks.table_schema import require_rows

_TOLERANCE = 0.02
"""Pixels, metres, cosines and shares: values are rounded, corners to a tenth of a millimetre."""
_PLACES = ("u", "v")
_NUMBERS = ("pixels", "visible_share", "distance", "facing")
_SEEN = ("visible_share",)


class PatchChecks:
    """Makes the rows of an episode again, frame after frame.

    Args:
        episode: the episode.
        findings: check ``patches``.
    """

    def __init__(self, episode: Episode, findings: Findings) -> None:
        self._findings = findings
        self._rows: RowsByFrame | None = None
        table = episode.patches()
        if table is None:
            return
        require_rows(table, PATCH_COLUMNS, PATCHES)
        self._rows = RowsByFrame(table)
        self._specs = {patch.name: patch for patch in episode.spec.patches}
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
        poses = {row["sensor_id"]: row for row in self._poses.rows(k)}
        looked_at: set[tuple[str, str]] = set()
        for row in self._rows.rows(k):
            name = row["sensor_id"]
            if (name, row["patch"]) in looked_at:
                self._report(k, name, row, "it is there twice")
            looked_at.add((name, row["patch"]))
            if name not in self._cameras or name not in poses:
                self._report(k, name, row, "it is in no labelled pinhole camera")
                continue
            spec = self._specs.get(row["patch"])
            if spec is None or spec.is_shown != row["shown"] or spec.target != row["target"]:
                self._report(k, name, row, "it is not one of the episode's patches")
                continue
            camera = self._cameras[name].calibration
            image = data.get(self._depth[name].id) if name in self._depth else None
            blank = np.full((camera.height, camera.width), np.inf, np.float32)
            view = PatchView(
                camera.k,
                pose_matrix(poses[name]["location"], poses[name]["rotation_deg"]),
                blank if image is None else image,
                self._range_m,
            )
            self._compare(k, row, view, image is not None)

    def _compare(self, k: int, row: Mapping[str, Any], view: PatchView, by_depth: bool) -> None:
        corners = np.asarray(row["corners"], np.float64)
        if corners.shape != (12,) or not np.isfinite(corners).all():
            self._report(k, row["sensor_id"], row, "its corners are no four places")
            return
        expected = patch_in_view(corners.reshape(4, 3), view)
        if expected is None:
            self._report(k, row["sensor_id"], row, "it is not seen there")
            return
        wrong = [name for name in _PLACES if not _close(row[name], expected[name])]
        wrong += [
            name
            for name in _NUMBERS
            if (by_depth or name not in _SEEN) and abs(row[name] - expected[name]) > _TOLERANCE
        ]
        if wrong:
            self._report(k, row["sensor_id"], row, f"{', '.join(wrong)} of it is wrong")

    def _report(self, k: int, sensor: str, row: Mapping[str, Any], message: str) -> None:
        said = f"{sensor}: {row['patch']}: {message}"
        self._findings.add("patches", said, frame=k, sensor=sensor)


def _close(a: Any, b: Any) -> bool:
    return len(a) == len(b) and bool(np.allclose(a, b, rtol=0.0, atol=_TOLERANCE))
