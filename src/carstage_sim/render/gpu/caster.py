"""Runs batches of rays on a card."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.cast import Scene
from carstage_sim.render.caster import Hits, RayCaster
from carstage_sim.render.gpu.device import Gpu, padded, wgsl
from carstage_sim.render.gpu.geometry import GpuGeometry

GROUP = 64
"""Rays of a work group."""
MOST_GROUPS = 65535
"""Work groups along one axis."""


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
        self._buffers: dict[str, Any] = {}

    def room(self, name: str, size: int) -> Any:
        """A buffer for the moment, of at least ``size`` bytes; the same one again next time."""
        buffer = self._buffers.get(name)
        if buffer is None or buffer.size < size:
            buffer = self._buffers[name] = self.gpu.storage(size)
        return buffer

    def scene_group(self) -> Any:
        """Bind group 0 of the scene that is on the card."""
        return self.gpu.group(self.scene_layout, self.geometry.buffers)

    def source(self, *names: str) -> str:
        """Sources behind that of the ray caster, with a stack that is deep enough."""
        return f"const STACK: u32 = {self.geometry.stack}u;\n" + wgsl("trace", *names)

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
        self.ray_count += count
        start = np.ascontiguousarray(origin, np.float32)
        origins = start.reshape(-1, 3)
        rays = np.ascontiguousarray(directions, np.float32)
        if not count:
            none = np.empty(0, np.int32)
            return Hits(start, rays, np.empty(0, np.float32), none, none, np.empty((0, 2), "f4"))
        self.geometry.update(scene)
        places, ways = self.room("origins", origins.nbytes), self.room("rays", rays.nbytes)
        found = self.room("hits", 20 * count)
        size = (20 if weights else 12) * count
        gpu = self.gpu
        gpu.write(places, origins)
        gpu.write(ways, rays)
        batch = np.array([count, len(origins) == 1, skip_row, 0, 0, 0], np.int64).astype(np.uint32)
        batch[4:] = np.array([low, high], np.float32).view(np.uint32)
        gpu.write(self._batch, batch)
        encoder = gpu.device.create_command_encoder()
        work = encoder.begin_compute_pass()
        work.set_pipeline(self._pipeline())
        work.set_bind_group(0, self.scene_group())
        work.set_bind_group(1, gpu.group(self._layout, (places, ways, found, self._batch)))
        work.dispatch_workgroups(*groups_of(count))
        work.end()
        readback = gpu.readback(size)
        readback.copy(encoder, found, 0, padded(size))
        gpu.device.queue.submit([encoder.finish()])
        words = readback.bytes().view(np.uint32)
        return Hits(
            start,
            rays,
            words[:count].view(np.float32),
            words[count : 2 * count].view(np.int32),
            words[2 * count : 3 * count].view(np.int32),
            words[3 * count :].view(np.float32).reshape(-1, 2),
        )

    def _pipeline(self) -> Any:
        depth = self.geometry.stack
        if depth not in self._pipelines:
            layouts = (self.scene_layout, self._layout)
            self._pipelines[depth] = self.gpu.pipeline(
                self.source("cast"), "cast_rays", layouts, None
            )
        return self._pipelines[depth]


def groups_of(count: int, size: int = GROUP) -> tuple[int, int, int]:
    """Work groups of ``size`` for ``count`` invocations, in a plane where one row is too short."""
    groups = max(1, math.ceil(count / size))
    return min(groups, MOST_GROUPS), math.ceil(groups / MOST_GROUPS), 1
