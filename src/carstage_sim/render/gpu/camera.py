"""Cameras on a card: one cast, and of it only the pictures that are asked for."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.film import Film
from carstage_sim.render.gpu.caster import GROUP, GpuCaster, groups_of
from carstage_sim.render.gpu.device import Gpu
from carstage_sim.render.gpu.program import CameraProgram, frame_source, words_of
from carstage_sim.render.gpu.transfer import Readback
from carstage_sim.render.materials import material_table
from carstage_sim.render.motion import RIGID, Motions, no_motion
from carstage_sim.render.quality import SAMPLING, Quality
from carstage_sim.render.scene import Frame
from carstage_sim.render.sky import Lighting

_MOST_SAMPLES = 8
_SHOT_WORDS = 72
_TILE = 8
_MOST_SIZES = 8


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


class _PictureBuffers:
    """Buffers of cameras with one lens, and the bind groups over them.

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
        self.out = gpu.storage(24 * pixels)
        self.motions = gpu.storage(64)
        self.bound: dict[Any, tuple[tuple[Any, ...], Any]] = {}
        gpu.write(self.slopes, np.stack(_split(shot.slopes), axis=2))


@dataclass(frozen=True, slots=True)
class Pending:
    """Pictures of a camera that the card is working at.

    Attributes:
        readback: where they arrive.
        parts: where each begins there, and its bytes.
        submission: what makes them.
    """

    readback: Readback
    parts: dict[Product, tuple[int, int]]
    submission: int

    def pictures(self) -> dict[Product, NDArray[np.uint8]]:
        """Bytes of each picture, flat; waits for the card. Once."""
        data = self.readback.bytes(self.submission)
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
        self._buffers: dict[int, _PictureBuffers] = {}
        self._curves: dict[float, Any] = {}

    def take(
        self,
        frame: Frame,
        shot: Shot,
        products: Collection[Product],
        light: Lighting,
        *,
        film: Film | None = None,
        motions: Motions | None = None,
    ) -> Pending:
        """Begin pictures of one camera.

        Args:
            frame: what is seen.
            shot: the camera.
            products: the pictures.
            light: of the weather; only colours need it.
            film: how light becomes codes.
            motions: since this camera's last picture; only flow needs them.
        """
        film = film or Film()
        source = frame_source(frame, self._materials, film.exposed(light))
        self._caster.geometry.update(frame.scene)
        if self._program is None:
            self._program = CameraProgram(self._caster, source, epic=self._epic)
        self._program.arenas.update(source)
        place = self._place(shot)
        self._aim(place, shot, sum(products))
        if motions is not None:
            words = _motion_words(motions)
            if place.motions.size < words.nbytes:
                place.motions = self._gpu.storage(2 * words.nbytes)
            self._gpu.write(place.motions, words)
        work = _Work(self._caster, self._program, place, self._curve(film), products)
        return work.expose(len(self._sampling.offsets))

    def warm_up(self, frame: Frame, light: Lighting) -> None:
        """Compile every pass, and bring the town to the card."""
        slopes = np.zeros((_TILE * _TILE, 2))
        shot = Shot(_TILE, _TILE, 90.0, slopes, np.zeros(3), np.eye(3), -1, 0.1, 1.0)
        still = no_motion(len(frame.actor_id))
        self.take(frame, shot, list(Product), light, motions=still).pictures()
        self._caster.cast(frame.scene, np.zeros(3), np.eye(3, dtype=np.float32), low=0.1, high=1.0)

    def _place(self, shot: Shot) -> _PictureBuffers:
        """The buffers of a lens: what one camera leaves in them is copied before the next comes."""
        place = self._buffers.get(id(shot.slopes))
        if place is None:
            if len(self._buffers) == _MOST_SIZES:
                self._buffers.pop(next(iter(self._buffers)))
            place = self._buffers[id(shot.slopes)] = _PictureBuffers(self._gpu, shot)
        return place

    def _aim(self, place: _PictureBuffers, shot: Shot, wanted: int) -> None:
        offsets = self._sampling.offsets
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
        numbers[7:11] = self._sampling.strong, self._sampling.weak, 0, wanted
        numbers[11:] = words_of([half_width])
        self._gpu.write(place.shot, np.concatenate([words_of(axes), numbers, words_of(places)]))

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
        place: _PictureBuffers,
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
        self._scene = self._group("scene", caster.scene_layout, caster.geometry.buffers)
        self._arenas = self._group("arenas", program.arena_layout, program.arenas.buffers)
        rays = (place.shot, place.slopes, place.hits)
        self._rays = {
            writes: self._group(("rays", writes), program.shot[writes], rays)
            for writes in (True, False)
        }
        self._last: dict[str, Any] = {}
        if self._coloured:
            film = (curve, place.colours, place.codes, place.edges)
            self._last["colours"] = self._group("colours", program.last["colours"], film)
        if self._others:
            out = (place.out, place.motions)
            self._last["products"] = self._group("products", program.last["products"], out)

    def expose(self, samples: int) -> Pending:
        """Let the card cast and make the pictures.

        Args:
            samples: extra rays of a pixel on an edge.
        """
        place = self._place
        on_edges = -(-place.pixels // (GROUP // samples)) * GROUP
        encoder = self._gpu.device.create_command_encoder()
        compute = encoder.begin_compute_pass()
        compute.set_bind_group(0, self._scene)
        compute.set_bind_group(2, self._arenas)
        self._run(compute, "shoot", place.invocations)
        if self._others:
            self._run(compute, "products", place.invocations)
        if self._coloured:
            self._run(compute, "shade", place.invocations)
            self._run(compute, "find_edges", place.invocations)
            # At most so many are on edges: groups that find no work end at once.
            self._run(compute, "sample_edges", on_edges)
        compute.end()
        target = self._readback.buffer
        if self._others:
            encoder.copy_buffer_to_buffer(place.out, 0, target, 0, self._others)
        if self._coloured:
            size = 4 * place.pixels
            encoder.copy_buffer_to_buffer(place.codes, 0, target, self._others, size)
        return Pending(self._readback, self.parts, self._gpu.submit(encoder))

    def _run(self, compute: Any, entry: str, invocations: int) -> None:
        compute.set_pipeline(self._program.pipeline(entry))
        compute.set_bind_group(1, self._rays[entry == "shoot"])
        if entry != "shoot":
            compute.set_bind_group(3, self._last[entry if entry == "products" else "colours"])
        compute.dispatch_workgroups(*groups_of(invocations))

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


def _motion_words(motions: Motions) -> NDArray[np.float32]:
    """``(N, 4)`` what the shader reads.

    Four rows for the town and for each instance: three of rotation minus identity, and shift; then
    the row, less three for each triangle before the instance's first, at which the corners of its
    bend begin, and 1 if there are any. After them the corners.
    """
    turns = np.concatenate([motions.turn - np.eye(3), motions.shift[:, :, None]], axis=2)
    parts = np.concatenate([np.zeros(1, np.int32), motions.part])
    words = np.zeros((4 * len(parts) + 3 * len(motions.bend), 4), np.float32)
    heads, corners = words[: 4 * len(parts)].reshape(-1, 4, 4), words[4 * len(parts) :]
    heads[:, :3] = turns[parts]
    bends = motions.bent != RIGID
    begin = 4 * len(parts) + 3 * (motions.bent - motions.first)
    heads[1:, 3, 0] = np.where(bends, begin, 0).astype(np.int32).view(np.float32)
    heads[1:, 3, 1] = bends
    corners[:, :3] = motions.bend.reshape(-1, 3)
    return words
