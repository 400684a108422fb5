"""Runs batches of rays on a card."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.cast import Scene
from carstage_sim.render.caster import AIMED, Hits, Packets, RayCaster, Slopes
from carstage_sim.render.gpu.device import BindGroups, Gpu, wgsl
from carstage_sim.render.gpu.geometry import GpuGeometry
from carstage_sim.render.gpu.transfer import Readback
from carstage_sim.render.pixel_kernels import ray_directions

GROUP = 64
"""Rays of a work group."""
MOST_GROUPS = 65535
"""Work groups along one axis."""
_MOST_LOOPING = 8192
"""Work groups whose lanes take several rays each: WebGPU clears a lane's stack before it begins. On
an H200, five colour pictures took 1 % longer with 4096 and 7 % longer with 2048; on an H100 a lane
for each ray took a third longer."""
LOT = 1 << 19
"""Rays that go to the card together: while it casts them the next are on their way."""


class _Rule(NamedTuple):
    """What the rays of a batch share; see :meth:`carstage_sim.render.caster.RayCaster.cast`."""

    shared_origin: bool
    skip_row: int
    weights: bool
    low: float
    high: float


class _Lot:
    """Buffers of rays that go to a card together.

    Args:
        gpu: the card.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self.batch = gpu.uniform(48)
        self.origins, self.directions = gpu.upload(1 << 12), gpu.upload(1 << 16)

    def make_room(self, origin_bytes: int, rays: int) -> None:
        """For so many rays."""
        if self.origins.size < origin_bytes:
            self.origins = self._gpu.upload(origin_bytes)
        if self.directions.size < 12 * rays:
            self.directions = self._gpu.upload(12 * rays)


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
        self._lots: list[_Lot] = []
        self._groups = BindGroups(gpu)

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
        with self.gpu.handing_over:
            self.geometry.update(scene)
            readback = self.gpu.readback((20 if weights else 12) * count)
            rule = _Rule(len(origins) == 1, skip_row, weights, low, high)
            for number, first in enumerate(range(0, count, LOT)):
                submission = self._submit(number, first, origins, rays, rule, readback)
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
        number: int,
        first: int,
        origins: NDArray[np.float32],
        rays: NDArray[np.float32],
        rule: _Rule,
        readback: Readback,
    ) -> int:
        """Let the card cast a lot of rays; the number of the submission."""
        if number == len(self._lots):
            self._lots.append(_Lot(self.gpu))
        lot, total = self._lots[number], len(rays)
        rays = rays[first : first + LOT]
        origins = origins if rule.shared_origin else origins[first : first + LOT]
        count = len(rays)
        lot.make_room(0 if rule.shared_origin else origins.nbytes, count)
        words = np.zeros(12, np.float32)
        words[:3], words[10:12] = origins[0], (rule.low, rule.high)
        whole = words.view(np.int32)
        whole[3:7] = rule.shared_origin, count, first, total
        whole[8:10] = rule.skip_row, rule.weights
        self.gpu.write(lot.batch, words)
        commands = self.gpu.commands()
        if not rule.shared_origin:
            lot.origins.write(origins, commands)
        lot.directions.write(rays, commands)
        used = (lot.origins.buffer, lot.directions.buffer, readback.buffer, lot.batch)
        groups = (
            self._groups.of("scene", self.scene_layout, self.geometry.buffers),
            self._groups.of((number, id(readback.buffer)), self._layout, used),
        )
        commands.dispatch(self._pipeline(), groups, looping_groups(count))
        submission = commands.submit()
        if not rule.shared_origin:
            lot.origins.read_by(submission)
        lot.directions.read_by(submission)
        return submission

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
