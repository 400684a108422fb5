"""CenterNet on MobileNetV3 as a TensorFlow.js graph, as the package ``@vladmandic/human`` has it.

Zhou, Wang and Krähenbühl, "Objects as Points", 2019. The graph is computed up to the heat map and
the distances of the sides; peaks of the heat map are the objects, as in section 3 there.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks.simulator.detectors.layers import (
    Array,
    convolve,
    convolve_each,
    largest,
    resize_bilinear,
    sigmoid,
)

_HEAT, _SIDES = "tower_0/keypoints", "tower_0/wh"
_PEAK_CELLS = 3

Node = Mapping[str, Any]


class CenterNetDetector:
    """A detector of the CenterNet family.

    Args:
        model: the ``.json`` file: the graph, and where each tensor is.
        weights: bytes of the ``.bin`` file.

    Raises:
        ValueError: the graph has an operation that is not known here.
    """

    def __init__(self, model: bytes, weights: bytes) -> None:
        described = json.loads(model)
        self._constants = _constants(described["weightsManifest"], weights)
        self._nodes = {node["name"]: node for node in described["modelTopology"]["node"]}
        ((self._input, signature),) = described["signature"]["inputs"].items()
        self.side = int(signature["tensorShape"]["dim"][1]["size"])
        self._order = _order(self._nodes, (_HEAT, _SIDES))
        unknown = {self._nodes[name]["op"] for name in self._order} - {"Const", *_OPERATIONS}
        if unknown - {"Placeholder"}:
            raise ValueError(f"Operations that are not known: {', '.join(sorted(unknown))}.")

    def detect(self, tile: Array) -> tuple[Array, Array]:
        """Boxes ``(N, 4)`` as x0, y0, x1, y1 (px of the tile) and ``(N, classes)`` scores.

        Args:
            tile: ``(side, side, 3)`` RGB from 0 to 255.
        """
        values: dict[str, Any] = {**self._constants, self._input: tile.astype(np.float32)}
        for name in self._order:
            if name not in values:
                node = self._nodes[name]
                inputs = [values[source] for source in node.get("input", ())]
                values[name] = _OPERATIONS[node["op"]](node.get("attr", {}), inputs)
        heat, sides = values[_HEAT], values[_SIDES]
        peaks = heat * (heat == largest(heat, _PEAK_CELLS))
        cells = self.side // heat.shape[0]
        row, column = np.mgrid[: heat.shape[0], : heat.shape[1]].astype(np.float32) * cells
        outwards = np.array([-1, -1, 1, 1], np.float32)
        boxes = np.stack([column, row, column, row], axis=-1) + sides * outwards
        return boxes.reshape(-1, 4), peaks.reshape(-1, heat.shape[2])


def _constants(manifest: list[dict[str, Any]], weights: bytes) -> dict[str, Any]:
    """The tensors of a graph by name."""
    found: dict[str, Any] = {}
    offset = 0
    for entry in (entry for group in manifest for entry in group["weights"]):
        stored = np.dtype(entry.get("quantization", entry)["dtype"]).newbyteorder("<")
        count = math.prod(entry["shape"])
        values = np.frombuffer(weights, stored, count, offset).reshape(entry["shape"])
        found[entry["name"]] = values.astype(entry["dtype"])
        offset += count * stored.itemsize
    if offset != len(weights):
        raise ValueError(f"The tensors take {offset} bytes of {len(weights)}.")
    return found


def _order(nodes: Mapping[str, Node], wanted: tuple[str, ...]) -> list[str]:
    """What must be computed for some nodes, each after what it needs."""
    done: dict[str, None] = {}
    waiting = list(reversed(wanted))
    while waiting:
        name = waiting[-1]
        missing = [source for source in nodes[name].get("input", ()) if source not in done]
        if missing:
            waiting.extend(missing)
        else:
            done[waiting.pop()] = None
    return list(done)


def _stride(attributes: Node) -> int:
    return int(attributes["strides"]["list"]["i"][1])


def _activated(attributes: Node, values: Array, inputs: list[Any]) -> Array:
    """What the fused operations add to a convolution, in their order."""
    for text in attributes.get("fused_ops", {}).get("list", {}).get("s", ()):
        operation = base64.b64decode(text).decode()
        values = values + inputs[2] if operation == "BiasAdd" else _BY_VALUE[operation](values)
    return values


def _convolution(attributes: Node, inputs: list[Any]) -> Array:
    return _activated(attributes, convolve(inputs[0], inputs[1], _stride(attributes)), inputs)


def _each(attributes: Node, inputs: list[Any]) -> Array:
    found = convolve_each(inputs[0], inputs[1][..., 0], _stride(attributes))
    return _activated(attributes, found, inputs)


def _mean(attributes: Node, inputs: list[Any]) -> Array:
    found: Array = inputs[0].mean(axis=(0, 1), keepdims=True)
    return found


def _joined(attributes: Node, inputs: list[Any]) -> Array:
    return np.concatenate(inputs[:-1], axis=2)


_BY_VALUE: dict[str, Callable[[Array], Array]] = {
    "Relu": lambda values: np.maximum(values, np.float32(0.0)),
    "Relu6": lambda values: np.clip(values, np.float32(0.0), np.float32(6.0)),
}

_OPERATIONS: dict[str, Callable[[Node, list[Any]], Any]] = {
    "Conv2D": _convolution,
    "_FusedConv2D": _convolution,
    "DepthwiseConv2dNative": _each,
    "FusedDepthwiseConv2dNative": _each,
    "Mean": _mean,
    "ConcatV2": _joined,
    "Add": lambda _, inputs: inputs[0] + inputs[1],
    "Mul": lambda _, inputs: inputs[0] * inputs[1],
    "Relu": lambda _, inputs: _BY_VALUE["Relu"](inputs[0]),
    "Relu6": lambda _, inputs: _BY_VALUE["Relu6"](inputs[0]),
    "Sigmoid": lambda _, inputs: sigmoid(inputs[0]),
    "Identity": lambda _, inputs: inputs[0],
    "ResizeBilinear": lambda _, inputs: resize_bilinear(inputs[0], *inputs[1].tolist()),
}
"""What a node's attributes and inputs give, by the name of its operation."""
