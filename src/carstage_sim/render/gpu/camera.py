"""Cameras on a card: one cast, and of it only the pictures that are asked for."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.film import Film
from carstage_sim.render.gpu.caster import GpuCaster
from carstage_sim.render.gpu.passes import (
    SHOT_WORDS,
    TILE,
    Exposure,
    PictureBuffers,
    Product,
    begin,
    finish,
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
_MOST_SIZES = 8


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
        self._buffers: dict[int, PictureBuffers] = {}
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
        with self._gpu.handing_over:
            return self._take(frame, shot, products, light, film or Film(), motions)

    def _take(
        self,
        frame: Frame,
        shot: Shot,
        products: Collection[Product],
        light: Lighting,
        film: Film,
        motions: Motions | None,
    ) -> Pending:
        source = frame_source(frame, self._materials, film.exposed(light))
        self._caster.geometry.update(frame.scene)
        if self._program is None:
            self._program = CameraProgram(self._caster, source, epic=self._epic)
        place = self._place(shot)
        lamps_on = bool(light.night > 0) or bool((frame.lamps.power.sum(axis=1) > 0).any())
        self._aim(place, shot, sum(products), lamps_on)
        exposure = Exposure(self._caster, self._program, place, products, self._curve(film))
        begin(exposure)
        # The card casts while the rest is brought to it.
        self._program.arenas.update(source)
        if motions is not None and Product.FLOW in products:
            self._write_motions(place, motions)
        return Pending(exposure.readback, exposure.parts, finish(exposure))

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
        self.take(frame, shot, list(Product), light, motions=still).pictures()
        self._caster.cast(frame.scene, np.zeros(3), np.eye(3, dtype=np.float32), low=0.1, high=1.0)

    def _place(self, shot: Shot) -> PictureBuffers:
        """The buffers of a lens: what one camera leaves in them is read before the next comes."""
        place = self._buffers.get(id(shot.slopes))
        if place is None:
            if len(self._buffers) == _MOST_SIZES:
                self._buffers.pop(next(iter(self._buffers)))
            size, samples = (shot.width, shot.height), len(self._sampling.offsets)
            place = PictureBuffers(self._gpu, size, shot.slopes, samples)
            self._buffers[id(shot.slopes)] = place
        return place

    def _aim(self, place: PictureBuffers, shot: Shot, wanted: int, lamps_on: bool) -> None:
        offsets = self._sampling.offsets
        if len(offsets) > _MOST_SAMPLES:
            raise ValueError(f"more than {_MOST_SAMPLES} extra rays of a pixel")
        half_width = math.tan(math.radians(shot.fov_deg) / 2.0)
        words = np.zeros(SHOT_WORDS, np.float32)
        axes, whole = words[:28].reshape(7, 4), words.view(np.int32)
        axes[:3, :3], axes[4:, :3] = split(shot.rotation.T)
        axes[3, :3] = shot.location
        whole[28:32] = shot.width, shot.height, shot.skip_row, len(offsets)
        words[32:35] = shot.low, shot.high, 2.0 * half_width / shot.width
        whole[35:39] = self._sampling.strong, self._sampling.weak, 0, wanted
        words[39] = half_width
        whole[40] = lamps_on
        words[44:].reshape(-1, 4)[: len(offsets), :2] = offsets
        self._gpu.write(place.shot, words)

    def _curve(self, film: Film) -> Any:
        if film.gamma not in self._curves:
            steps = (np.arange(8192, dtype=np.float32) / np.float32(8191.0)).reshape(-1, 1)
            curve = self._gpu.storage(8192)
            self._gpu.write(curve, film.encode(steps).reshape(-1).view(np.uint32))
            self._curves[film.gamma] = curve
        return self._curves[film.gamma]


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
