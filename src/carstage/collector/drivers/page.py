"""Drivers ``keyboard``, ``gamepad`` and ``wheel`` from the page: a person at a browser.

The page's server writes the newest state of the device into a file of the run, whole each time.
"""

from __future__ import annotations

import json
import math
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

from carstage.collector.drivers.base import Driver, Observation
from carstage.collector.drivers.inputs import Inputs, inputs_of
from carstage.collector.drivers.replay import control_of
from carstage.collector.internals.errors import DriverError
from carstage.spec import DeviceDriverSpec

GONE_S = 0.5
"""A page that sends nothing for so long is gone: the car brakes."""
PATIENCE_S = 120.0
"""So long is waited for the page at the begin."""
LARGEST_BYTES = 16384
_BUTTON = "button"


class DeviceState(NamedTuple):
    """What a page has told of a device.

    Attributes:
        sender: which page.
        sequence: number of the state, of that page.
        held: names of keys and buttons that are down.
        presses: how often each went down so far.
        axes: positions, from -1 to 1.
    """

    sender: str
    sequence: int
    held: Tuple[str, ...]
    presses: Dict[str, int]
    axes: Tuple[float, ...]


def read_state(path: str) -> Optional[DeviceState]:
    """The newest state; None: there is none, or it is of another version."""
    try:
        with open(path, "rb") as file:
            found = json.loads(file.read(LARGEST_BYTES))
        return DeviceState(
            str(found["sender"]),
            int(found["sequence"]),
            tuple(str(name) for name in found["held"]),
            {str(name): int(count) for name, count in found["presses"].items()},
            tuple(min(max(float(value), -1.0), 1.0) for value in found["axes"]),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


class PageDevice:
    """The device at the page: what changes there goes into its inputs.

    Args:
        path: of the file that the page's server writes.
        inputs: what the person has pressed.
        clock: wall time in s.
    """

    def __init__(
        self, path: str, inputs: Inputs, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._path = path
        self._inputs = inputs
        self._clock = clock
        self._state = read_state(path)  # of an earlier drive: it must change
        self._used: Optional[DeviceState] = None
        self._changed_s = -math.inf

    @property
    def is_there(self) -> bool:
        """Whether the page has sent something lately."""
        return self._clock() - self._changed_s < GONE_S

    def look(self) -> None:
        """Take in what is new."""
        state = read_state(self._path)
        if state is None or state == self._state:
            return
        self._state = state
        self._changed_s = self._clock()
        before = self._used
        if before is None or before.sender != state.sender:
            for name in () if before is None else before.held:
                self._press(name, False)
            presses = {name: count - (name in state.held) for name, count in state.presses.items()}
            # As with SDL, an axis counts once it has moved.
            before = state._replace(held=(), presses=presses)
        self._take(before, state)
        self._used = state

    def _take(self, before: DeviceState, now: DeviceState) -> None:
        held: List[str] = list(before.held)
        for name, count in now.presses.items():
            for _ in range(min(max(count - before.presses.get(name, 0), 0), 100)):
                if name in held:
                    self._press(name, False)
                self._press(name, True)
                held.append(name)
        for name in dict.fromkeys(held):
            if name not in now.held:
                self._press(name, False)
        for number, value in enumerate(now.axes):
            if number >= len(before.axes) or before.axes[number] != value:
                self._inputs.axis(number, value)

    def _press(self, name: str, down: bool) -> None:
        if name.startswith(_BUTTON):
            self._inputs.button(int(name[len(_BUTTON) :]), down)
        else:
            self._inputs.key(name, down)


class PageDriver(Driver):
    """A person at the page drives, in real time; while the page is gone, the car brakes.

    Args:
        device: the person's.
        inputs: what it has told.
        step_s: simulated seconds of a step.
        pause: waits so many seconds; raises when somebody asks to end.
        clock: wall time in s.
    """

    def __init__(
        self,
        device: PageDevice,
        inputs: Inputs,
        step_s: float,
        pause: Callable[[float], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._device = device
        self._inputs = inputs
        self._step_s = step_s
        self._pause = pause
        self._clock = clock
        self._next_s = 0.0
        self._steer = 0.0

    def start(self, observation: Observation) -> None:
        """Wait for the page.

        Raises:
            DriverError: nobody drives there.
        """
        deadline_s = self._clock() + PATIENCE_S
        self._device.look()
        while not self._device.is_there:
            if self._clock() > deadline_s:
                raise DriverError(
                    "ego.driver: nobody has begun to drive at the page within %g s." % PATIENCE_S,
                    "Open the run in `carstage gui`, and press Drive.",
                )
            self._pause(0.02)
            self._device.look()
        self._next_s = self._clock()

    def drive(self, observation: Observation) -> Any:
        """Command what is pressed, at the pace of the clock."""
        self._next_s = max(self._next_s + self._step_s, self._clock() - self._step_s)
        missing_s = self._next_s - self._clock()
        if missing_s > 0.0:
            self._pause(missing_s)
        self._device.look()
        gear = observation.ego.get_control().gear
        command = self._inputs.command(self._step_s, gear)
        if self._device.is_there:
            self._steer = command.steer
        else:
            command = command._replace(throttle=0.0, brake=1.0, steer=self._steer)
        return control_of(command)


def page_driver(
    spec: DeviceDriverSpec, step_s: float, path: str, pause: Callable[[float], None]
) -> PageDriver:
    """The driver at the page.

    Args:
        spec: which device.
        step_s: simulated seconds of a step.
        path: of the file that the page's server writes.
        pause: waits so many seconds; raises when somebody asks to end.
    """
    inputs = inputs_of(spec.kind, spec.inputs)
    return PageDriver(PageDevice(path, inputs), inputs, step_s, pause)
