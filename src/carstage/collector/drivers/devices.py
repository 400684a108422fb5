"""Drivers ``keyboard``, ``gamepad`` and ``wheel``: a person at a window with a camera's view."""

from __future__ import annotations

import math
import sys
from typing import Any

from carstage.collector.drivers.base import Driver, Observation
from carstage.collector.drivers.inputs import Inputs, inputs_of
from carstage.collector.drivers.replay import control_of
from carstage.collector.internals.errors import DriverError
from carstage.spec import DeviceDriverSpec

try:
    import pygame
except ImportError as error:
    raise DriverError(
        "ego.driver: the collector's Python, %s, has no pygame: %s." % (sys.executable, error),
        "Install it there: pip install pygame, or carstage's extra `drive`.",
    ) from error

_KMH_PER_M_S = 3.6


class DeviceDriver(Driver):
    """A person drives, in real time.

    Args:
        inputs: what the person has pressed.
        camera: sensor whose pictures are shown.
        step_s: simulated seconds of a step.
        needs_stick: whether the device is one of SDL's joysticks.
    """

    def __init__(self, inputs: Inputs, camera: str, step_s: float, *, needs_stick: bool) -> None:
        self.sensors = (camera,)
        self._camera = camera
        self._inputs = inputs
        self._step_s = step_s
        self._needs_stick = needs_stick
        self._sticks: Any = []
        self._window: Any = None
        self._clock: Any = None

    def start(self, observation: Observation) -> None:
        """Open the window.

        Raises:
            DriverError: no such device is connected.
        """
        pygame.display.init()
        pygame.joystick.init()
        self._sticks = [pygame.joystick.Joystick(i) for i in range(pygame.joystick.get_count())]
        if self._needs_stick and not self._sticks:
            raise DriverError(
                "ego.driver: no gamepad or steering wheel is connected.",
                "Connect one, or drive by keyboard.",
            )
        self._clock = pygame.time.Clock()

    def drive(self, observation: Observation) -> Any:
        """Show what the camera sees, and command what is pressed.

        Raises:
            DriverError: the person has closed the window.
        """
        self._show(observation)
        self._clock.tick(1.0 / self._step_s)
        for event in pygame.event.get():
            escaped = event.type == pygame.KEYUP and event.key == pygame.K_ESCAPE
            if escaped or event.type == pygame.QUIT:
                raise DriverError(
                    "ego.driver: the window was closed ahead of step %d, before the end of the "
                    "episode." % observation.tick,
                    "Drive until it closes by itself, or set a shorter duration_s.",
                )
            take_event(self._inputs, event)
        gear = observation.ego.get_control().gear
        return control_of(self._inputs.command(self._step_s, gear))

    def stop(self) -> None:
        """Close the window."""
        pygame.quit()

    def _show(self, observation: Observation) -> None:
        image = observation.data.get(self._camera)
        if image is None:
            return
        size = (image.width, image.height)
        if self._window is None:
            self._window = pygame.display.set_mode(size)
        picture = pygame.image.frombuffer(bytes(image.raw_data), size, "BGRA")
        self._window.blit(picture, (0, 0))
        pygame.display.flip()
        speed_m_s = math.hypot(observation.velocity.x, observation.velocity.y)
        pygame.display.set_caption(
            "%s: %.0f km/h of %.0f%s"
            % (
                self._camera,
                _KMH_PER_M_S * speed_m_s,
                observation.speed_limit_kmh,
                ", backwards" if self._inputs.reverse else "",
            )
        )


def device_driver(spec: DeviceDriverSpec, step_s: float) -> DeviceDriver:
    """The driver at a device.

    Args:
        spec: which one.
        step_s: simulated seconds of a step.
    """
    inputs = inputs_of(spec.kind, spec.inputs)
    return DeviceDriver(inputs, spec.camera, step_s, needs_stick=spec.kind != "keyboard")


def take_event(inputs: Inputs, event: Any) -> None:
    """Have a ``pygame`` event of a device noted; others change nothing."""
    if event.type in (pygame.KEYDOWN, pygame.KEYUP):
        inputs.key(pygame.key.name(event.key), event.type == pygame.KEYDOWN)
    elif event.type == pygame.JOYAXISMOTION:
        inputs.axis(event.axis, event.value)
    elif event.type in (pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP):
        inputs.button(event.button, event.type == pygame.JOYBUTTONDOWN)
