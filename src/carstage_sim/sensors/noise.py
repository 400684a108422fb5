"""Random numbers of sensors: a stream for each sensor and frame."""

from __future__ import annotations

import numpy as np

from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.world.state import WorldState


def noise_stream(seed: int, request: SensorRequest, state: WorldState) -> np.random.Generator:
    """A new stream for each frame: a frame does not depend on how many came before it.

    Args:
        seed: attribute ``noise_seed``; 0 gives every sensor its own.
        request: the sensor.
        state: the frame.
    """
    return np.random.default_rng([seed & 0xFFFFFFFF or request.sensor_id, state.frame])
