"""What stands in for the buffers of Unreal Engine's deferred renderer, by CARLA's number.

A client may listen to them on any camera (``listen_to_gbuffer``). Rays are traced here, so there
are no such buffers: those that another camera shows are its pictures, the others are black, as
CARLA sends what a scene lacks.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from carstage_sim.sensors.cameras import CameraSensor
from carstage_sim.sensors.measurements import ImageFrame, SensorRequest
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState

SENT_AS = "gbuffer.uint8"
"""The message that clients read such a buffer from."""
BLACK = "gbuffer.black"

GBUFFERS: Mapping[int, str] = MappingProxyType(
    {
        0: "sensor.camera.rgb",  # SceneColor
        1: "sensor.camera.depth",  # SceneDepth
        2: BLACK,  # SceneStencil
        3: "sensor.camera.normals",  # GBufferA: world normals
        **dict.fromkeys(range(4, 12), BLACK),  # GBufferB to GBufferF, Velocity, SSAO, CustomDepth
        12: "sensor.camera.semantic_segmentation",  # CustomStencil, where CARLA keeps its tags
    }
)
"""What measures each buffer, by ``carla.GBufferTextureID``."""


@SensorRegistry.register(BLACK)
class BlackCamera(CameraSensor):
    """A picture of nothing."""

    looks = False

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> ImageFrame:
        """Black, opaque."""
        pixels = np.zeros((self.height, self.width, 4), np.uint8)
        pixels[..., 3] = 255
        return self.image(pixels)
