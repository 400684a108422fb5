"""Whether disparity is what depth makes it, and the pictures of a pair agree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.images import grey_pixels
from carstage.dataset.reading import Episode
from carstage.geometry.stereo import STEPS_PER_PX, CameraPair, StereoCamera
from carstage.plan.stereo import disparity_name
from carstage.validation.checks.files import VerifiedFiles
from carstage.validation.checks.findings import Findings

_STEPS: Final = 0.51
"""A stored value is rounded to the nearest step."""
_FAR_M: Final = 999.0
_SLACK_PX: Final = 0.3
_SLACK_SHARE: Final = 0.03
_MOST_SHARE: Final = 0.02
"""Of a picture's pixels may contradict the other one: at edges a pixel shows two surfaces."""


class DisparityChecks:
    """Looks at the disparity of an episode, frame after frame.

    Args:
        episode: the episode.
        files: reads and verifies the files.
        findings: check ``disparity``.
    """

    def __init__(self, episode: Episode, files: VerifiedFiles, findings: Findings) -> None:
        self._files, self._findings = files, findings
        self._pairs = episode.stereo_pairs() if episode.spec.labels.disparity else ()
        self._depth = {one.id: one.calibration.depth for one in episode.sensors}

    def check(self, k: int, data: Mapping[str, NDArray[Any]]) -> None:
        """Compare a frame's files with depth images of the dataset, and with each other.

        Args:
            k: the frame.
            data: by sensor, as they are decoded.
        """
        for pair in self._pairs:
            found = [self._read(camera, k) for camera in (pair.left, pair.right)]
            for camera, steps in zip((pair.left, pair.right), found, strict=True):
                depth_m = data.get(self._depth[camera.id] or "")
                if steps is not None and depth_m is not None:
                    self._compare(camera, pair, k, steps, depth_m)
            left, right = found
            if left is not None and right is not None and left.any() and right.any():
                share = contradicting_share(left / STEPS_PER_PX, right / STEPS_PER_PX)
                if share > _MOST_SHARE:
                    what = f"{100 * share:.0f} % of its pixels contradict those of {pair.right.id}"
                    self._report(pair.left, k, what)

    def _read(self, camera: StereoCamera, k: int) -> NDArray[np.uint16] | None:
        content = self._files.read(disparity_name(camera.id, k), frame=k, sensor=camera.id)
        if content is None:
            return None
        try:
            steps = np.asarray(grey_pixels(content, np.uint16), np.uint16)
        except ValueError as error:
            self._report(camera, k, f"the file does not decode: {error}")
            return None
        if steps.shape != (camera.height, camera.width):
            self._report(camera, k, "it has another size than the camera's pictures")
            return None
        return steps

    def _compare(
        self,
        camera: StereoCamera,
        pair: CameraPair,
        k: int,
        steps: NDArray[np.uint16],
        depth_m: NDArray[Any],
    ) -> None:
        depth = np.maximum(depth_m.astype(np.float64), 1e-6)
        wanted = STEPS_PER_PX * pair.focal_px * pair.baseline_m / depth
        stored = np.rint(wanted)
        there = (depth < _FAR_M) & (stored >= 1.0) & (stored <= np.iinfo(np.uint16).max)
        wrong = int(np.count_nonzero(np.abs(np.where(there, wanted, 0.0) - steps) > _STEPS))
        if wrong:
            what = f"{wrong} pixels are not focal length times baseline by depth"
            self._report(camera, k, what)

    def _report(self, camera: StereoCamera, k: int, message: str) -> None:
        name = disparity_name(camera.id, k)
        self._findings.add("disparity", f"{name}: {message}", frame=k, sensor=camera.id)


def contradicting_share(left_px: NDArray[Any], right_px: NDArray[Any]) -> float:
    """Share of the left picture's pixels at whose place the right one sees farther.

    What a pixel shows may be hidden from the other camera by what is nearer, but never by what is
    farther. The nearest of three neighbours counts.

    Args:
        left_px, right_px: ``(H, W)`` disparity of both pictures, 0 for none.
    """
    height, width = left_px.shape
    row, column = np.mgrid[:height, :width]
    there = np.floor(column + 0.5 - left_px).astype(np.int64)
    shown = (left_px > 0) & (there >= 1) & (there < width - 1)
    if not shown.any():
        return 0.0
    nearest = np.max([right_px[row[shown], there[shown] + step] for step in (-1, 0, 1)], axis=0)
    farther = nearest < left_px[shown] * (1.0 - _SLACK_SHARE) - _SLACK_PX
    return float(np.mean(farther))
