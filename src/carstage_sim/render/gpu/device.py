"""Which card computes, and the buffers and pipelines on it."""

from __future__ import annotations

import logging
import os
import threading
from collections import deque
from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib import resources
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.gpu.native import READ, Commands, Native
from carstage_sim.render.gpu.transfer import Readback, Upload, padded

Choice = Literal["auto", "cpu", "gpu"]
"""What ``--device`` can say."""

SOFTWARE_VARIABLE = "CARSTAGE_SOFTWARE_GPU"
"""Environment variable that lets ``gpu`` be a Vulkan driver that computes on the CPU, for tests."""

_LARGE_LIMITS = (
    "max-buffer-size",
    "max-storage-buffer-binding-size",
    "max-storage-buffers-per-shader-stage",
)
_MOST_LENT = 1 << 29
"""Bytes of pictures that are read where the card wrote them; what is beyond is copied."""

_WRITES_MEMORY = "mappable-primary-buffers"
"""The feature that lets kernels write into the program's own memory."""
_ITS_ADVICE = "MAPPABLE_PRIMARY_BUFFERS"

_COPIERS = min(4, len(os.sched_getaffinity(0)))
_PIECE = 1 << 20
"""Bytes that a copying thread is woken for."""

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
    able = [adapter for adapter in fitting if _WRITES_MEMORY in adapter.features]
    if not able:
        raise NoGpuError(f"{fitting[0].info['device']} cannot write into a program's memory")
    able.sort(key=lambda adapter: adapter.info["adapter_type"] != "DiscreteGPU")
    return Gpu(able[0])


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


@contextmanager
def _no_advice() -> Iterator[None]:
    """Without what wgpu warns of: kernels are slow that read such memory, and none does."""

    def is_other(record: logging.LogRecord) -> bool:
        return _ITS_ADVICE not in record.getMessage()

    its_log = logging.getLogger("wgpu")
    its_log.addFilter(is_other)
    try:
        yield
    finally:
        its_log.removeFilter(is_other)


class BindGroups:
    """Bind groups, each the same again while its buffers are.

    Args:
        gpu: the card.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._held: dict[Hashable, tuple[tuple[Any, ...], Any]] = {}

    def of(self, key: Hashable, layout: Any, buffers: Sequence[Any]) -> Any:
        """That of a use, made anew where it has other buffers than the last time."""
        held = self._held.get(key)
        same = held is not None and all(a is b for a, b in zip(held[0], buffers, strict=True))
        if held is None or not same:
            held = self._held[key] = (tuple(buffers), self._gpu.group(layout, buffers))
        return held[1]


class Gpu:
    """A card; one thread at a time hands it work, any may receive what it made.

    Attributes:
        name: the card's own.
        kind: ``DiscreteGPU``, ``IntegratedGPU``, ``CPU``, ...
        driver: what the driver says of itself.
        constants: WGSL of what kernels have to know of the card: whether it rounds a multiply-add
            once. Mesa's driver on the CPU rounds twice.
        device: wgpu's device.
        largest: bytes of the largest buffer that a kernel can read or write.
        handing_over: held by who hands the card work.
    """

    def __init__(self, adapter: Any) -> None:
        import wgpu

        self._usage = wgpu.BufferUsage
        info = adapter.info
        self.name = str(info["device"])
        self.kind = str(info["adapter_type"])
        self.driver = f"{info['vendor']} {info['description']} ({info['backend_type']})".strip()
        self.constants = f"const FUSED: bool = {str(self.kind != 'CPU').lower()};\n"
        limits = {name: adapter.limits[name] for name in _LARGE_LIMITS}
        with _no_advice():
            self.device: Any = adapter.request_device_sync(
                required_features=[_WRITES_MEMORY], required_limits=limits
            )
        buffer, binding = limits["max-buffer-size"], limits["max-storage-buffer-binding-size"]
        self.largest = int(min(buffer, binding))
        self._native = Native(self.device)
        self.handing_over = threading.RLock()
        self._copiers = ThreadPoolExecutor(_COPIERS, thread_name_prefix="copier")
        self._shaders: dict[str, Any] = {}
        self._staging: dict[int, list[Any]] = {}
        self._returned: deque[Any] = deque()
        self._lent = 0
        self._lending = threading.Lock()

    def storage(self, size: int) -> Any:
        """A buffer of at least ``size`` bytes that kernels read and write."""
        usage = self._usage.STORAGE | self._usage.COPY_DST | self._usage.COPY_SRC
        return self.device.create_buffer(size=padded(size), usage=usage | self._usage.INDIRECT)

    def uniform(self, size: int) -> Any:
        """A buffer of parameters."""
        return self.device.create_buffer(
            size=padded(size), usage=self._usage.UNIFORM | self._usage.COPY_DST
        )

    def filled(self, size: int) -> Any:
        """A buffer that the CPU fills and the card copies from."""
        usage = self._usage.COPY_SRC | self._usage.MAP_WRITE
        return self.device.create_buffer(size=padded(size), usage=usage)

    def write(self, buffer: Any, array: NDArray[Any], offset: int = 0) -> None:
        """Copy an array into a buffer; its size in bytes is a multiple of four."""
        if array.nbytes:
            self._native.write(buffer, offset, np.ascontiguousarray(array))

    def pipeline(self, code: str, entry: str, layouts: Sequence[Any]) -> Any:
        """A compute pipeline; all loops of its code have to end."""
        if code not in self._shaders:
            self._shaders[code] = self._native.shader(code)
        return self.device.create_compute_pipeline(
            layout=self.device.create_pipeline_layout(bind_group_layouts=list(layouts)),
            compute={"module": self._shaders[code], "entry_point": entry},
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

    def commands(self) -> Commands:
        """Begin to record work; its submission's number is for :meth:`Readback.bytes`."""
        return self._native.commands()

    def readback(self, size: int) -> Readback:
        """A way back for ``size`` bytes."""
        while self._returned:
            staging = self._returned.popleft()
            self._lend(-staging.size)
            self._native.unmap(staging)
            self._staging[staging.size].append(staging)
        step = 1 << max(padded(size).bit_length() - 3, 8)
        capacity = -(-size // step) * step or step
        free = self._staging.setdefault(capacity, [])
        if not free:
            usage = self._usage.MAP_READ | self._usage.COPY_DST | self._usage.STORAGE
            free.append(self.device.create_buffer(size=capacity, usage=usage))
        return Readback(self, free.pop(), size)

    def received(self, staging: Any, size: int, after: int) -> NDArray[np.uint8]:
        """What the card wrote into a staging buffer, where it wrote it.

        The buffer is used again as soon as nobody holds the array.
        """
        returned = self._returned
        lent = self._lend(staging.size)
        arrived = self._native.map(
            staging, padded(size), READ, after, lambda: returned.append(staging)
        )[:size]
        if lent <= _MOST_LENT:
            return arrived
        # Somebody keeps pictures: a card's memory is too dear for that.
        data = np.empty(size, np.uint8)
        self.copy(data, arrived)
        return data

    def _lend(self, size: int) -> int:
        """Count bytes that are read where the card wrote them; how many there are now."""
        with self._lending:
            self._lent += size
            return self._lent

    def upload(self, size: int) -> Upload:
        """A way to the card for at least ``size`` bytes."""
        return Upload(self, self._native, padded(size + size // 4))

    def copy(self, target: NDArray[np.uint8], source: NDArray[np.uint8]) -> None:
        """Copy bytes, large arrays by several threads, each of which has one part."""
        size = len(source)
        if size <= _PIECE:
            np.copyto(target, source)
            return
        part = -(-size // min(_COPIERS, size // _PIECE))
        parts = [slice(k, k + part) for k in range(0, size, part)]
        list(self._copiers.map(lambda one: np.copyto(target[one], source[one]), parts))
