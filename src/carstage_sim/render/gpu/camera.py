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
from carstage_sim.render.gpu.caster import MOST_GROUPS, GpuCaster, groups_of
from carstage_sim.render.gpu.device import Gpu, Readback, padded
from carstage_sim.render.gpu.program import CameraProgram, frame_source, words_of
from carstage_sim.render.materials import material_table
from carstage_sim.render.quality import SAMPLING, Quality
from carstage_sim.render.scene import Frame
from carstage_sim.render.sky import Lighting

_MOST_EXTRA_RAYS = MOST_GROUPS * 64
"""Extra rays of a round; a picture that has more takes several rounds."""
_MOST_SAMPLES = 8
_SHOT_WORDS = 72
_TILE = 8
_MOST_ROOMS = 8


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


class _Room:
    """Buffers of cameras with one lens, and the bind groups over them.

    Attributes:
        invocations: one for each pixel of whole tiles.
        slopes_of: the array whose slopes are on the card.
    """

    def __init__(self, gpu: Gpu, shot: Shot, samples: int) -> None:
        pixels = self.pixels = shot.width * shot.height
        self.invocations = -(-shot.width // _TILE) * -(-shot.height // _TILE) * _TILE * _TILE
        self.slopes_of = shot.slopes
        extra = min(pixels * samples, _MOST_EXTRA_RAYS // samples * samples)
        self.extra_rays = max(extra, samples)
        self.rounds = -(-pixels * samples // self.extra_rays)
        self.shot = gpu.uniform(_SHOT_WORDS * 4)
        self.passes = [gpu.uniform(16) for _ in range(1 + self.rounds)]
        self.slopes, self.hits = gpu.storage(16 * pixels), gpu.storage(20 * pixels)
        self.colours, self.codes = gpu.storage(16 * pixels), gpu.storage(4 * pixels)
        self.edges = gpu.storage(4 + 4 * pixels)
        self.extra_hits = gpu.storage(20 * self.extra_rays)
        self.extra_colours = gpu.storage(16 * self.extra_rays)
        # A pass may not write what tells how much work there is.
        self.plan, self.groups = gpu.storage(16 * self.rounds), gpu.storage(16 * self.rounds)
        self.out = gpu.storage(24 * pixels)
        self.motions = gpu.storage(48)
        gpu.write(self.slopes, np.stack(_split(shot.slopes), axis=2))
        self.bound: dict[Any, tuple[tuple[Any, ...], Any]] = {}
        rays = [(pixels, 0, 0)] + [
            (self.extra_rays, 1, r * self.extra_rays) for r in range(self.rounds)
        ]
        for buffer, (count, edges, first) in zip(self.passes, rays, strict=True):
            gpu.write(buffer, np.array([count, edges, first, 0], np.uint32))


_Parts = dict[Product, tuple[int, int]]
"""Where in a read-back each picture begins, and its bytes."""


@dataclass(frozen=True, slots=True)
class Pending:
    """Pictures that the card is working at; those that are ready first come first."""

    parts: Sequence[tuple[Readback, _Parts]]

    def pictures(self) -> dict[Product, NDArray[np.uint8]]:
        """Bytes of each picture, flat; waits for the card. Once."""
        found: dict[Product, NDArray[np.uint8]] = {}
        for readback, parts in self.parts:
            data = readback.bytes()
            found |= {product: data[a : a + n] for product, (a, n) in parts.items()}
        return found


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
        self._rooms: dict[int, _Room] = {}
        self._curves: dict[float, Any] = {}

    def take(
        self,
        frame: Frame,
        shot: Shot,
        products: Collection[Product],
        light: Lighting,
        *,
        film: Film | None = None,
        turns: NDArray[np.float64] | None = None,
    ) -> Pending:
        """Begin pictures of one camera.

        Args:
            frame: what is seen.
            shot: the camera.
            products: the pictures.
            light: of the weather; only colours need it.
            film: how light becomes codes.
            turns: ``(I + 1, 3, 4)`` rotation minus identity, and shift, that take a point from
                today's camera axes to those of before: of the town, then of each instance row; only
                flow needs it.
        """
        film = film or Film()
        source = frame_source(frame, self._materials, film.exposed(light))
        self._caster.geometry.update(frame.scene)
        if self._program is None:
            self._program = CameraProgram(self._caster, source, epic=self._epic)
        self._program.arenas.update(source)
        place = self._place(shot)
        wanted = sorted(products)
        self._aim(place, shot, sum(wanted))
        if turns is not None:
            rows = turns.astype(np.float32)
            if place.motions.size < rows.nbytes:
                place.motions = self._gpu.storage(2 * rows.nbytes)
            self._gpu.write(place.motions, rows)
        work = _Work(self._caster, self._program, place, self._curve(film))
        return work.expose(wanted)

    def warm_up(self, frame: Frame, light: Lighting) -> None:
        """Compile every pass, and bring the town to the card."""
        slopes = np.zeros((_TILE * _TILE, 2))
        shot = Shot(_TILE, _TILE, 90.0, slopes, np.zeros(3), np.eye(3), -1, 0.1, 1.0)
        turns = np.zeros((1 + len(frame.actor_id), 3, 4))
        self.take(frame, shot, list(Product), light, turns=turns).pictures()
        self._caster.cast(frame.scene, np.zeros(3), np.eye(3, dtype=np.float32), low=0.1, high=1.0)

    def _place(self, shot: Shot) -> _Room:
        """The buffers of a lens: what one camera leaves in them is copied before the next comes."""
        place = self._rooms.get(id(shot.slopes))
        if place is None:
            if len(self._rooms) == _MOST_ROOMS:
                self._rooms.pop(next(iter(self._rooms)))
            place = _Room(self._gpu, shot, len(self._sampling.offsets))
            self._rooms[id(shot.slopes)] = place
        return place

    def _aim(self, place: _Room, shot: Shot, wanted: int) -> None:
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
    """The passes of one camera, put down one after the other."""

    def __init__(self, caster: GpuCaster, program: CameraProgram, place: _Room, curve: Any) -> None:
        self._gpu = caster.gpu
        self._program = program
        self._place = place
        self._scene = self._group("scene", caster.scene_layout, caster.geometry.buffers)
        self._arenas = self._group("arenas", program.arena_layout, program.arenas.buffers)
        self._last = {
            "develop": (curve, place.codes, place.extra_colours, place.plan),
            "products": (place.out, place.motions),
        }
        self._encoder = self._gpu.device.create_command_encoder()

    def expose(self, products: Sequence[Product]) -> Pending:
        """Cast and make the pictures; colours last, while the others are read back."""
        place = self._place
        parts = []
        self._run(["shoot"])
        others = [product for product in products if product is not Product.COLOURS]
        if others:
            self._run(["products"])
            parts.append(self._submit(place.out, others))
        if len(others) < len(products):
            self._run(["shade", "develop", "find_edges", "plan_rounds"])
            size = padded(16 * place.rounds)
            self._encoder.copy_buffer_to_buffer(place.plan, 0, place.groups, 0, size)
            for number in range(place.rounds):
                self._run(["shoot", "shade", "blend"], number + 1)
            parts.append(self._submit(place.codes, [Product.COLOURS]))
        return Pending(parts)

    def _group(self, key: Any, layout: Any, buffers: Sequence[Any]) -> Any:
        """A bind group, the same again while its buffers are."""
        held = self._place.bound.get(key)
        same = held is not None and all(a is b for a, b in zip(held[0], buffers, strict=True))
        if held is None or not same:
            held = (tuple(buffers), self._gpu.group(layout, buffers))
            self._place.bound[key] = held
        return held[1]

    def _shot_group(self, number: int, *, extra: bool) -> Any:
        place = self._place
        hits = place.extra_hits if extra else place.hits
        colours = place.extra_colours if extra else place.colours
        buffers = (place.shot, place.passes[number], place.slopes, hits, colours, place.edges)
        return self._group((number, extra), self._program.shot, buffers)

    def _run(self, entries: Sequence[str], number: int = 0) -> None:
        """Put passes down: of all pixels (0), or of a round of extra rays."""
        place, program = self._place, self._program
        compute = self._encoder.begin_compute_pass()
        compute.set_bind_group(0, self._scene)
        shot: Any = None
        compute.set_bind_group(2, self._arenas)
        for entry in entries:
            compute.set_pipeline(program.pipeline(entry))
            # Blending reads the colours of the pixels, and the extra ones apart.
            of_edges = number > 0 and entry != "blend"
            group = self._shot_group(1 if entry == "plan_rounds" else number, extra=of_edges)
            if group is not shot:
                compute.set_bind_group(1, group)
                shot = group
            if entry not in ("shoot", "shade"):
                kind = "products" if entry == "products" else "develop"
                last = self._group(kind, program.last[kind], self._last[kind])
                compute.set_bind_group(3, last)
            if entry == "plan_rounds":
                compute.dispatch_workgroups(1, 1, 1)
            elif number:
                compute.dispatch_workgroups_indirect(place.groups, 16 * (number - 1))
            else:
                compute.dispatch_workgroups(*groups_of(place.invocations))
        compute.end()

    def _submit(self, source: Any, products: Sequence[Product]) -> tuple[Readback, _Parts]:
        """Let the card work, and copy pictures to where they can be read."""
        parts: _Parts = {}
        end = 0
        for product in products:
            size = self._place.pixels * bytes_per_pixel(product)
            parts[product] = (end, size)
            end += size
        readback = self._gpu.readback(end)
        readback.copy(self._encoder, source, 0, padded(end))
        self._gpu.device.queue.submit([self._encoder.finish()])
        self._encoder = self._gpu.device.create_command_encoder()
        return readback, parts


def _split(array: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Numbers in single precision, and what that leaves of them."""
    main = array.astype(np.float32)
    return main, (array - main).astype(np.float32)
