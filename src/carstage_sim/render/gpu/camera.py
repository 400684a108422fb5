"""Cameras on a card: one cast, and of it only the pictures that are asked for."""

from __future__ import annotations

import math
import weakref
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.film import Film
from carstage_sim.render.gpu.caster import GpuCaster
from carstage_sim.render.gpu.passes import (
    MOST_CAMERAS,
    SHOT_WORDS,
    TILE,
    Exposure,
    PictureBuffers,
    Product,
    begin,
    finish,
    most_together,
    split,
)
from carstage_sim.render.gpu.program import CameraProgram, frame_source
from carstage_sim.render.gpu.transfer import Readback
from carstage_sim.render.materials import material_table
from carstage_sim.render.motion import RIGID, Motions, no_motion
from carstage_sim.render.quality import SAMPLING, Quality
from carstage_sim.render.scene import Frame
from carstage_sim.render.sky import Lighting

_MOST_SAMPLES = 8
_MOST_BYTES = 2 << 30
"""Of the card's memory, for buffers of cameras that were seen before."""


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
class Pending:
    """Pictures of cameras that the card is working at.

    Attributes:
        readback: where they arrive.
        parts: of each camera, where each picture begins there, and its bytes.
        submission: what makes them.
    """

    readback: Readback
    parts: list[dict[Product, tuple[int, int]]]
    submission: int

    def pictures(self) -> list[dict[Product, NDArray[np.uint8]]]:
        """Bytes of each camera's pictures, flat; waits for the card. Once."""
        data = self.readback.bytes(self.submission)
        return [
            {product: data[a : a + n] for product, (a, n) in of_one.items()}
            for of_one in self.parts
        ]


class GpuCameras:
    """Takes pictures on a card; several threads may call it.

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
        self._under_way: set[int] = set()
        self._buffers: dict[tuple[int, int], PictureBuffers] = {}
        self._curves: dict[float, Any] = {}

    @property
    def busy(self) -> bool:
        """Whether pictures were begun that have not been received yet."""
        return bool(self._under_way)

    def most_together(self, pixels: int) -> int:
        """How many cameras with so many pixels may be taken together."""
        return most_together(self._gpu, pixels)

    def take(
        self,
        frame: Frame,
        shots: Sequence[Shot],
        products: Collection[Product],
        light: Lighting,
        *,
        film: Film | None = None,
        motions: Motions | None = None,
    ) -> Pending:
        """Begin pictures of cameras of one lens, which the card makes together.

        Args:
            frame: what is seen.
            shots: the cameras; not more than :meth:`most_together`.
            products: the pictures of each.
            light: of the weather; only colours need it.
            film: how light becomes codes.
            motions: since the last picture; only flow needs them, which one camera has by itself.

        Raises:
            ValueError: the cameras cannot be taken together.
        """
        first = shots[0]
        if any(_lens_of(shot) != _lens_of(first) for shot in shots):
            raise ValueError("cameras of several lenses")
        if len(shots) > (1 if Product.FLOW in products else MOST_CAMERAS):
            raise ValueError(f"{len(shots)} cameras at once")
        with self._gpu.handing_over:
            return self._take(frame, shots, products, light, film or Film(), motions)

    def _take(
        self,
        frame: Frame,
        shots: Sequence[Shot],
        products: Collection[Product],
        light: Lighting,
        film: Film,
        motions: Motions | None,
    ) -> Pending:
        source = frame_source(frame, self._materials, film.exposed(light))
        self._caster.geometry.update(frame.scene)
        if self._program is None:
            self._program = CameraProgram(self._caster, source, epic=self._epic)
        place = self._place(shots)
        lamps_on = bool(light.night > 0) or bool((frame.lamps.power.sum(axis=1) > 0).any())
        exposure = Exposure(self._caster, self._program, place, products, self._curve(film))
        self._aim(place, shots, sum(products), exposure.words, lamps_on)
        begin(exposure)
        # The card casts while the rest is brought to it.
        self._program.arenas.update(source)
        if motions is not None and Product.FLOW in products:
            self._write_motions(place, motions)
        submission = finish(exposure)
        self._under_way.add(submission)
        # Also if nobody asks for them.
        weakref.finalize(exposure.readback, self._under_way.discard, submission)
        return Pending(exposure.readback, exposure.parts, submission)

    def _write_motions(self, place: PictureBuffers, motions: Motions) -> None:
        words = _motion_words(motions)
        if place.motions.size < words.nbytes:
            place.motions = self._gpu.storage(2 * words.nbytes)
        self._gpu.write(place.motions, words)

    def warm_up(self, frame: Frame, light: Lighting) -> None:
        """Compile every pass, and bring the town to the card."""
        slopes = np.zeros((TILE * TILE, 2))
        shot = Shot(TILE, TILE, 90.0, slopes, np.zeros(3), np.eye(3), -1, 0.1, 1.0)
        still = no_motion(len(frame.actor_id))
        self.take(frame, [shot], list(Product), light, motions=still).pictures()
        self._caster.cast(frame.scene, np.zeros(3), np.eye(3, dtype=np.float32), low=0.1, high=1.0)

    def _place(self, shots: Sequence[Shot]) -> PictureBuffers:
        """The buffers of a lens: what cameras leave in them is read before the next come."""
        first = shots[0]
        key = (id(first.slopes), len(shots))
        place = self._buffers.pop(key, None)
        if place is None:
            size, samples = (first.width, first.height), len(self._sampling.offsets)
            place = PictureBuffers(self._gpu, size, first.slopes, samples, len(shots))
            while self._buffers and self._held_bytes() + place.bytes > _MOST_BYTES:
                self._buffers.pop(next(iter(self._buffers)))
        self._buffers[key] = place  # the last one that was used is the last one to go
        return place

    def _held_bytes(self) -> int:
        return sum(place.bytes for place in self._buffers.values())

    def _aim(
        self,
        place: PictureBuffers,
        shots: Sequence[Shot],
        wanted: int,
        words_of_one: int,
        lamps_on: bool,
    ) -> None:
        offsets = self._sampling.offsets
        if len(offsets) > _MOST_SAMPLES:
            raise ValueError(f"more than {_MOST_SAMPLES} extra rays of a pixel")
        lens = shots[0]
        half_width = math.tan(math.radians(lens.fov_deg) / 2.0)
        words = np.zeros(SHOT_WORDS, np.float32)
        whole = words.view(np.int32)
        whole[:4] = lens.width, lens.height, len(offsets), len(shots)
        words[4:8] = lens.low, lens.high, 2.0 * half_width / lens.width, half_width
        whole[8:12] = self._sampling.strong, self._sampling.weak, 0, wanted
        whole[12:14] = words_of_one, lamps_on
        words[16:48].reshape(8, 4)[: len(offsets), :2] = offsets
        axes, skip = words[48:].reshape(-1, 8, 4), whole[48:].reshape(-1, 8, 4)[:, 7, 0]
        for number, shot in enumerate(shots):
            axes[number, :3, :3], axes[number, 4:7, :3] = split(shot.rotation.T)
            axes[number, 3, :3] = shot.location
            skip[number] = shot.skip_row
        self._gpu.write(place.shot, words)

    def _curve(self, film: Film) -> Any:
        if film.gamma not in self._curves:
            steps = (np.arange(8192, dtype=np.float32) / np.float32(8191.0)).reshape(-1, 1)
            curve = self._gpu.storage(8192)
            self._gpu.write(curve, film.encode(steps).reshape(-1).view(np.uint32))
            self._curves[film.gamma] = curve
        return self._curves[film.gamma]


def _lens_of(shot: Shot) -> tuple[object, ...]:
    """What cameras that are taken together share."""
    return id(shot.slopes), shot.width, shot.height, shot.fov_deg, shot.low, shot.high


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
