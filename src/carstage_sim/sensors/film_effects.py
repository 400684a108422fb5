"""What lens and sensor of a colour camera do to a picture that was made, as attributes ask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.exposure_blur import blurred
from carstage_sim.render.film import Film
from carstage_sim.render.glare import with_glare
from carstage_sim.render.sensor_noise import draw_noise, noise_key, noise_table
from carstage_sim.sensors.attributes import flag, number, whole
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.sensors.motions import flow_of, motions_in
from carstage_sim.sensors.view import Camera, View
from carstage_sim.world.state import WorldState

_USUAL_BLOOM, _USUAL_FLARE = 0.675, 0.1
"""CARLA's defaults."""
_MOST = 100.0


@dataclass(frozen=True, slots=True)
class FilmEffects:
    """Effects of one camera.

    Attributes:
        blur: whether what moves is blurred over the exposure time.
        bloom: CARLA's ``bloom_intensity``: how much light the lens scatters; 0 for none.
        flare: CARLA's ``lens_flare_intensity``: how much its faces mirror; 0 for none.
        noise: whether the sensor's noise is drawn.
        noise_seed: what it is drawn from, beside the frame.
    """

    blur: bool
    bloom: float
    flare: float
    noise: bool
    noise_seed: int

    @classmethod
    def of(cls, request: SensorRequest) -> FilmEffects:
        """Those that a camera's attributes ask for.

        Raises:
            SensorAttributeError: a value is none of its attribute.
        """
        given = request.attributes
        lens = flag(given, "enable_postprocess_effects", default=True)
        bloom = number(given, "bloom_intensity", _USUAL_BLOOM)
        flare = number(given, "lens_flare_intensity", _USUAL_FLARE)
        return cls(
            blur=flag(given, "shutter_blur", default=False),
            bloom=min(max(bloom, 0.0), _MOST) if lens else 0.0,
            flare=min(max(flare, 0.0), _MOST) if lens else 0.0,
            noise=flag(given, "sensor_noise", default=False),
            noise_seed=whole(given, "noise_seed", 0) or request.sensor_id,
        )

    def on(
        self,
        made: NDArray[np.uint8],
        film: Film,
        camera: Camera,
        instant: tuple[WorldState, SensorRequest, View],
    ) -> NDArray[np.uint8]:
        """A picture with the effects, made on the CPU whoever made the picture.

        Args:
            made: ``(H, W, 4)`` BGRA, which is left as it is.
            film: that shows it.
            camera: who looks.
            instant: the tick, what was asked of the camera, and what it sees.
        """
        state, request, view = instant
        pixels = made
        if self.blur or self.bloom > 0 or self.flare > 0 or self.noise:
            # What comes from a card may lie anywhere, or be for reading alone.
            pixels = np.require(made, requirements=("C", "A", "W"))
        if self.blur:
            motions = motions_in(1.0 / film.shutter_per_s, state, request, view.frame)
            flow, depth = flow_of(camera, motions, view), view.camera(camera).t
            pixels = blurred(view.caster, film, pixels, depth, flow)
        if self.bloom > 0 or self.flare > 0:
            pixels = with_glare(view.caster, film, pixels, self.bloom, self.flare)
        return self._noisy(pixels, film, state.frame, view) if self.noise else pixels

    def _noisy(
        self, clean: NDArray[np.uint8], film: Film, frame: int, view: View
    ) -> NDArray[np.uint8]:
        table = noise_table(film.sensitivity(view.lighting), film.gamma)
        key = np.uint32(noise_key(frame, self.noise_seed))
        noisy = np.empty_like(clean)
        pixels = clean.reshape(-1, 4), noisy.reshape(-1, 4)
        view.in_parts(draw_noise, (table, key, *pixels), len(pixels[0]))
        return noisy
