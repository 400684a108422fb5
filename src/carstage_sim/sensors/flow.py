"""The optical-flow camera: how far each surface point moved across the picture.

The value is CARLA's: current minus previous position in the picture, in units of half its width
and height, y upwards, within [-2, 2]. In pixels, with y downwards, the motion is
``(x * width / 2, -y * height / 2)``. Unlike CARLA's, which come from a 16-bit target, the values
are not quantised.
"""

from __future__ import annotations

import numpy as np

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.town import Town
from carstage_sim.render.gpu.passes import Product
from carstage_sim.sensors.cameras import CameraSensor
from carstage_sim.sensors.measurements import FlowFrame, SensorRequest
from carstage_sim.sensors.motions import Seen, SeenActors, flow_of, motions_between, seen_actors
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState


@SensorRegistry.register("sensor.camera.optical_flow")
class OpticalFlowCamera(CameraSensor):
    """Motion since this camera's last picture; 0 in its first.

    Vehicles and props move as a whole, wheels near a sensor by themselves; of walkers, each point
    of the surface moves as it does. An actor that was not there before has not moved. The sky is
    infinitely far away.
    """

    may_be_late = True

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self._camera: Seen | None = None
        self._actors: SeenActors = {}

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> FlowFrame:
        """The motion of each pixel's surface point."""
        camera = Seen(
            rotation_matrix(request.rotation_deg), np.array(request.location, np.float64), None
        )
        actors = seen_actors(state, view.frame)
        motions = motions_between(camera, self._camera or camera, actors, self._actors, view.frame)
        self._camera, self._actors = camera, actors
        if not self.lens.distorts:
            made = view.on_card(self.camera(request), Product.FLOW, motions=motions)
            if made is not None:
                flow = made.view(np.float32).reshape(self.height, self.width, 2)
                return FlowFrame(self.fov_deg, flow)
        return FlowFrame(self.fov_deg, flow_of(self.camera(request), motions, view))
