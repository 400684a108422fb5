"""From keys, axes and buttons to commands; a window or the page brings them."""

from __future__ import annotations

import math
from typing import Mapping, Sequence, Set

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

    def key(self, name: str, down: bool) -> None:
        """Take note of a key that goes down or up, by SDL's name; by default nothing."""

    def axis(self, number: int, value: float) -> None:
        """Take note of an axis' position, from -1 to 1; by default nothing."""

    def button(self, number: int, down: bool) -> None:
        """Take note of a button that goes down or up; by default nothing."""

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

    _THROTTLE = ("w", "up")
    _BRAKE = ("s", "down")
    _LEFT = ("a", "left")
    _RIGHT = ("d", "right")
    _THROTTLE_STEP, _BRAKE_STEP = 0.1, 0.2
    _STEER_PER_S, _MOST_STEER = 0.5, 0.7

    def __init__(self) -> None:
        super().__init__()
        self._held: Set[str] = set()
        self._throttle = self._brake = self._steer = 0.0
        self._manual = self._wants_manual = False
        self._gear = _FORWARD
        self._shifts = 0

    def key(self, name: str, down: bool) -> None:
        """Take note of a key."""
        if not down:
            self._held.discard(name)
            return
        self._held.add(name)
        if name == "q":
            self.reverse = not self.reverse
            self._gear = _BACKWARD if self.reverse else _FORWARD
        elif name == "m":
            self._wants_manual = not self._wants_manual
        elif name in (",", ".") and self._wants_manual:
            self._shifts += 1 if name == "." else -1

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
            int(self._is_held(("space",))),
            int(self.reverse),
            int(self._manual),
            self._gear,
        )

    def _is_held(self, keys: Sequence[str]) -> bool:
        return not self._held.isdisjoint(keys)

    def _pressed(self, keys: Sequence[str], value: float) -> float:
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

    def axis(self, number: int, value: float) -> None:
        """Take note of an axis."""
        numbers = self._numbers
        if number == numbers["steer_axis"]:
            self._steer = self.steered(value)
        elif number == numbers["throttle_axis"]:
            self._throttle = self.pressed(value)
        elif number == numbers["brake_axis"]:
            self._brake = self.pressed(value)

    def button(self, number: int, down: bool) -> None:
        """Take note of a button."""
        if number == self._numbers["hand_brake_button"]:
            self.hand_brake = down
        elif number == self._numbers["reverse_button"] and down:
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


def inputs_of(kind: str, numbers: Mapping[str, int]) -> Inputs:
    """What a person presses at a device.

    Args:
        kind: ``keyboard``, ``gamepad`` or ``wheel``.
        numbers: of its axes and buttons, by what they do.
    """
    if kind == "keyboard":
        return Keyboard()
    return Wheel(numbers) if kind == "wheel" else Gamepad(numbers)
