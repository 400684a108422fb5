"""Colour pictures from a camera's hits: shading, edges sampled again, developed on a film."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.bvh import build_tree, refitted_tree
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import (
    Hits,
    Packets,
    RayCaster,
    by_rows,
    picture_packets,
    unwritten_hits,
)
from carstage_sim.render.crew import for_workers
from carstage_sim.render.edges import Rough, rough_pixels
from carstage_sim.render.film import Film, develop_means, film_codes
from carstage_sim.render.glare import with_glare
from carstage_sim.render.lending import aim_again, extra_rays, lent, mixed
from carstage_sim.render.materials import material_table
from carstage_sim.render.motion import flow_of_motions, no_motion
from carstage_sim.render.normals import smooth_normals
from carstage_sim.render.overlay import draw_shapes
from carstage_sim.render.packet_shading import new_shade_scratch
from carstage_sim.render.quality import SAMPLING, Quality
from carstage_sim.render.rolling import Rows
from carstage_sim.render.scene import Frame, SceneStore
from carstage_sim.render.shading import RayHits, ShadedFrame
from carstage_sim.render.shared_kernels import share_shade_packets
from carstage_sim.render.sky import Lighting, SkyModel
from carstage_sim.world.state import Weather

_EDGES = 1024
"""Pixels with more rays per piece of work."""
_NO_FILM = np.empty(0, np.uint8), np.empty((0, 4), np.uint8)


@dataclass(frozen=True, slots=True)
class Picture:
    """A camera's hits and what is needed to send more rays through its pixels.

    Attributes:
        width, height: pixels.
        fov_deg: horizontal field of view.
        rotation: ``(3, 3)`` world_from_camera.
        hits: of the pixel centres, row by row.
        skip_row: instance row that rays pass through, -1 for none.
        low, high: interval of depths.
        film: how light becomes codes.
        rows: what each row sees, where they are exposed one after the other; else None.
    """

    width: int
    height: int
    fov_deg: float
    rotation: NDArray[np.float64]
    hits: Hits
    skip_row: int
    low: float
    high: float
    film: Film = field(default_factory=Film)
    rows: Rows | None = None

    def row_of(self, pixels: NDArray[np.integer], samples: int = 1) -> NDArray[np.integer]:
        """The row of each ray, of which there are ``samples`` for each pixel."""
        return np.repeat(pixels // self.width, samples)


class PictureMaker:
    """Paints pictures.

    Args:
        caster: runs the kernels.
        quality: how much work a picture is worth.
    """

    def __init__(self, caster: RayCaster, quality: Quality = Quality.LOW) -> None:
        self._caster = caster
        self._epic = quality is Quality.EPIC
        self._sampling = SAMPLING[quality]
        self._materials = material_table()
        self._scratch = for_workers(caster.crew, new_shade_scratch())
        self.sky = SkyModel()

    def warm_up_rays(self, store: SceneStore) -> None:
        """Compile, or load, what casts and shades rays: half of all kernels' compilation."""
        frame, (hits, packets) = store.frame([]), _nothing_met()
        light, colours = self.sky.lighting(Weather(), 0.0), np.empty((2, 3), np.float32)
        origin, rays = hits.origin.astype(np.float64), hits.directions
        self._caster.cast(frame.scene, origin, rays, low=0.1, high=1000.0)
        self._caster.cast_together(frame.scene, origin, rays, packets, low=0.1, high=1000.0)
        film = film_codes(Film().gamma), np.empty((2, 4), np.uint8)
        self._shade(frame, hits, packets, -1, 1e-3, light, colours, film)

    def warm_up(self, store: SceneStore) -> None:
        """Compile, or load, all other kernels of pictures: of building, sampling, developing.

        Those of blur and noise, which few cameras ask for, are left to the first that does.
        """
        boxes = np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)
        refitted_tree(build_tree(*boxes, 1), *boxes)
        frame, (hits, packets) = store.frame([]), _nothing_met()
        colours = np.zeros((2, 3), np.float32)
        middle = np.zeros((1, 2), np.float32)
        lent(
            self._caster, hits, (2, 1), colours, packets.order, middle, hits, packets,
            colours.copy(),
        )  # fmt: skip
        smooth_normals(self._caster, frame, hits)
        nowhere, flow, before = np.zeros(2), np.empty((2, 2), np.float32), np.empty((2, 0))
        met = hits.row, hits.triangle, hits.weights, hits.t
        still = no_motion(0), *met, nowhere, nowhere, 1.0, 1.0, before, flow
        self._caster.in_parts(flow_of_motions, still, 2)
        film, pixels = Film(), np.zeros((1, 2, 4), np.uint8)
        rough_pixels(
            self._caster, frame, self._materials.detail, hits, pixels, SAMPLING[Quality.LOW]
        )
        offsets, every = np.zeros((1, 3), np.float32), np.ones(2, np.bool_)
        aim = hits.directions, packets.order, offsets, every, colours.copy()
        self._caster.in_parts(aim_again, aim, 2)
        mixed(
            self._caster, frame, self._materials.detail, hits, (2, 1), colours, packets.order,
            middle, packets, colours.copy(),
        )  # fmt: skip
        nothing = np.zeros((2, 3), np.float32)
        self._develop_means(film, nothing, nothing, np.arange(2, dtype=np.int32), pixels)
        with_glare(self._caster, film, np.full((8, 8, 4), 255, np.uint8), 1.0, 1.0)
        line = np.array([[[2.0, 0.0, 0.0], [2.0, 1.0, 0.0]]])
        draw_shapes(
            line, np.ones(1, np.float32), np.zeros(1, np.bool_), np.zeros((1, 3), np.uint8),
            focal_px=1.0, near_m=0.1,
            depth=np.ones((1, 2), np.float32), pixels=pixels[..., 2::-1],
        )  # fmt: skip

    def _shade_picture(
        self,
        frame: Frame,
        picture: Picture,
        hits: Hits,
        packets: Packets,
        row_of: NDArray[np.integer] | None,
        light: Lighting,
        colours: NDArray[np.float32],
        film: tuple[NDArray[np.uint8], NDArray[np.uint8]] = _NO_FILM,
    ) -> None:
        """As :meth:`_shade`; ``row_of``: each ray's, if rows are exposed one by one."""
        rest = picture.skip_row, _pixel_angle(picture), light, colours, film
        if picture.rows is None or row_of is None:
            self._shade(frame, hits, packets, *rest)
            return
        for row, some in by_rows(packets, row_of):
            then = replace(frame, scene=picture.rows.scene(row))
            self._shade(then, replace(hits, origin=picture.rows.origins[row]), some, *rest)

    def _shade(
        self,
        frame: Frame,
        hits: Hits,
        packets: Packets,
        skip_row: int,
        pixel_angle: float,
        light: Lighting,
        colours: NDArray[np.float32],
        film: tuple[NDArray[np.uint8], NDArray[np.uint8]] = _NO_FILM,
    ) -> None:
        """Fill in the colours of rays; no others are looked at.

        With a film's codes and ``(N, 4)`` uint8 BGRA pixels these are developed, too.
        """
        shaded = ShadedFrame(
            frame.scene, frame.static, frame.actors, frame.appearance, frame.colour,
            frame.light_state, self._materials, light, frame.lamps,
        )  # fmt: skip
        rays = RayHits(
            hits.origin, hits.directions, hits.t, hits.row, hits.triangle, hits.weights,
            skip_row, np.float32(pixel_angle),
        )  # fmt: skip

        data = (
            self._scratch, shaded, rays, self._epic, packets.order, packets.starts, colours,
            *film,
        )  # fmt: skip
        self._caster.in_packets(share_shade_packets, data, packets)

    def paint(self, frame: Frame, picture: Picture, light: Lighting) -> NDArray[np.uint8]:
        """``(H, W, 3)`` uint8 sRGB picture; pixels on edges are the mean of several rays.

        Rough ones amid their like are the mean of themselves and those around them.
        """
        return self.pixels(frame, picture, light)[..., 2::-1]

    def pixels(self, frame: Frame, picture: Picture, light: Lighting) -> NDArray[np.uint8]:
        """As :meth:`paint`, ``(H, W, 4)`` BGRA with alpha 255."""
        light = picture.film.exposed(light)
        count = picture.width * picture.height
        colours = np.empty((count, 3), np.float32)
        whole = picture_packets(picture.width, picture.height)
        rows = None if picture.rows is None else picture.row_of(np.arange(count))
        pixels = np.empty((picture.height, picture.width, 4), np.uint8)
        codes = film_codes(picture.film.gamma)
        film = codes, pixels.reshape(-1, 4)
        self._shade_picture(frame, picture, picture.hits, whole, rows, light, colours, film)
        rough = rough_pixels(
            self._caster, frame, self._materials.detail, picture.hits, pixels, self._sampling,
            (codes, colours),
        )  # fmt: skip
        if len(rough.pixels):
            again = self._sampled_again(frame, picture, rough, light, colours)
            self._develop_means(picture.film, colours, again, rough.pixels, pixels)
        return pixels

    def _sampled_again(
        self,
        frame: Frame,
        picture: Picture,
        rough: Rough,
        light: Lighting,
        colours: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        """``(E * K, 3)`` colours of the ``K`` further rays through each of ``E`` rough pixels."""
        places, edges, angle = self._sampling.offsets, rough.pixels, _pixel_angle(picture)
        # The offset is in pixels: right along the second axis of the camera, down its third. Rows
        # that are exposed one by one are turned by a few degrees at most: a share of a pixel's.
        right = (picture.rotation[:, 1] * angle).astype(np.float32)
        down = (-picture.rotation[:, 2] * angle).astype(np.float32)
        offsets = places[:, :1] * right + places[:, 1:] * down
        size = (picture.width, picture.height)
        again = np.empty((len(edges) * len(places), 3), np.float32)
        packets, rays = extra_rays(rough, len(places)), np.empty_like(again)
        if self._epic:
            every = np.ones(len(rays), np.bool_)
            aim = picture.hits.directions, edges, offsets, every, rays
            self._caster.in_parts(aim_again, aim, len(edges), _EDGES)
        else:
            packets = mixed(
                self._caster, frame, self._materials.detail, picture.hits, size, colours,
                edges, places, packets, again, (picture.hits.directions, offsets, rays),
            )  # fmt: skip
        rows = None if picture.rows is None else picture.row_of(edges, len(places))
        hits = self._cast_again(frame, picture, rays, packets, rows)
        if not self._epic:
            packets = lent(
                self._caster, picture.hits, size, colours, edges, places, hits, packets, again
            )
        self._shade_picture(frame, picture, hits, packets, rows, light, again)
        return again

    def _cast_again(
        self,
        frame: Frame,
        picture: Picture,
        rays: NDArray[np.float32],
        packets: Packets,
        row_of: NDArray[np.integer] | None,
    ) -> Hits:
        low, high, skip_row = picture.low, picture.high, picture.skip_row
        origin = picture.hits.origin
        if picture.rows is not None and row_of is not None:
            hits = unwritten_hits(origin, rays)
            return self._caster.cast_rows(
                picture.rows, row_of, hits, packets, low=low, high=high, skip_row=skip_row
            )
        return self._caster.cast_together(
            frame.scene, origin, rays, packets, low=low, high=high, skip_row=skip_row
        )

    def _develop_means(
        self,
        film: Film,
        colours: NDArray[np.float32],
        again: NDArray[np.float32],
        edges: NDArray[np.int32],
        pixels: NDArray[np.uint8],
    ) -> None:
        data = film_codes(film.gamma), colours, again, edges, pixels.reshape(-1, 4)
        self._caster.in_parts(develop_means, data, len(edges), _EDGES)


def _pixel_angle(picture: Picture) -> float:
    """Radians between the rays of neighbouring pixels in the middle, about."""
    return float(2.0 * np.tan(np.radians(picture.fov_deg) / 2.0) / picture.width)


def _nothing_met() -> tuple[Hits, Packets]:
    """Two rays of a picture that met nothing."""
    rays = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]], np.float32)
    hits = unwritten_hits(np.zeros(3), rays)
    hits.t.fill(np.inf)
    hits.row.fill(NOTHING)
    hits.triangle.fill(-1)
    hits.weights.fill(0.0)
    return hits, picture_packets(2, 1)
