"""The passes of cameras in a card's queue.

A card waits between passes until the last ray has found its way. What comes of sun and sky is found
in a pass of its own, where rays that go one way run side by side. Extra rays of pixels on edges are
listed by the card, so that no lane idles.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import IntFlag
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.gpu.caster import GpuCaster, groups_of, looping_groups
from carstage_sim.render.gpu.device import BindGroups, Gpu
from carstage_sim.render.gpu.native import Commands
from carstage_sim.render.gpu.program import LOOPING, WRITES_HITS, CameraProgram
from carstage_sim.render.gpu.transfer import Readback

MOST_CAMERAS = 8
"""Cameras in ``Shot`` of ``shot.wgsl``."""
SHOT_WORDS = 48 + 32 * MOST_CAMERAS
"""Words of ``Shot``."""
TILE = 8
"""Pixels along a side of what a work group takes."""
_HIT_BYTES = 20
_PIXEL_BYTES, _EXTRA_BYTES = _HIT_BYTES + 36, _HIT_BYTES + 24
"""Of all buffers of a pixel, and of an extra ray."""
_HEAD = 512
_MOST_PIXELS = 5 << 20
"""Of pictures that are made together: beyond, nothing is gained, and their buffers grow."""
_MOST_BANDS = _HEAD // 2
"""As in ``batch.wgsl``."""
_WRITING_GROUPS = 128
"""Work groups that write into the program's memory: as many as the way there takes, so that the
rest of the card finds the light meanwhile."""
_MOST_EXTRA = 5 << 21
"""Extra rays that are under way at once, fewer than ``edge.wgsl`` has bits for: pictures that may
have more are sampled in bands."""


class Product(IntFlag):
    """What a camera's picture can show."""

    COLOURS = 1
    DEPTH = 2
    TAGS = 4
    INSTANCES = 8
    NORMALS = 16
    FLOW = 32


_ORDER = (Product.FLOW, Product.DEPTH, Product.TAGS, Product.INSTANCES, Product.NORMALS)
"""How a camera's pictures but the colours follow each other."""


def bytes_per_pixel(product: Product) -> int:
    """Flow is two numbers of 32 bits, the others are B, G, R, A."""
    return 8 if product is Product.FLOW else 4


class ColourBuffers:
    """What the colours of pictures need beside their hits.

    Args:
        gpu: the card.
        size: pixels of a row, and rows of all pictures.
        samples: extra rays of a pixel on an edge.

    Attributes:
        light, colours, codes, picture, edges: of pixels.
        hits, light_of_extra, sampled, list: of extra rays: what they met, the light that comes
            there, their colours, and which they are.
        most: extra rays that there is room for.
        bands: what a pass does for the extra rays, band after band of the pictures.
    """

    def __init__(self, gpu: Gpu, size: tuple[int, int], samples: int) -> None:
        width, height = size
        rows = min(max(_most_extra(gpu) // (width * samples), 1), height)
        starts = range(0, height, rows)
        if len(starts) > _MOST_BANDS:
            raise ValueError(f"a picture of {width}x{height} pixels is too large for the card")
        pixels, extra = width * height, rows * width * samples
        self.most = extra
        self.light, self.light_of_extra = gpu.storage(4 * pixels), gpu.storage(4 * extra)
        self.colours, self.codes = gpu.storage(16 * pixels), gpu.storage(4 * pixels)
        self.picture, self.edges = gpu.storage(4 * pixels), gpu.storage(8 * rows * width)
        self.hits, self.sampled = gpu.storage(_HIT_BYTES * extra), gpu.storage(16 * extra)
        self.list = gpu.storage(4 * (_HEAD + extra))
        self.bands = [
            _batch(gpu, 1, extra, first, min(first + rows, height), number)
            for number, first in enumerate(starts)
        ]


class PictureBuffers:
    """Buffers of cameras of one lens, so many at a time, and the bind groups over them.

    Args:
        gpu: the card.
        size: width and height in pixels.
        slopes: ``(H * W, 2)`` of its lens.
        samples: extra rays of a pixel on an edge.
        cameras: whose pictures are made together.

    Attributes:
        slopes_of: the array whose slopes are on the card.
        cameras: how many.
        pixels: of a picture.
        bytes: of the card's memory that they take, those of colours included.
        invocations: one for each pixel of whole tiles of all pictures.
        whole: what a pass does for the rays through pixels' centres.
        shot, slopes, hits, motions: of the cameras.
        unused: what a pass is given that it does not touch for these rays.
        bound: the bind groups.
    """

    def __init__(
        self,
        gpu: Gpu,
        size: tuple[int, int],
        slopes: NDArray[np.float64],
        samples: int,
        cameras: int,
    ) -> None:
        width, height = size
        self.pixels, self.cameras = width * height, cameras
        pixels, rows = cameras * self.pixels, cameras * height
        self.slopes_of = slopes
        extra = min(pixels * samples, _most_extra(gpu))
        self.bytes = 16 * self.pixels + _PIXEL_BYTES * pixels + _EXTRA_BYTES * extra
        self.invocations = cameras * -(-width // TILE) * -(-height // TILE) * TILE * TILE
        self.slopes, self.hits = gpu.storage(16 * self.pixels), gpu.storage(_HIT_BYTES * pixels)
        self.motions = gpu.storage(64)
        self.unused = [gpu.storage(4), gpu.storage(4)]
        self.shot = gpu.uniform(SHOT_WORDS * 4)
        self.whole = _batch(gpu, 0, pixels, 0, rows, 0)
        self.bound = BindGroups(gpu)
        self._made_for = (gpu, (width, rows), samples)
        gpu.write(self.slopes, np.stack(split(slopes), axis=2))

    @cached_property
    def of_colours(self) -> ColourBuffers:
        """Made for the first cameras that want colours.

        Raises:
            ValueError: a picture is too large.
        """
        return ColourBuffers(*self._made_for)


def split(array: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Numbers in single precision, and what that leaves of them."""
    main = array.astype(np.float32)
    return main, (array - main).astype(np.float32)


def _batch(gpu: Gpu, *words: int) -> Any:
    """Which rays a pass is about, as ``Batch`` in ``batch.wgsl`` has it."""
    buffer = gpu.uniform(32)
    gpu.write(buffer, np.array([*words, 0, 0, 0], np.uint32))
    return buffer


def _most_extra(gpu: Gpu) -> int:
    return min(_MOST_EXTRA, gpu.largest // _HIT_BYTES)


def most_together(gpu: Gpu, pixels: int) -> int:
    """How many cameras with so many pixels may have their pictures made together."""
    room = min(_MOST_PIXELS, gpu.largest // _HIT_BYTES) // pixels
    return min(max(room, 1), MOST_CAMERAS)


class Exposure:
    """The passes of cameras of one lens, whose pictures are made together.

    Args:
        caster: the card and the scene on it.
        program: the pipelines.
        place: the cameras' buffers.
        products: what is asked for of each.
        curve: of the film.

    Attributes:
        gpu: the card.
        words: of a camera's pictures but the colours.
        parts: of each camera, where in the read-back each picture begins, and its bytes; colours of
            all cameras come last.
        readback: where they arrive.
        colours_at: where in the read-back the colours begin.
        coloured: whether they are asked for.
        has_others: whether other pictures are.
        lends: whether extra rays take colours of pixels beside them.
    """

    def __init__(
        self,
        caster: GpuCaster,
        program: CameraProgram,
        place: PictureBuffers,
        products: Collection[Product],
        curve: Any,
    ) -> None:
        self.gpu, self._program, self.place = caster.gpu, program, place
        self.coloured, self.lends = Product.COLOURS in products, program.lends
        others = [product for product in _ORDER if product in products]
        self.parts: list[dict[Product, tuple[int, int]]] = [{} for _ in range(place.cameras)]
        end = 0
        for part in self.parts:
            for product in others:
                size = place.pixels * bytes_per_pixel(product)
                part[product] = (end, size)
                end += size
        self.colours_at = end
        if self.coloured:
            for part in self.parts:
                part[Product.COLOURS] = (end, 4 * place.pixels)
                end += 4 * place.pixels
        self.words = self.colours_at // 4 // place.cameras
        self.has_others = bool(others)
        self.readback: Readback = self.gpu.readback(end)
        self._scene = place.bound.of("scene", caster.scene_layout, caster.geometry.buffers)
        first, second = place.unused
        self._needed = {"shoot": [first]}
        self._needed_of_extra: dict[str, list[Any]] = {}
        if self.coloured:
            made = place.of_colours
            self._needed |= {
                "reach": [first, made.light],
                "shade": [first, curve, made.colours, made.picture, made.codes, made.light],
                "find_edges": [made.list, made.codes, made.edges],
                "lend": [made.list, made.colours, made.sampled, made.hits],
                "blend_edges": [
                    made.list, curve, made.colours, made.picture, made.edges, made.sampled
                ],
            }  # fmt: skip
            self._needed_of_extra = {
                "shoot": [made.list],
                "reach": [made.list, made.light_of_extra],
                "shade": [made.list, curve, made.sampled, first, second, made.light_of_extra],
            }

    def run(self, commands: Commands, entry: str, band: int = -1, *, extra: bool = False) -> None:
        """A pass.

        Args:
            commands: where it is recorded.
            entry: its name.
            band: of the picture, -1 for all of it.
            extra: whether it is about extra rays: the card alone knows how many there are.
        """
        place, program = self.place, self._program
        batch, hits, invocations = place.whole, place.hits, place.invocations
        if band >= 0:
            batch = place.of_colours.bands[band]
        if extra:
            hits, invocations = place.of_colours.hits, place.of_colours.most
        size = looping_groups(invocations) if entry in LOOPING else groups_of(invocations)
        key: tuple[Any, ...] = (entry, band)
        if entry == "products":
            last, key = [self.readback.buffer, place.motions], (entry, id(self.readback.buffer))
            size = min(size[0], _WRITING_GROUPS), 1, 1
        else:
            last = [batch, *(self._needed_of_extra if extra else self._needed)[entry]]
        writes = entry == WRITES_HITS
        rays = (place.shot, place.slopes, hits)
        groups = (
            self._scene,
            place.bound.of(("rays", writes, extra), program.shot[writes], rays),
            place.bound.of("arenas", program.arena_layout, program.arenas.buffers),
            place.bound.of(key, program.last[entry], last),
        )
        commands.dispatch(program.pipeline(entry), groups, size)


def begin(one: Exposure) -> None:
    """Let a card cast the cameras' rays; what else their passes read may be brought meanwhile."""
    commands = one.gpu.commands()
    if one.coloured:
        made = one.place.of_colours
        commands.clear(made.list, 8 * len(made.bands))
    one.run(commands, "shoot")
    commands.submit()


def finish(one: Exposure) -> int:
    """Let it make the pictures; the number of the submission that ends them."""
    commands = one.gpu.commands()
    if one.has_others:
        # Into the program's memory. What comes next writes nothing that it reads: both run at once.
        one.run(commands, "products")
    if one.coloured:
        made = one.place.of_colours
        one.run(commands, "reach")
        one.run(commands, "shade")
        for band in range(len(made.bands)):
            one.run(commands, "find_edges", band)
            one.run(commands, "shoot", band, extra=True)
            if one.lends:
                one.run(commands, "lend", band)
            one.run(commands, "reach", band, extra=True)
            one.run(commands, "shade", band, extra=True)
            one.run(commands, "blend_edges", band)
        size = 4 * one.place.pixels * one.place.cameras
        commands.copy(made.picture, 0, one.readback.buffer, one.colours_at, size)
    return commands.submit()
