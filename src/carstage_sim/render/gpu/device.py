"""Which card computes, and the buffers and pipelines on it."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import resources
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Choice = Literal["auto", "cpu", "gpu"]
"""What ``--device`` can say."""

SOFTWARE_VARIABLE = "CARSTAGE_SOFTWARE_GPU"
"""Environment variable that lets ``gpu`` be a Vulkan driver that computes on the CPU, for tests."""

_LARGE_LIMITS = (
    "max-buffer-size",
    "max-storage-buffer-binding-size",
    "max-storage-buffers-per-shader-stage",
)
_BLOCK = 256
"""Copies and sizes are multiples of this many bytes."""

_MOST_DESTINATIONS = 16
"""Arrays of one size that are kept to be filled again."""
_UNUSED_REFERENCES = 3
"""References to an array that only its keeper and those who count hold."""

_COPIERS = min(4, len(os.sched_getaffinity(0)))
_PIECE = 1 << 20
"""Bytes that one of the copying threads copies at a time."""

_log = logging.getLogger(__name__)


class NoGpuError(RuntimeError):
    """There is no card that this program can use; the message says why."""


def _adapters() -> list[Any]:
    try:
        import wgpu
    except ImportError as error:
        raise NoGpuError(
            "the package wgpu is missing: install carstage with its extra `gpu`"
        ) from error
    # Some loaders complain on stderr when this is unset, though nothing here opens a window.
    os.environ.setdefault("XDG_RUNTIME_DIR", "/")
    found: list[Any] = wgpu.gpu.enumerate_adapters_sync()
    return [adapter for adapter in found if adapter.info["backend_type"] != "OpenGL"]


def open_gpu(*, software: bool | None = None) -> Gpu:
    """The first hardware card, discrete ones before others.

    Args:
        software: take a driver that computes on the CPU instead, for tests; None: as the
            environment says.

    Raises:
        NoGpuError: there is none.
    """
    if software is None:
        software = os.environ.get(SOFTWARE_VARIABLE, "") not in ("", "0")
    adapters = _adapters()
    fitting = [a for a in adapters if (a.info["adapter_type"] == "CPU") == software]
    if not fitting:
        seen = ", ".join(f"{a.info['device']} ({a.info['adapter_type']})" for a in adapters)
        kind = "software" if software else "hardware"
        raise NoGpuError(f"no {kind} GPU with Vulkan, Metal or D3D12; seen: {seen or 'none'}")
    fitting.sort(key=lambda adapter: adapter.info["adapter_type"] != "DiscreteGPU")
    return Gpu(fitting[0])


def chosen_gpu(choice: Choice) -> Gpu | None:
    """The card that ``--device`` asks for; None for the CPU.

    Raises:
        NoGpuError: ``gpu`` was asked for and there is none.
    """
    if choice == "cpu":
        return None
    try:
        return open_gpu(software=None if choice == "gpu" else False)
    except NoGpuError as error:
        if choice == "gpu":
            raise
        _log.info("rays are cast on the CPU: %s", error)
        return None


def wgsl(*names: str) -> str:
    """Sources of this package, one after the other."""
    folder = resources.files(__package__) / "wgsl"
    return "\n".join((folder / f"{name}.wgsl").read_text() for name in names)


class Gpu:
    """A card.

    Attributes:
        name: the card's own.
        kind: ``DiscreteGPU``, ``IntegratedGPU``, ``CPU``, ...
        driver: what the driver says of itself.
        device: wgpu's device.
    """

    def __init__(self, adapter: Any) -> None:
        import wgpu

        self._usage = wgpu.BufferUsage
        self._read_mode = wgpu.MapMode.READ
        info = adapter.info
        self.name = str(info["device"])
        self.kind = str(info["adapter_type"])
        self.driver = f"{info['vendor']} {info['description']} ({info['backend_type']})".strip()
        limits = {name: adapter.limits[name] for name in _LARGE_LIMITS}
        self.device: Any = adapter.request_device_sync(required_limits=limits)
        self._copiers = ThreadPoolExecutor(_COPIERS, thread_name_prefix="readback")
        self._staging: dict[int, list[Any]] = {}
        self._destinations: dict[int, list[NDArray[np.uint8]]] = {}

    def storage(self, size: int) -> Any:
        """A buffer of at least ``size`` bytes that kernels read and write."""
        usage = self._usage.STORAGE | self._usage.COPY_DST | self._usage.COPY_SRC
        return self.device.create_buffer(size=padded(size), usage=usage | self._usage.INDIRECT)

    def uniform(self, size: int) -> Any:
        """A buffer of parameters."""
        return self.device.create_buffer(
            size=padded(size), usage=self._usage.UNIFORM | self._usage.COPY_DST
        )

    def write(self, buffer: Any, array: NDArray[Any], offset: int = 0) -> None:
        """Copy an array into a buffer; its size in bytes is a multiple of four."""
        if array.nbytes:
            self.device.queue.write_buffer(buffer, offset, np.ascontiguousarray(array))

    def pipeline(
        self, code: str, entry: str, layouts: Sequence[Any], constants: dict[str, float] | None
    ) -> Any:
        """A compute pipeline."""
        return self.device.create_compute_pipeline(
            layout=self.device.create_pipeline_layout(bind_group_layouts=list(layouts)),
            compute={
                "module": self.device.create_shader_module(code=code),
                "entry_point": entry,
                "constants": constants or {},
            },
        )

    def layout(self, kinds: str) -> Any:
        """Layout of a bind group, one letter each: ``r`` read, ``w`` written, ``u`` parameters."""
        names = {"r": "read-only-storage", "w": "storage", "u": "uniform"}
        entries = [
            {"binding": k, "visibility": 4, "buffer": {"type": names[kind]}}
            for k, kind in enumerate(kinds)
        ]
        return self.device.create_bind_group_layout(entries=entries)

    def group(self, layout: Any, buffers: Sequence[Any]) -> Any:
        """A bind group of whole buffers."""
        entries = [
            {"binding": k, "resource": {"buffer": buffer, "offset": 0, "size": buffer.size}}
            for k, buffer in enumerate(buffers)
        ]
        return self.device.create_bind_group(layout=layout, entries=entries)

    def readback(self, size: int) -> Readback:
        """A way back for ``size`` bytes."""
        step = 1 << max(padded(size).bit_length() - 3, 8)
        room = -(-size // step) * step or step
        free = self._staging.setdefault(room, [])
        if not free:
            usage = self._usage.MAP_READ | self._usage.COPY_DST
            free.append(self.device.create_buffer(size=room, usage=usage))
        return Readback(self, free.pop(), size)

    def received(self, staging: Any, size: int) -> NDArray[np.uint8]:
        """What the card wrote into a staging buffer, which is free again."""
        staging.map_sync(self._read_mode, 0, padded(size))
        try:
            data = self._destination(staging.size)[:size]
            arrived = np.frombuffer(staging.read_mapped(0, padded(size), copy=False), np.uint8)[
                :size
            ]
            pieces = [slice(k, k + _PIECE) for k in range(0, size, _PIECE)]
            list(self._copiers.map(lambda piece: np.copyto(data[piece], arrived[piece]), pieces))
        finally:
            staging.unmap()
            self._staging[staging.size].append(staging)
        return data

    def _destination(self, size: int) -> NDArray[np.uint8]:
        """Memory that nobody holds any more, or new: new pages take longer than the copy."""
        kept = self._destinations.setdefault(size, [])
        for array in kept:
            if sys.getrefcount(array) == _UNUSED_REFERENCES:
                return array
        array = np.empty(size, np.uint8)
        if len(kept) < _MOST_DESTINATIONS:
            kept.append(array)
        return array


class Readback:
    """Bytes on their way from a card.

    Args:
        gpu: the card.
        staging: where they arrive.
        size: how many.
    """

    def __init__(self, gpu: Gpu, staging: Any, size: int) -> None:
        self._gpu, self._staging, self._size = gpu, staging, size

    def copy(self, encoder: Any, source: Any, offset: int, size: int) -> None:
        """Let an encoder copy the first bytes of a buffer to an offset."""
        encoder.copy_buffer_to_buffer(source, 0, self._staging, offset, size)

    def bytes(self) -> NDArray[np.uint8]:
        """Wait for them; once."""
        return self._gpu.received(self._staging, self._size)


def padded(size: int) -> int:
    """The next multiple of the block size that is not zero."""
    return max(_BLOCK, -(-size // _BLOCK) * _BLOCK)
