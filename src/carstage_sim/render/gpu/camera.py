"""Cameras on a card: one cast, and of it only the pictures that are asked for."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from enum import IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.film import Film
from carstage_sim.render.gpu.caster import GROUP, GpuCaster, groups_of
from carstage_sim.render.gpu.device import Gpu, Readback
from carstage_sim.render.gpu.program import CameraProgram, frame_source, words_of
from carstage_sim.render.materials import material_table
from carstage_sim.render.quality import SAMPLING, Quality
from carstage_sim.render.scene import Frame
from carstage_sim.render.sky import Lighting

_MOST_SAMPLES = 8
_SHOT_WORDS = 72
_TILE = 8
_MOST_ROOMS = 16
_TOGETHER = 5
"""Cameras whose passes run side by side: the last rays of one leave much of a card idle."""
_MOST_TOGETHER_PX = 1 << 23


class Product(IntFlag):
    """What a camera's picture can show."""

    COLOURS = 1
    DEPTH = 2
    TAGS = 4
    INSTANCES = 8
    NORMALS = 16
    FLOW = 32


def bytes_per_pixel(product: Product) -> int:
    """Flow is two numbers of 32 bits, the others are B, G, R, A."""
    return 8 if product is Product.FLOW else 4


@dataclass(frozen=True, slots=True)
class Shot:
    """A camera that looks at a frame.

    Attributes:
        width, height: pixels.
        fov_deg: horizontal field of view.
        slopes: ``(H * W, 2)`` right and up slopes of the pixels' rays; the same array again for a
            camera of the same lens.
        location: world metres.
        rotation: ``(3, 3)`` world_from_camera.
        skip_row: instance row that rays pass through, -1 for none.
        low, high: interval of depths.
    """

    width: int
    height: int
    fov_deg: float
    slopes: NDArray[np.float64]
    location: NDArray[np.float64]
    rotation: NDArray[np.float64]
    skip_row: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Order:
    """Pictures of one camera that are wanted.

    Attributes:
        shot: the camera.
        products: the pictures.
        film: how light becomes codes.
        turns: ``(I + 1, 3, 4)`` rotation minus identity, and shift, that take a point from today's
            camera axes to those of before: of the town, then of each instance row; only flow needs
            it.
    """

    shot: Shot
    products: Collection[Product]
    film: Film = field(default_factory=Film)
    turns: NDArray[np.float64] | None = None


class _Room:
    """Buffers of a camera, and the bind groups over them.

    Attributes:
        invocations: one for each pixel of whole tiles.
        slopes_of: the array whose slopes are on the card.
    """

    def __init__(self, gpu: Gpu, shot: Shot) -> None:
        pixels = self.pixels = shot.width * shot.height
        self.invocations = -(-shot.width // _TILE) * -(-shot.height // _TILE) * _TILE * _TILE
        self.slopes_of = shot.slopes
        self.shot = gpu.uniform(_SHOT_WORDS * 4)
        self.slopes, self.hits = gpu.storage(16 * pixels), gpu.storage(20 * pixels)
        self.colours, self.codes = gpu.storage(16 * pixels), gpu.storage(4 * pixels)
        self.edges = gpu.storage(4 + 4 * pixels)
        self.out: Any = None
        self.motions = gpu.storage(48)
        self.bound: dict[Any, tuple[tuple[Any, ...], Any]] = {}
        gpu.write(self.slopes, np.stack(_split(shot.slopes), axis=2))


class _Batch:
    """What was submitted together."""

    def __init__(self) -> None:
        self.submission = 0


@dataclass(frozen=True, slots=True)
class Pending:
    """Pictures of a camera that the card is working at."""

    readback: Readback
    parts: dict[Product, tuple[int, int]]
    """Where each picture begins, and its bytes."""
    batch: _Batch

    def pictures(self) -> dict[Product, NDArray[np.uint8]]:
        """Bytes of each picture, flat; waits for the card. Once."""
        data = self.readback.bytes(self.batch.submission)
        return {product: data[a : a + n] for product, (a, n) in self.parts.items()}


class GpuCameras:
    """Takes pictures on a card.

    Args:
        caster: the card and the scene on it.
        quality: how much work a picture is worth.
    """

    def __init__(self, caster: GpuCaster, quality: Quality = Quality.LOW) -> None:
        self._caster = caster
        self._gpu = caster.gpu
        self._epic = quality is Quality.EPIC
        self._sampling = SAMPLING[quality]
        self._materials = material_table()
        self._program: CameraProgram | None = None
        self._rooms: dict[tuple[int, int], _Room] = {}
        self._curves: dict[float, Any] = {}

    def take(self, frame: Frame, orders: Sequence[Order], light: Lighting) -> list[Pending]:
        """Begin pictures of some cameras.

        Args:
            frame: what is seen.
            orders: the cameras, and what of each.
            light: of the weather; only colours need it.
        """
        self._caster.geometry.update(frame.scene)
        pending: list[Pending] = []
        batch: list[Order] = []
        for order in [*orders, None]:
            if batch and (order is None or not self._joins(order, batch)):
                pending += self._take_together(frame, batch, light)
                batch = []
            if order is not None:
                batch.append(order)
        return pending

    @staticmethod
    def _joins(order: Order, batch: Sequence[Order]) -> bool:
        """Whether a camera's passes can run beside those of others."""
        sizes = [one.shot.width * one.shot.height for one in (*batch, order)]
        same = order.film == batch[0].film
        return same and len(batch) < _TOGETHER and sum(sizes) <= _MOST_TOGETHER_PX

    def _take_together(
        self, frame: Frame, orders: Sequence[Order], light: Lighting
    ) -> list[Pending]:
        """Begin pictures of cameras with one film."""
        film = orders[0].film
        source = frame_source(frame, self._materials, film.exposed(light))
        if self._program is None:
            self._program = CameraProgram(self._caster, source, epic=self._epic)
        self._program.arenas.update(source)
        curve, batch = self._curve(film), _Batch()
        encoder = self._gpu.device.create_command_encoder()
        works: list[_Work] = []
        for number, order in enumerate(orders):
            place = self._place(order.shot, number)
            self._aim(place, order)
            works.append(_Work(self._caster, self._program, place, curve, order.products))
        compute = encoder.begin_compute_pass()
        # All cameras' first pass, then all cameras' second: a pass waits for the one before only.
        for entry in ("shoot", "products", "shade", "find_edges", "sample_edges"):
            for work in works:
                work.run(compute, entry, len(self._sampling.offsets))
        compute.end()
        pending = [Pending(work.collect(encoder), work.parts, batch) for work in works]
        batch.submission = self._gpu.submit(encoder)
        return pending

    def warm_up(self, frame: Frame, light: Lighting) -> None:
        """Compile every pass, and bring the town to the card."""
        slopes = np.zeros((_TILE * _TILE, 2))
        shot = Shot(_TILE, _TILE, 90.0, slopes, np.zeros(3), np.eye(3), -1, 0.1, 1.0)
        turns = np.zeros((1 + len(frame.actor_id), 3, 4))
        for one in self.take(frame, [Order(shot, list(Product), turns=turns)], light):
            one.pictures()
        self._caster.cast(frame.scene, np.zeros(3), np.eye(3, dtype=np.float32), low=0.1, high=1.0)

    def _place(self, shot: Shot, number: int) -> _Room:
        """The buffers of a lens and of a place among those that work side by side."""
        key = (id(shot.slopes), number)
        place = self._rooms.get(key)
        if place is None:
            if len(self._rooms) == _MOST_ROOMS:
                self._rooms.pop(next(iter(self._rooms)))
            place = self._rooms[key] = _Room(self._gpu, shot)
        return place

    def _aim(self, place: _Room, order: Order) -> None:
        shot, offsets = order.shot, self._sampling.offsets
        if len(offsets) > _MOST_SAMPLES:
            raise ValueError(f"more than {_MOST_SAMPLES} extra rays of a pixel")
        axes = np.zeros((7, 4), np.float32)
        axes[:3, :3], axes[4:, :3] = _split(shot.rotation.T)
        axes[3, :3] = shot.location
        places = np.zeros((_MOST_SAMPLES, 4), np.float32)
        places[: len(offsets), :2] = offsets
        half_width = math.tan(math.radians(shot.fov_deg) / 2.0)
        numbers = np.zeros(12, np.uint32)
        numbers[:2] = shot.width, shot.height
        numbers[2:3] = np.array([shot.skip_row], np.int32).view(np.uint32)
        numbers[3] = len(offsets)
        numbers[4:7] = words_of([shot.low, shot.high, 2.0 * half_width / shot.width])
        numbers[7:11] = self._sampling.strong, self._sampling.weak, 0, sum(order.products)
        numbers[11:] = words_of([half_width])
        self._gpu.write(place.shot, np.concatenate([words_of(axes), numbers, words_of(places)]))
        if order.turns is not None:
            rows = order.turns.astype(np.float32)
            if place.motions.size < rows.nbytes:
                place.motions = self._gpu.storage(2 * rows.nbytes)
            self._gpu.write(place.motions, rows)

    def _curve(self, film: Film) -> Any:
        if film.gamma not in self._curves:
            steps = (np.arange(8192, dtype=np.float32) / np.float32(8191.0)).reshape(-1, 1)
            curve = self._gpu.storage(8192)
            self._gpu.write(curve, film.encode(steps).reshape(-1).view(np.uint32))
            self._curves[film.gamma] = curve
        return self._curves[film.gamma]


class _Work:
    """The passes of one camera.

    Attributes:
        parts: where in the read-back each picture begins, and its bytes; the colours come last.
    """

    def __init__(
        self,
        caster: GpuCaster,
        program: CameraProgram,
        place: _Room,
        curve: Any,
        products: Collection[Product],
    ) -> None:
        self._gpu, self._program, self._place = caster.gpu, program, place
        self._coloured = Product.COLOURS in products
        others = sorted(product for product in products if product is not Product.COLOURS)
        self.parts: dict[Product, tuple[int, int]] = {}
        self._end = 0
        for product in [*others, *([Product.COLOURS] if self._coloured else [])]:
            size = place.pixels * bytes_per_pixel(product)
            self.parts[product] = (self._end, size)
            self._end += size
        self._others = self._end - 4 * place.pixels * self._coloured
        self._readback = self._gpu.readback(self._end)
        if self._others and not self._gpu.shares_memory and place.out is None:
            place.out = self._gpu.storage(24 * place.pixels)
        out = self._readback.buffer if self._gpu.shares_memory else place.out
        self._scene = self._group("scene", caster.scene_layout, caster.geometry.buffers)
        self._arenas = self._group("arenas", program.arena_layout, program.arenas.buffers)
        rays = (place.shot, place.slopes, place.hits)
        self._rays = {
            writes: self._group(("rays", writes), program.shot[writes], rays)
            for writes in (True, False)
        }
        self._last: dict[str, Any] = {}
        if self._coloured:
            buffers = (curve, place.colours, place.codes, place.edges)
            self._last["colours"] = self._group("colours", program.last["colours"], buffers)
        if self._others:
            self._last["products"] = self._group(
                ("products", id(out)), program.last["products"], (out, place.motions)
            )

    def run(self, compute: Any, entry: str, samples: int) -> None:
        """Put a pass down, if what is wanted needs it."""
        count = self._place.invocations
        if entry == "sample_edges":
            count = -(-self._place.pixels // (GROUP // samples)) * GROUP
        kind = "products" if entry == "products" else "colours"
        if entry != "shoot":
            if kind not in self._last:
                return
            compute.set_bind_group(3, self._last[kind])
        compute.set_pipeline(self._program.pipeline(entry))
        compute.set_bind_group(0, self._scene)
        compute.set_bind_group(1, self._rays[entry == "shoot"])
        compute.set_bind_group(2, self._arenas)
        compute.dispatch_workgroups(*groups_of(count))

    def collect(self, encoder: Any) -> Readback:
        """Copy to where it can be read what the passes did not write there."""
        place, buffer = self._place, self._readback.buffer
        if self._others and buffer is not place.out and place.out is not None:
            encoder.copy_buffer_to_buffer(place.out, 0, buffer, 0, self._others)
        if self._coloured:
            size = 4 * place.pixels
            encoder.copy_buffer_to_buffer(place.codes, 0, buffer, self._others, size)
        return self._readback

    def _group(self, key: Any, layout: Any, buffers: Sequence[Any]) -> Any:
        """A bind group, the same again while its buffers are."""
        held = self._place.bound.get(key)
        same = held is not None and all(a is b for a, b in zip(held[0], buffers, strict=True))
        if held is None or not same:
            held = (tuple(buffers), self._gpu.group(layout, buffers))
            self._place.bound[key] = held
        return held[1]


def _split(array: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Numbers in single precision, and what that leaves of them."""
    main = array.astype(np.float32)
    return main, (array - main).astype(np.float32)
