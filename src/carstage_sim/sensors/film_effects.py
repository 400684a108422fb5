"""What lens and sensor of a colour camera do to a picture that was made, as attributes ask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.film import Film
from carstage_sim.render.sensor_noise import draw_noise, noise_key, noise_table
from carstage_sim.sensors.attributes import flag, whole
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.sensors.view import View


@dataclass(frozen=True, slots=True)
class FilmEffects:
    """Effects of one camera.

    Attributes:
        noise: whether the sensor's noise is drawn.
        noise_seed: what it is drawn from, beside the frame.
    """

    noise: bool
    noise_seed: int

    @classmethod
    def of(cls, request: SensorRequest) -> FilmEffects:
        """Those that a camera's attributes ask for.

        Raises:
            SensorAttributeError: a value is none of its attribute.
        """
        return cls(
            noise=flag(request.attributes, "sensor_noise", default=False),
            noise_seed=whole(request.attributes, "noise_seed", 0) or request.sensor_id,
        )

    def on(self, clean: NDArray[np.uint8], film: Film, frame: int, view: View) -> NDArray[np.uint8]:
        """A picture with the effects, made on the CPU whoever made the picture.

        Args:
            clean: ``(H, W, 4)`` BGRA, which is left as it is.
            film: that shows it.
            frame: its number.
            view: of the tick.
        """
        return self._noisy(clean, film, frame, view) if self.noise else clean

    def _noisy(
        self, clean: NDArray[np.uint8], film: Film, frame: int, view: View
    ) -> NDArray[np.uint8]:
        table = noise_table(film.sensitivity(view.lighting), film.gamma)
        key = np.uint32(noise_key(frame, self.noise_seed))
        noisy = np.empty_like(clean)
        pixels = clean.reshape(-1, 4), noisy.reshape(-1, 4)
        view.in_parts(draw_noise, (table, key, *pixels), len(pixels[0]))
        return noisy
