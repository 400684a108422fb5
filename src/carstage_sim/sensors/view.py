"""One tick seen by rays: the frame's scene, and casts that several sensors share."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.render.cast import NOTHING, STATIC, Scene
from carstage_sim.render.caster import (
    BAND,
    Hits,
    RayCaster,
    Slopes,
    picture_packets,
    unwritten_hits,
)
from carstage_sim.render.crew import Shared
from carstage_sim.render.film import Film
from carstage_sim.render.gpu.camera import GpuCameras, Pending, Shot
from carstage_sim.render.gpu.passes import Product
from carstage_sim.render.motion import Motions
from carstage_sim.render.normals import smooth_normals
from carstage_sim.render.overlay import draw_shapes
from carstage_sim.render.picture import Picture, PictureMaker
from carstage_sim.render.pixel_kernels import (
    FAR_M,
    hit_ids,
    hit_tags,
    in_one,
    ray_directions,
)
from carstage_sim.render.rolling import Drift, RollingShutter, Rows
from carstage_sim.render.scene import Frame
from carstage_sim.render.sky import Lighting
from carstage_sim.sensors.lens import PINHOLE, Lens, pixel_places
from carstage_sim.sensors.side_by_side import Once
from carstage_sim.world.debug_shapes import DebugShapes
from carstage_sim.world.state import Weather

NEAR_M = 0.1
"""Nearest distance along the optical axis that a camera sees (CARLA's near plane)."""

_USUAL_FILM = Film()


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera in the world; equal cameras share one cast.

    Attributes:
        width, height: pixels.
        fov_deg: horizontal field of view.
        location: world metres.
        rotation_deg: pitch, yaw, roll.
        owner_id: actor that carries it, 0 for none.
        lens: what bends its rays.
        shutter: how its rows are exposed one after the other; None: all at once.
    """

    width: int
    height: int
    fov_deg: float
    location: tuple[float, float, float]
    rotation_deg: tuple[float, float, float]
    owner_id: int
    lens: Lens = PINHOLE
    shutter: RollingShutter | None = None


@lru_cache(maxsize=16)
def _pixel_slopes(
    width: int, height: int, fov_deg: float, lens: Lens
) -> tuple[NDArray[np.float64], ...]:
    """Right and up slopes of the rays through the pixel centres, flat, row by row."""
    if lens.distorts:
        across, down = pixel_places(width, height, lens)
        reach = math.tan(math.radians(fov_deg) / 2.0)
        return across * reach, down * (-reach * height / width)
    focal = width / (2.0 * math.tan(math.radians(fov_deg) / 2.0))
    right = (np.arange(width) + 0.5 - width / 2.0) / focal
    up = -(np.arange(height) + 0.5 - height / 2.0) / focal
    return np.tile(right, height), np.repeat(up, width)


@lru_cache(maxsize=16)
def _slope_pairs(width: int, height: int, fov_deg: float, lens: Lens) -> NDArray[np.float64]:
    """``(H * W, 2)`` slopes of the rays through the pixel centres."""
    return np.stack(_pixel_slopes(width, height, fov_deg, lens), axis=1)


def camera_slopes(camera: Camera) -> Slopes:
    """Slopes of the rays through the pixel centres, row by row."""
    right, up = _pixel_slopes(camera.width, camera.height, camera.fov_deg, camera.lens)
    return Slopes(np.ascontiguousarray(rotation_matrix(camera.rotation_deg)), right, up)


def pixel_rays(camera: Camera) -> NDArray[np.float32]:
    """``(H * W, 3)`` float32 world directions through the pixel centres, row by row.

    Their component along the optical axis is 1, so a ray's parameter is the depth.
    """
    slopes = camera_slopes(camera)
    rays = np.empty((len(slopes.right), 3), np.float32)
    in_one(ray_directions, (*slopes, rays), len(rays))
    return rays


def row_rays(camera: Camera, rows: Rows) -> NDArray[np.float32]:
    """As :func:`pixel_rays`, where each row has a pose of its own."""
    right, up = _pixel_slopes(camera.width, camera.height, camera.fov_deg, camera.lens)
    rays = np.empty((len(right), 3), np.float32)
    for row, rotation in enumerate(rows.rotations):
        of_row = slice(row * camera.width, (row + 1) * camera.width)
        in_one(ray_directions, (rotation, right[of_row], up[of_row], rays[of_row]), camera.width)
    return rays


def turned(
    local: NDArray[np.float64], rotation_deg: tuple[float, float, float]
) -> NDArray[np.float32]:
    """``(N, 3)`` float32 world directions of ``(N, 3)`` directions in a sensor's frame."""
    rotation = rotation_matrix(rotation_deg)
    world = np.empty((len(local), 3), np.float32)
    # Sums written out: a matrix product may add in another order on another machine.
    for axis in range(3):
        world[:, axis] = (
            local[:, 0] * rotation[axis, 0]
            + local[:, 1] * rotation[axis, 1]
            + local[:, 2] * rotation[axis, 2]
        )
    return world


_Pictures = list[dict[Product, NDArray[np.uint8]]]
"""Of each camera."""


def _received(pending: Pending, size: tuple[int, int]) -> _Pictures:
    """Pictures of cameras, ``(H, W, 4)`` or ``(H, W, 8)``, when the card has made them."""
    return [
        {product: data.reshape(*size, -1) for product, data in of_one.items()}
        for of_one in pending.pictures()
    ]


class View:
    """What can be seen in one tick.

    Several threads may ask at once.

    Args:
        make_frame: gives the scene; called when the first sensor looks at it.
        caster: runs the rays.
        pictures: makes colour pictures.
        weather: the tick's weather.
        time_s: simulated time.
        shapes: debug shapes that pictures show, None for none.
        cameras: makes pictures on a card, None for none.
        drift_of: how the instances of a frame move; None: not at all.
    """

    def __init__(
        self,
        make_frame: Callable[[], Frame],
        caster: RayCaster,
        pictures: PictureMaker,
        weather: Weather,
        time_s: float,
        shapes: DebugShapes | None = None,
        cameras: GpuCameras | None = None,
        drift_of: Callable[[Frame], Drift] | None = None,
    ) -> None:
        self._frame = Once(make_frame)
        self._drift_of = drift_of
        self._caster = caster
        self._pictures = pictures
        self._weather = weather
        self._time_s = time_s
        self._shapes = shapes
        self._lock = threading.Lock()
        self._casts: dict[Camera, Once[Hits]] = {}
        self._rows: dict[Camera, Once[Rows]] = {}
        self._colours: dict[tuple[Camera, Film], Once[NDArray[np.uint8]]] = {}
        self._cameras = cameras
        self._card_lock = threading.Lock()
        self._expected: dict[tuple[Camera, Film], set[Product]] = {}
        self._taken: dict[tuple[Camera, Film, Product], tuple[Once[_Pictures], int]] = {}
        self.cast_count = 0

    @property
    def threads(self) -> int:
        """How many compute."""
        return self._caster.threads

    def in_parts(self, shared: Shared, data: tuple[Any, ...], count: int, size: int = BAND) -> None:
        """Have a kernel cover a number of pixels, in several threads, so many at a time."""
        self._caster.in_parts(shared, data, count, size)

    @property
    def caster(self) -> RayCaster:
        """What runs kernels of this tick."""
        return self._caster

    @property
    def frame(self) -> Frame:
        """The scene of this tick."""
        return self._frame()

    @property
    def lighting(self) -> Lighting:
        """Sun, sky and weather of this tick, before a film exposes for them."""
        return self._pictures.sky.lighting(self._weather, self._time_s)

    def _count_cast(self, casts: int = 1) -> None:
        with self._lock:
            self.cast_count += casts

    def skipped_row(self, owner_id: int, location: tuple[float, float, float]) -> int:
        """Instance row of the carrier when the sensor is inside its box, else -1."""
        if not owner_id:
            return -1
        return self.frame.row_around(owner_id, np.asarray(location))

    def rays(
        self,
        location: tuple[float, float, float],
        directions: NDArray[np.float32],
        *,
        high: float,
        owner_id: int,
    ) -> Hits:
        """Nearest hits of rays from a point, up to ``high`` times a direction's length."""
        self._count_cast()
        return self._caster.cast(
            self.frame.scene,
            np.asarray(location),
            directions,
            low=1e-3,
            high=high,
            skip_row=self.skipped_row(owner_id, location),
        )

    def bundle(
        self,
        origins: NDArray[np.float64],
        directions: NDArray[np.float64],
        *,
        high_m: float,
        skip_row: int = -1,
        scene: Scene | None = None,
    ) -> Hits:
        """Nearest hits of rays from several points.

        Args:
            origins: ``(N, 3)`` where they start, world metres.
            directions: ``(N, 3)`` unit vectors, world.
            high_m: how far they reach.
            skip_row: instance row that they pass through, -1 for none.
            scene: the scene of another instant; None: of this tick.
        """
        self._count_cast()
        return self._caster.cast(
            self.frame.scene if scene is None else scene,
            origins,
            directions.astype(np.float32),
            low=0.0,
            high=high_m,
            skip_row=skip_row,
        )

    def are_obstructed(
        self,
        starts: NDArray[np.float64],
        end: NDArray[np.float64],
        through: frozenset[int],
    ) -> NDArray[np.bool_]:
        """Whether anything stands between places and another one.

        Args:
            starts: ``(N, 3)`` world metres.
            end: ``(3,)`` world metres.
            through: ids of the actors that count for nothing.

        Returns:
            ``(N,)``.
        """
        self._count_cast()
        along = end - starts
        length = np.sqrt((along**2).sum(axis=1))
        hits = self._caster.cast(
            self.frame.without(through).scene,
            starts,
            (along / np.maximum(length, NEAR_M)[:, None]).astype(np.float32),
            low=0.0,
            high=float(length.max()),
        )
        return np.asarray((hits.row != NOTHING) & (hits.t < length))

    def camera(self, camera: Camera) -> Hits:
        """Hits of a camera's pixels, row by row; cast once per tick and camera."""
        with self._lock:
            hits = self._casts.setdefault(camera, Once(partial(self._cast, camera)))
        return hits()

    def _rows_of(self, camera: Camera) -> Rows | None:
        """What a camera's rows see if they are exposed one after the other, made once per tick."""
        if camera.shutter is None:
            return None
        with self._lock:
            rows = self._rows.setdefault(
                camera, Once(partial(self._make_rows, camera, camera.shutter))
            )
        return rows()

    def _make_rows(self, camera: Camera, shutter: RollingShutter) -> Rows:
        frame = self.frame
        still = np.zeros((len(frame.actor_id), 3))
        drift = Drift(still, still) if self._drift_of is None else self._drift_of(frame)
        place, rotation = np.asarray(camera.location), rotation_matrix(camera.rotation_deg)
        return Rows(frame, drift, shutter, camera.height, place, rotation)

    def _cast(self, camera: Camera) -> Hits:
        self._count_cast()
        rows = self._rows_of(camera)
        if rows is not None:
            return self._caster.cast_rows(
                rows,
                np.repeat(np.arange(camera.height), camera.width),
                unwritten_hits(np.asarray(camera.location), row_rays(camera, rows)),
                picture_packets(camera.width, camera.height),
                low=NEAR_M,
                high=FAR_M,
                skip_row=self.skipped_row(camera.owner_id, camera.location),
            )
        slopes = camera_slopes(camera)
        return self._caster.cast_together(
            self.frame.scene,
            np.asarray(camera.location),
            np.empty((len(slopes.right), 3), np.float32),
            picture_packets(camera.width, camera.height),
            low=NEAR_M,
            high=FAR_M,
            skip_row=self.skipped_row(camera.owner_id, camera.location),
            slopes=slopes,
        )

    def automatic_exposure(self, weather: Weather) -> float:
        """From radiance to the film, as the light of a weather asks for."""
        return self._pictures.sky.exposure(weather)

    def announce(self, camera: Camera, product: Product, film: Film = _USUAL_FILM) -> None:
        """Say that a picture will be asked for, so that a card makes it together with others."""
        if self._cameras is not None and not self._is_for_cpu(camera, product):
            self._expected.setdefault((camera, film), set()).add(product)

    def take_announced(self) -> None:
        """Let a card begin the pictures that were announced."""
        if self._cameras is not None and self._expected:
            with self._card_lock:
                self._take_expected(self._cameras)

    def on_card(
        self,
        camera: Camera,
        product: Product,
        film: Film = _USUAL_FILM,
        motions: Motions | None = None,
    ) -> NDArray[np.uint8] | None:
        """A picture's bytes, ``(H, W, 4)``, of flow ``(H, W, 8)``; None where the CPU makes it.

        Args:
            camera: who looks.
            product: what the picture shows.
            film: of colours.
            motions: since the camera's last picture, for flow.
        """
        if self._cameras is None or self._is_for_cpu(camera, product):
            return None
        key = (camera, film, product)
        with self._card_lock:
            if motions is not None:
                # Not for others of this pose: their last pictures may be of other ticks.
                pictures = self._take(self._cameras, [camera], film, {product}, motions)
                number = 0
            else:
                if key not in self._taken:
                    self._expected.setdefault((camera, film), set()).add(product)
                    self._take_expected(self._cameras)
                pictures, number = self._taken[key]
        return pictures()[number][product]

    def _is_for_cpu(self, camera: Camera, product: Product) -> bool:
        """Whether the CPU makes a picture: with debug shapes, or row by row."""
        drawn_on = self._shapes is not None and product is Product.COLOURS
        return drawn_on or camera.shutter is not None

    @property
    def has_card(self) -> bool:
        """Whether a card makes pictures."""
        return self._cameras is not None

    def _take_expected(self, cameras: GpuCameras) -> None:
        # When all pictures of earlier ticks have come, the first is sent while the card makes the
        # next; if it is behind, it makes all in less time together.
        in_turn = not cameras.busy
        alike: dict[Any, list[Camera]] = {}
        for (camera, film), products in self._expected.items():
            lens = camera.width, camera.height, camera.fov_deg, camera.lens
            alike.setdefault((lens, film, frozenset(products)), []).append(camera)
        self._expected.clear()
        for (_, film, products), of_all in alike.items():
            pixels = of_all[0].width * of_all[0].height
            at_once = 1 if in_turn else cameras.most_together(pixels)
            for first in range(0, len(of_all), at_once):
                together = of_all[first : first + at_once]
                pictures = self._take(cameras, together, film, products)
                self._taken |= {
                    (camera, film, product): (pictures, number)
                    for number, camera in enumerate(together)
                    for product in products
                }

    def _take(
        self,
        cameras: GpuCameras,
        of_one_lens: Sequence[Camera],
        film: Film,
        products: Collection[Product],
        motions: Motions | None = None,
    ) -> Once[_Pictures]:
        self._count_cast(len(of_one_lens))
        shots = [self._shot(camera) for camera in of_one_lens]
        pending = cameras.take(
            self.frame, shots, products, self.lighting, film=film, motions=motions
        )
        return Once(partial(_received, pending, (of_one_lens[0].height, of_one_lens[0].width)))

    def _shot(self, camera: Camera) -> Shot:
        return Shot(
            camera.width,
            camera.height,
            camera.fov_deg,
            _slope_pairs(camera.width, camera.height, camera.fov_deg, camera.lens),
            np.asarray(camera.location),
            rotation_matrix(camera.rotation_deg),
            self.skipped_row(camera.owner_id, camera.location),
            NEAR_M,
            FAR_M,
        )

    def colours(self, camera: Camera, film: Film) -> NDArray[np.uint8]:
        """``(H, W, 3)`` uint8 sRGB picture, with debug shapes."""
        return self.with_shapes(camera, self.pixels(camera, film))[..., 2::-1]

    def pixels(self, camera: Camera, film: Film) -> NDArray[np.uint8]:
        """``(H, W, 4)`` BGRA picture, shaded once per tick, camera and film."""
        made = self.on_card(camera, Product.COLOURS, film)
        if made is not None:
            return made
        with self._lock:
            pixels = self._colours.setdefault(
                (camera, film), Once(partial(self._paint, camera, film))
            )
        return pixels()

    def with_shapes(self, camera: Camera, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """A camera's picture with the debug shapes over it; the same array where there are none."""
        shapes = self._shapes
        if shapes is None:
            return pixels
        rotation, hits = rotation_matrix(camera.rotation_deg), self.camera(camera)
        offset = shapes.segments - hits.origin.astype(np.float64)
        drawn = pixels.copy()
        draw_shapes(
            # Sums written out: a matrix product may add in another order on another machine.
            sum(offset[..., axis, None] * rotation[axis] for axis in range(3)),
            shapes.size,
            shapes.is_point,
            shapes.colour,
            focal_px=camera.width / (2.0 * np.tan(np.radians(camera.fov_deg) / 2.0)),
            near_m=NEAR_M,
            depth=hits.t.reshape(camera.height, camera.width),
            pixels=drawn[..., 2::-1],
        )
        return drawn

    def _paint(self, camera: Camera, film: Film) -> NDArray[np.uint8]:
        picture = Picture(
            width=camera.width,
            height=camera.height,
            fov_deg=camera.fov_deg,
            rotation=rotation_matrix(camera.rotation_deg),
            hits=self.camera(camera),
            skip_row=self.skipped_row(camera.owner_id, camera.location),
            low=NEAR_M,
            high=FAR_M,
            film=film,
            rows=self._rows_of(camera),
        )
        return self._pictures.pixels(self.frame, picture, self.lighting)

    def tags(self, hits: Hits) -> NDArray[np.uint8]:
        """``(N,)`` uint8 semantic tag of each ray; the sky's for rays that met nothing."""
        tags = np.empty(len(hits.row), np.uint8)
        of_town, of_actors = self.frame.static.tag, self.frame.actors.tag
        sky = int(CityObjectLabel.SKY)
        data = hits.row, hits.triangle, STATIC, of_town, of_actors, sky, tags
        self.in_parts(hit_tags, data, len(tags))
        return tags

    def instance_ids(self, hits: Hits) -> NDArray[np.uint16]:
        """``(N,)`` uint16 instance id of each ray.

        An actor's is the low half of its id (CARLA 0.9.16); a level object's is 0x8000 + its
        index; 0 stands for the sky and for ground that belongs to no object.
        """
        ids = np.empty(len(hits.row), np.uint16)
        objects, actor_id = self.frame.static.object_id, self.frame.actor_id
        data = hits.row, hits.triangle, STATIC, objects, actor_id, ids
        self.in_parts(hit_ids, data, len(ids))
        return ids

    def actor_ids(self, hits: Hits) -> NDArray[np.uint32]:
        """``(N,)`` uint32 id of the actor that each ray met, 0 for the town and for nothing."""
        ids = np.zeros(len(hits.row), np.uint32)
        actors = hits.row >= 0
        ids[actors] = self.frame.actor_id[hits.row[actors]]
        return ids

    def flat_normals(self, hits: Hits) -> NDArray[np.float32]:
        """``(N, 3)`` float32 unit normal (world) of the triangle that each ray met, else 0.

        Which of its two sides it points to is not said.
        """
        normals = np.zeros((len(hits.row), 3), np.float32)
        static, actors = hits.row == STATIC, hits.row >= 0
        normals[static] = self.frame.static.flat[hits.triangle[static]]
        normals[actors] = self._from_actors(
            self.frame.actors.flat[hits.triangle[actors]], hits.row[actors]
        )
        return normals

    def smooth_normals(self, hits: Hits) -> NDArray[np.float32]:
        """``(N, 3)`` float32 unit normal (world) of the surface that each ray met, else 0.

        See :func:`carstage_sim.render.normals.smooth_normals`. Those of turning actors are as they
        are at the frame's time.
        """
        return smooth_normals(self._caster, self.frame, hits)

    def _from_actors(
        self, normals: NDArray[np.float32], row: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        rotation = self.frame.scene.rotation[row]
        world = np.empty_like(normals)
        for axis in range(3):
            world[:, axis] = (rotation[:, axis] * normals).sum(axis=1)
        return world
