"""From events of keyboard, gamepad and steering wheel to commands; ``pygame`` brings the events."""

from __future__ import annotations

import math
from typing import Any, Mapping, Set

import pygame

from carstage.spec import Command

_FORWARD, _BACKWARD = 1, -1


class Inputs:
    """What a person has pressed so far.

    Attributes:
        reverse: whether the car is to go backwards.
        hand_brake: whether the hand brake is on.
    """

    def __init__(self) -> None:
        self.reverse = False
        self.hand_brake = False

    def take(self, event: Any) -> None:
        """Take note of a ``pygame`` event; others than the device's change nothing."""
        raise NotImplementedError

    def command(self, step_s: float, gear: int) -> Command:
        """What is commanded for the next step.

        Args:
            step_s: simulated seconds of a step.
            gear: that is in.
        """
        raise NotImplementedError


class Keyboard(Inputs):
    """The keys of CARLA's ``manual_control.py``, and its rates.

    W, S, A, D or the arrows: throttle, brake, left, right. Q: forwards or backwards. Space: hand
    brake. M: manual gear box, then comma and full stop: a gear down or up.
    """

    _THROTTLE = (pygame.K_w, pygame.K_UP)
    _BRAKE = (pygame.K_s, pygame.K_DOWN)
    _LEFT = (pygame.K_a, pygame.K_LEFT)
    _RIGHT = (pygame.K_d, pygame.K_RIGHT)
    _THROTTLE_STEP, _BRAKE_STEP = 0.1, 0.2
    _STEER_PER_S, _MOST_STEER = 0.5, 0.7

    def __init__(self) -> None:
        super().__init__()
        self._held: Set[int] = set()
        self._throttle = self._brake = self._steer = 0.0
        self._manual = self._wants_manual = False
        self._gear = _FORWARD
        self._shifts = 0

    def take(self, event: Any) -> None:
        """Take note of a key."""
        if event.type == pygame.KEYUP:
            self._held.discard(event.key)
        if event.type != pygame.KEYDOWN:
            return
        self._held.add(event.key)
        if event.key == pygame.K_q:
            self.reverse = not self.reverse
            self._gear = _BACKWARD if self.reverse else _FORWARD
        elif event.key == pygame.K_m:
            self._wants_manual = not self._wants_manual
        elif event.key in (pygame.K_COMMA, pygame.K_PERIOD) and self._wants_manual:
            self._shifts += 1 if event.key == pygame.K_PERIOD else -1

    def command(self, step_s: float, gear: int) -> Command:
        """Pedals go down step by step and up at once; so does the wheel."""
        self._throttle = self._pressed(self._THROTTLE, self._throttle + self._THROTTLE_STEP)
        self._brake = self._pressed(self._BRAKE, self._brake + self._BRAKE_STEP)
        turn = self._STEER_PER_S * step_s
        if self._is_held(self._LEFT):
            self._steer = self._steer - turn if self._steer <= 0.0 else 0.0
        elif self._is_held(self._RIGHT):
            self._steer = self._steer + turn if self._steer >= 0.0 else 0.0
        else:
            self._steer = 0.0
        self._steer = min(max(self._steer, -self._MOST_STEER), self._MOST_STEER)
        if self._wants_manual and not self._manual:
            self._gear = gear
        self._manual = self._wants_manual
        if self._shifts:
            self._gear = max(_BACKWARD, self._gear + self._shifts)
            self.reverse = self._gear < 0
            self._shifts = 0
        return Command(
            self._throttle,
            round(self._steer, 1),
            self._brake,
            int(self._is_held((pygame.K_SPACE,))),
            int(self.reverse),
            int(self._manual),
            self._gear,
        )

    def _is_held(self, keys: Any) -> bool:
        return not self._held.isdisjoint(keys)

    def _pressed(self, keys: Any, value: float) -> float:
        return min(value, 1.0) if self._is_held(keys) else 0.0


class Gamepad(Inputs):
    """A stick that steers, triggers for throttle and brake, a button for each of the rest.

    Args:
        numbers: of axes and buttons, by what they do.
    """

    _DEAD = 0.05
    """So little of a stick's way is none."""

    def __init__(self, numbers: Mapping[str, int]) -> None:
        super().__init__()
        self._numbers = numbers
        self._throttle = self._brake = self._steer = 0.0

    def take(self, event: Any) -> None:
        """Take note of an axis or a button."""
        numbers = self._numbers
        if event.type == pygame.JOYAXISMOTION:
            if event.axis == numbers["steer_axis"]:
                self._steer = self.steered(event.value)
            elif event.axis == numbers["throttle_axis"]:
                self._throttle = self.pressed(event.value)
            elif event.axis == numbers["brake_axis"]:
                self._brake = self.pressed(event.value)
        elif event.type in (pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP):
            pressed = event.type == pygame.JOYBUTTONDOWN
            if event.button == numbers["hand_brake_button"]:
                self.hand_brake = pressed
            elif event.button == numbers["reverse_button"] and pressed:
                self.reverse = not self.reverse

    def command(self, step_s: float, gear: int) -> Command:
        """As stick, pedals and buttons stand."""
        del step_s, gear
        return Command(
            self._throttle,
            self._steer,
            self._brake,
            int(self.hand_brake),
            int(self.reverse),
            0,
            _BACKWARD if self.reverse else _FORWARD,
        )

    def steered(self, value: float) -> float:
        """The steering of a stick's position, both from -1 to 1."""
        return 0.0 if abs(value) < self._DEAD else min(max(value, -1.0), 1.0)

    def pressed(self, value: float) -> float:
        """The pedal, from 0 to 1, of a trigger's position, from -1 (let go) to 1."""
        return min(max(0.5 * (value + 1.0), 0.0), 1.0)


class Wheel(Gamepad):
    """A steering wheel with pedals; the curves are those of CARLA's manual_control_steeringwheel.

    Its pedals go from 1 (let go) to -1.
    """

    def steered(self, value: float) -> float:
        """The steering of the wheel's position, both from -1 to 1."""
        return min(max(math.tan(1.1 * value), -1.0), 1.0)

    def pressed(self, value: float) -> float:
        """The pedal, from 0 to 1, of its position."""
        pressed = 1.6 + (2.05 * math.log10(-0.7 * value + 1.4) - 1.2) / 0.92
        return min(max(pressed, 0.0), 1.0)
