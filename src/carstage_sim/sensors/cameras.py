"""Cameras whose data are pictures in CARLA's pixel formats."""

from __future__ import annotations

import logging
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import Town
from carstage_sim.render.caster import Hits
from carstage_sim.render.film import Film
from carstage_sim.render.gpu.passes import Product
from carstage_sim.render.pixel_kernels import (
    InParts,
    bytes_of,
    depth_words,
    in_one,
    instance_words,
    normal_words,
)
from carstage_sim.render.rolling import RollingShutter
from carstage_sim.sensors.adaptation import Adaptation
from carstage_sim.sensors.attributes import number, require, whole, within
from carstage_sim.sensors.film_effects import FilmEffects
from carstage_sim.sensors.lens import Lens
from carstage_sim.sensors.measurements import ImageFrame, SensorRequest
from carstage_sim.sensors.sensor import MeasuringSensor, SensorRegistry
from carstage_sim.sensors.view import Camera, View
from carstage_sim.world.state import Weather, WorldState

LARGEST_SIDE_PX = 8192
MOST_PIXELS = 7680 * 4320
_MOST_STOPS = 30.0
_FILM_LIMITS = 0.01, 1e6
"""Of shutter speed, ISO and f-stop: far beyond those of cameras, and still to be computed with."""
_MOST_BOUND_EV = 100.0
_LEAST_BRIGHTEST_EV, _MOST_DARKEST_EV = -10.0, 30.0
"""What bounds all pictures to white, and to black."""
_LONGEST_SHUTTER_S = 0.1

_log = logging.getLogger(__name__)


def encode_depth(depth_m: NDArray[np.floating], in_parts: InParts = in_one) -> NDArray[np.uint8]:
    """``(..., 4)`` BGRA bytes of depths in metres: 24 bits over 1000 m, low byte in R.

    CARLA sensor reference, "Depth camera"; depths beyond 1000 m and NaN read as 1000 m.

    Args:
        depth_m: of any shape.
        in_parts: does the work, perhaps in several threads.
    """
    flat, words = np.ravel(depth_m), np.empty(depth_m.size, "<u4")
    in_parts(depth_words, (flat, words), len(flat))
    return bytes_of(words, depth_m.shape)


def encode_tags(tags: NDArray[np.uint8], in_parts: InParts = in_one) -> NDArray[np.uint8]:
    """``(..., 4)`` BGRA bytes of a semantic picture: the tag in R.

    Args:
        tags: of any shape.
        in_parts: does the work, perhaps in several threads.
    """
    return encode_instances(tags, np.zeros(tags.shape, np.uint16), in_parts)


def encode_instances(
    tags: NDArray[np.uint8], ids: NDArray[np.uint16], in_parts: InParts = in_one
) -> NDArray[np.uint8]:
    """``(..., 4)`` BGRA bytes of an instance picture: tag in R, id low byte in G, high in B.

    Args:
        tags: of any shape.
        ids: of the same shape.
        in_parts: does the work, perhaps in several threads.
    """
    flat, numbers, words = np.ravel(tags), np.ravel(ids), np.empty(tags.size, "<u4")
    in_parts(instance_words, (flat, numbers, words), len(flat))
    return bytes_of(words, tags.shape)


def encode_normals(normals: NDArray[np.floating], in_parts: InParts = in_one) -> NDArray[np.uint8]:
    """``(..., 4)`` BGRA bytes of ``(..., 3)`` world normals: x in R, y in G, z in B.

    Each component goes from [-1, 1] to [0, 255] (CARLA since 0.9.16, pull request 8810); so the
    zero of the sky reads 128.

    Args:
        normals: of any shape.
        in_parts: does the work, perhaps in several threads.
    """
    shape = normals.shape[:-1]
    flat = np.ascontiguousarray(normals, np.float32).reshape(-1, 3)
    words = np.empty(len(flat), "<u4")
    in_parts(normal_words, (flat, words), len(flat))
    return bytes_of(words, shape)


class CameraSensor(MeasuringSensor):
    """What all cameras share: size and field of view from the attributes."""

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self.width = whole(request.attributes, "image_size_x", 800)
        self.height = whole(request.attributes, "image_size_y", 600)
        self.fov_deg = number(request.attributes, "fov", 90.0)
        for name, side in (("image_size_x", self.width), ("image_size_y", self.height)):
            within(name, side, 1, LARGEST_SIDE_PX)
        pixels = self.width * self.height
        require(
            pixels <= MOST_PIXELS,
            f"image_size_x times image_size_y is {pixels}, above {MOST_PIXELS} (8K UHD)",
        )
        require(0.0 < self.fov_deg < 180.0, f"fov is {self.fov_deg}, not between 0 and 180 degrees")
        self.lens = Lens.of(request.attributes)

    @property
    def pixels(self) -> int:
        """Width times height."""
        return self.width * self.height

    def camera(self, request: SensorRequest) -> Camera:
        """The camera of this tick."""
        return Camera(
            self.width,
            self.height,
            self.fov_deg,
            request.location,
            request.rotation_deg,
            request.owner_id,
            self.lens,
        )

    def image(self, pixels: NDArray[np.uint8]) -> ImageFrame:
        """A frame from ``(H * W, 4)`` or ``(H, W, 4)`` BGRA pixels."""
        return ImageFrame(self.fov_deg, pixels.reshape(self.height, self.width, 4))


class RollingCamera(CameraSensor):
    """A camera whose rows may be exposed one after the other."""

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self.rolling_s = number(request.attributes, "rolling_shutter_s", 0.0)
        within("rolling_shutter_s", self.rolling_s, 0.0, _LONGEST_SHUTTER_S)
        self._said = False

    def exposing(self, state: WorldState, request: SensorRequest, view: View) -> Camera:
        """The camera of this tick, with what carries it on the move if rows take time."""
        camera = self.camera(request)
        if not self.rolling_s:
            return camera
        if view.has_card and not self._said:
            self._said = True
            _log.info("sensor %d has a rolling shutter: the CPU draws it", request.sensor_id)
        still = (0.0, 0.0, 0.0)
        shutter = RollingShutter(self.rolling_s, request.location, still, still)
        rows = np.flatnonzero(state.actor_id == request.owner_id)
        if request.owner_id and len(rows):
            motion = (state.location, state.velocity, np.radians(state.angular_velocity_deg))
            around, velocity, turn_rate = (tuple(values[rows[0]].tolist()) for values in motion)
            shutter = RollingShutter(self.rolling_s, around, velocity, turn_rate)
        return replace(camera, shutter=shutter)


def film_of(attributes: Mapping[str, str]) -> Film:
    """The film that a camera's exposure attributes describe.

    Raises:
        SensorAttributeError: a value is no number, or no picture can be exposed by it.
    """
    usual = Film()
    film = Film(
        manual=attributes.get("exposure_mode", "histogram") == "manual",
        compensation_ev=number(attributes, "exposure_compensation", usual.compensation_ev),
        darkest_ev=number(attributes, "exposure_min_bright", usual.darkest_ev),
        brightest_ev=number(attributes, "exposure_max_bright", usual.brightest_ev),
        shutter_per_s=number(attributes, "shutter_speed", usual.shutter_per_s),
        iso=number(attributes, "iso", usual.iso),
        f_stop=number(attributes, "fstop", usual.f_stop),
        gamma=number(attributes, "gamma", usual.gamma),
    )
    within("exposure_compensation", film.compensation_ev, -_MOST_STOPS, _MOST_STOPS)
    within("exposure_min_bright", film.darkest_ev, -_MOST_BOUND_EV, _MOST_DARKEST_EV)
    within("exposure_max_bright", film.brightest_ev, _LEAST_BRIGHTEST_EV, _MOST_BOUND_EV)
    for name, value in (
        ("shutter_speed", film.shutter_per_s),
        ("iso", film.iso),
        ("fstop", film.f_stop),
    ):
        within(name, value, *_FILM_LIMITS)
    require(film.gamma > 0, "gamma must be positive")
    return film


@SensorRegistry.register("sensor.camera.rgb")
class RgbCamera(RollingCamera):
    """A colour picture."""

    may_be_late = True
    beside_others = True
    many_steps = True

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self.film = film_of(request.attributes)
        self.effects = FilmEffects.of(request)
        self._adaptation = Adaptation.of(request.attributes)
        self._announced: dict[int, Film] = {}

    def observe(self, state: WorldState, request: SensorRequest) -> None:
        """Exposure follows the weather of steps that are not shown, too."""
        self._adaptation.note(state)

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> ImageFrame:
        """The picture, alpha 255, with the effects that were asked for; debug shapes over it."""
        film = self._announced.pop(state.frame, None) or self._film(state, view)
        camera = self.exposing(state, request, view)
        pixels = view.pixels(camera, film)
        seen = self.effects.on(pixels, film, camera, (state, request, view))
        return self.image(view.with_shapes(camera, seen))

    def announce(self, state: WorldState, request: SensorRequest, view: View) -> None:
        """Its colours will be asked for."""
        if not self.rolling_s:
            # A later tick is announced before this one is measured, and exposed in its order.
            film = self._announced[state.frame] = self._film(state, view)
            view.announce(self.camera(request), Product.COLOURS, film)

    def _film(self, state: WorldState, view: View) -> Film:
        """The film as it is exposed in a step."""
        if self.film.manual:
            return self.film

        def wanted(weather: Weather) -> float:
            return self.film.stops(view.automatic_exposure(weather))

        stops = self._adaptation.stops(state, wanted)
        if stops == wanted(state.weather):
            return self.film
        return replace(self.film, adapted_stops=stops)


class HitCamera(RollingCamera):
    """What the cameras share that show what pixels met, whatever the light."""

    beside_others = True
    product: ClassVar[Product]

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> ImageFrame:
        """The picture, made on the card if there is one."""
        camera = self.exposing(state, request, view)
        made = view.on_card(camera, self.product)
        return self.image(self.encoded(view, view.camera(camera)) if made is None else made)

    def announce(self, state: WorldState, request: SensorRequest, view: View) -> None:
        """Its picture will be asked for."""
        if not self.rolling_s:
            view.announce(self.camera(request), self.product)

    @abstractmethod
    def encoded(self, view: View, hits: Hits) -> NDArray[np.uint8]:
        """``(H * W, 4)`` pixels of what the rays met."""


@SensorRegistry.register("sensor.camera.depth")
class DepthCamera(HitCamera):
    """Distance along the optical axis, 1000 m where nothing is."""

    product = Product.DEPTH

    def encoded(self, view: View, hits: Hits) -> NDArray[np.uint8]:
        """The depth."""
        return encode_depth(hits.t, view.in_parts)


@SensorRegistry.register("sensor.camera.semantic_segmentation")
class SemanticCamera(HitCamera):
    """Semantic tag of each pixel."""

    product = Product.TAGS

    def encoded(self, view: View, hits: Hits) -> NDArray[np.uint8]:
        """The tags."""
        return encode_tags(view.tags(hits), view.in_parts)


@SensorRegistry.register("sensor.camera.instance_segmentation")
class InstanceCamera(HitCamera):
    """Semantic tag and instance id of each pixel."""

    product = Product.INSTANCES

    def encoded(self, view: View, hits: Hits) -> NDArray[np.uint8]:
        """Tags and ids."""
        return encode_instances(view.tags(hits), view.instance_ids(hits), view.in_parts)


@SensorRegistry.register("sensor.camera.normals")
class NormalsCamera(HitCamera):
    """Direction of the surface in each pixel, in the world; smooth where it is shaded smoothly."""

    product = Product.NORMALS

    def encoded(self, view: View, hits: Hits) -> NDArray[np.uint8]:
        """The normals."""
        return encode_normals(view.smooth_normals(hits), view.in_parts)
