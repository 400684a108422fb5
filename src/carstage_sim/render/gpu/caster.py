"""Runs batches of rays on a card."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.cast import Scene
from carstage_sim.render.caster import AIMED, Hits, Packets, RayCaster, Slopes
from carstage_sim.render.gpu.device import Gpu, wgsl
from carstage_sim.render.gpu.geometry import GpuGeometry
from carstage_sim.render.gpu.transfer import Readback, padded
from carstage_sim.render.pixel_kernels import ray_directions

GROUP = 64
"""Rays of a work group."""
MOST_GROUPS = 65535
"""Work groups along one axis."""
_MOST_LOOPING = 4096
"""Work groups whose lanes take several rays each. WebGPU clears a lane's stack before
it begins: half a kilobyte, about as long as a ray is traced. On an H100, 2048 to 8192 were alike,
and a lane for each ray took a third longer."""


class GpuCaster(RayCaster):
    """Casts rays on a card; what else is computed in bands of rays is left to the CPU.

    Args:
        gpu: the card.
        threads: as for :class:`carstage_sim.render.caster.RayCaster`.
    """

    def __init__(self, gpu: Gpu, threads: int | None = None) -> None:
        super().__init__(threads)
        self.gpu = gpu
        self.geometry = GpuGeometry(gpu)
        self.scene_layout = gpu.layout("rrru")
        self._layout = gpu.layout("rrwu")
        self._pipelines: dict[int, Any] = {}
        self._batch = gpu.uniform(24)
        self._found: Any = None
        self._origins, self._ways = gpu.upload(1 << 12), gpu.upload(1 << 16)
        self._groups: dict[Any, tuple[tuple[Any, ...], Any]] = {}

    def _group(self, key: Any, layout: Any, buffers: Sequence[Any]) -> Any:
        """A bind group, the same again while its buffers are."""
        held = self._groups.get(key)
        same = held is not None and all(a is b for a, b in zip(held[0], buffers, strict=True))
        if held is None or not same:
            held = (tuple(buffers), self.gpu.group(layout, buffers))
            self._groups[key] = held
        return held[1]

    def source(self, *names: str) -> str:
        """Sources behind that of the ray caster, with a stack that is deep enough."""
        stack = f"const STACK: u32 = {self.geometry.stack}u;\n"
        return stack + self.gpu.constants + wgsl("trace", *names)

    def cast(
        self,
        scene: Scene,
        origin: NDArray[np.floating],
        directions: NDArray[np.float32],
        *,
        low: float,
        high: float,
        skip_row: int = -1,
        weights: bool = True,
    ) -> Hits:
        """Nearest hits of rays; see :meth:`carstage_sim.render.caster.RayCaster.cast`."""
        count = len(directions)
        self._count(count)
        start = np.ascontiguousarray(origin, np.float32)
        origins = start.reshape(-1, 3)
        rays = np.ascontiguousarray(directions, np.float32)
        if not count:
            none = np.empty(0, np.int32)
            return Hits(start, rays, np.empty(0, np.float32), none, none, np.empty((0, 2), "f4"))
        words = np.array([count, len(origins) == 1, skip_row, weights, 0, 0], np.int64)
        batch = words.astype(np.uint32)
        batch[4:] = np.array([low, high], np.float32).view(np.uint32)
        with self.gpu.handing_over:
            readback, submission = self._submit(scene, origins, rays, batch)
        met = readback.bytes(submission).view(np.uint32)
        return Hits(
            start,
            rays,
            met[:count].view(np.float32),
            met[count : 2 * count].view(np.int32),
            met[2 * count : 3 * count].view(np.int32),
            met[3 * count :].view(np.float32).reshape(-1, 2),
        )

    def _submit(
        self,
        scene: Scene,
        origins: NDArray[np.float32],
        rays: NDArray[np.float32],
        batch: NDArray[np.uint32],
    ) -> tuple[Readback, int]:
        """Let the card cast rays; ``batch`` as ``cast.wgsl`` has it."""
        gpu, count = self.gpu, len(rays)
        self.geometry.update(scene)
        if self._origins.size < origins.nbytes:
            self._origins = gpu.upload(origins.nbytes)
        if self._ways.size < rays.nbytes:
            self._ways = gpu.upload(rays.nbytes)
        if self._found is None or self._found.size < 20 * count:
            self._found = gpu.storage(25 * count)
        gpu.write(self._batch, batch)
        size = (20 if batch[3] else 12) * count
        readback = gpu.readback(size)
        used = (self._origins.buffer, self._ways.buffer, self._found, self._batch)
        encoder = gpu.device.create_command_encoder()
        self._origins.write(origins, encoder)
        self._ways.write(rays, encoder)
        work = encoder.begin_compute_pass()
        work.set_pipeline(self._pipeline())
        work.set_bind_group(0, self._group("scene", self.scene_layout, self.geometry.buffers))
        work.set_bind_group(1, self._group("batch", self._layout, used))
        work.dispatch_workgroups(*looping_groups(count))
        work.end()
        encoder.copy_buffer_to_buffer(self._found, 0, readback.buffer, 0, padded(size))
        submission = gpu.submit(encoder)
        self._origins.read_by(submission)
        self._ways.read_by(submission)
        return readback, submission

    def cast_together(
        self,
        scene: Scene,
        origin: NDArray[np.floating],
        directions: NDArray[np.float32],
        packets: Packets,
        *,
        low: float,
        high: float,
        skip_row: int = -1,
        slopes: Slopes = AIMED,
    ) -> Hits:
        """Nearest hits of rays, which a card sorts by itself."""
        if len(slopes.right):
            self.in_parts(ray_directions, (*slopes, directions), len(directions))
        return self.cast(scene, origin, directions, low=low, high=high, skip_row=skip_row)

    def _pipeline(self) -> Any:
        depth = self.geometry.stack
        if depth not in self._pipelines:
            layouts = (self.scene_layout, self._layout)
            self._pipelines[depth] = self.gpu.pipeline(self.source("cast"), "cast_rays", layouts)
        return self._pipelines[depth]


def groups_of(count: int, size: int = GROUP) -> tuple[int, int, int]:
    """Work groups of ``size`` for ``count`` invocations, in a plane where one row is too short."""
    groups = max(1, math.ceil(count / size))
    return min(groups, MOST_GROUPS), math.ceil(groups / MOST_GROUPS), 1


def looping_groups(count: int) -> tuple[int, int, int]:
    """Work groups for ``count`` rays at most, whose lanes take one after the other."""
    return min(groups_of(count)[0], _MOST_LOOPING), 1, 1
