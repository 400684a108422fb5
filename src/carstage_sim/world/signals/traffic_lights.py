"""Signal control: the lights of a junction share one cycle of green, yellow and all red.

As in CARLA, the lights of one junction form a group; one phase of it is green at a time, then
yellow, then red for ``red_s`` seconds before the next phase starts. ``red_s`` is thus the clearing
time, not how long a light stays red.

Unlike CARLA's, the signals are actuated, as most in real cities are: a green lasts until its queue
is gone or small against another one, and the longest queue is next, but nobody waits for ever (the
idea of max pressure control: Varaiya, "Max pressure control of a network of signalized
intersections", 2013); the clearing time ends when nobody is left on the junction. ``green_s`` then
has no say, and ``red_s`` is a bound. While nobody is about, or once a client has set a light of the
junction, the cycle is CARLA's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import TrafficLightSite
from carstage_sim.world.signals.trigger_boxes import TriggerBoxes

GREEN_S = 10.0
YELLOW_S = 3.0
RED_S = 2.0
LEAST_GREEN_S = 3.0
GAP_S = 1.0
"""An actuated green ends when for so long nobody was near it, and somebody waits elsewhere."""
OUTNUMBERED = 3
"""It ends, too, when before another light there are so many times as many vehicles."""
LONGEST_WAIT_S = 40.0
"""It ends in any case when somebody has waited elsewhere for so long."""

_ROUNDING_S = 1e-6
"""Time is a sum of steps: without this, 200 times 0.05 s would fall short of 10 s."""


class TrafficLightState(IntEnum):
    """``carla.TrafficLightState``."""

    RED = 0
    YELLOW = 1
    GREEN = 2
    OFF = 3
    UNKNOWN = 4


_NEXT = {
    TrafficLightState.GREEN: TrafficLightState.YELLOW,
    TrafficLightState.YELLOW: TrafficLightState.RED,
    TrafficLightState.RED: TrafficLightState.GREEN,
}


@dataclass(frozen=True, slots=True)
class Queues:
    """What the detectors of actuated signals see.

    Attributes:
        count: ``(L,)`` int, vehicles that wait or come before each light.
        near: ``(L,)`` bool, whether one of them is so near that the light's green is in use.
        beyond: ``(L,)`` bool, whether anybody is on each light's junction.
    """

    count: NDArray[np.int64]
    near: NDArray[np.bool_]
    beyond: NDArray[np.bool_]


@dataclass(slots=True)
class _Junction:
    """The cycle of one junction: which phase is on, in which part, for how long.

    Attributes:
        lights: of all phases.
        unused_s: for how long nobody has been near the lights of the active phase.
        waited_s: of each phase, for how long somebody has been before it under red.
        is_led_by_client: whether a client set a light here; the cycle then is of fixed lengths.
    """

    phases: list[list[int]]
    lights: list[int] = field(init=False)
    active: int = 0
    part: TrafficLightState = TrafficLightState.GREEN
    elapsed_s: float = 0.0
    unused_s: float = 0.0
    waited_s: list[float] = field(default_factory=list)
    is_led_by_client: bool = False

    def __post_init__(self) -> None:
        self.lights = [light for phase in self.phases for light in phase]

    @property
    def is_actuated(self) -> bool:
        """Whether vehicles act on the cycle."""
        return len(self.phases) > 1 and not self.is_led_by_client


class TrafficLightSystem:
    """The state of every traffic light.

    Args:
        sites: the map's lights; the index of a site is the index of its light.

    Attributes:
        state: ``(L,)`` uint8, values of :class:`TrafficLightState`.
        elapsed_s: ``(L,)`` float64 seconds since the phase whose turn it is went on to the state
            that it shows; 0 of the lights of all other phases, as CARLA's controllers count.
        green_s, yellow_s, red_s: ``(L,)`` float64 durations; equal within a phase.
        frozen: ``(L,)`` bool.
        turned_red: ``(L,)`` bool, whether the last step found a light red that was not before.
        led: whether a replay shows the states (:meth:`show`), and the cycles wait.
    """

    def __init__(self, sites: Sequence[TrafficLightSite]) -> None:
        count = len(sites)
        self.state: NDArray[np.uint8] = np.full(count, TrafficLightState.RED, dtype=np.uint8)
        self.elapsed_s: NDArray[np.float64] = np.zeros(count)
        self.green_s: NDArray[np.float64] = np.full(count, GREEN_S)
        self.yellow_s: NDArray[np.float64] = np.full(count, YELLOW_S)
        self.red_s: NDArray[np.float64] = np.full(count, RED_S)
        self.frozen: NDArray[np.bool_] = np.zeros(count, dtype=np.bool_)
        self.turned_red: NDArray[np.bool_] = np.zeros(count, dtype=np.bool_)
        self.led = False
        self._junctions = _junctions_of(sites)
        self._junction_of = {
            light: junction for junction in self._junctions for light in junction.lights
        }
        self._triggers = TriggerBoxes(
            (index, box) for index, site in enumerate(sites) for box in site.trigger
        )
        self.reset_all()
        self._was_red: NDArray[np.bool_] = self.state == TrafficLightState.RED

    def __len__(self) -> int:
        return len(self.state)

    def step(self, delta_s: float, queues: Queues | None = None) -> None:
        """Advances the cycles of all junctions that are not frozen.

        Args:
            delta_s: by so much.
            queues: what is before the lights; None for nobody anywhere.
        """
        if not self.led:
            self._advance_all(delta_s, queues)
        is_red = self.state == TrafficLightState.RED
        self.turned_red = is_red & ~self._was_red
        self._was_red = is_red

    def _advance_all(self, delta_s: float, queues: Queues | None) -> None:
        # Lists: of a junction's few lights an array takes longer to ask.
        frozen, shown_s = self.frozen.tolist(), self.elapsed_s.tolist()
        if queues is not None:
            count, near = queues.count.tolist(), queues.near.tolist()
            beyond = queues.beyond.tolist()
        for junction in self._junctions:
            if frozen[junction.lights[0]]:
                continue
            junction.elapsed_s += delta_s
            if queues is not None and junction.is_actuated:
                counts = [sum(count[light] for light in phase) for phase in junction.phases]
                is_used = any(near[light] for light in junction.phases[junction.active])
                is_clear = not beyond[junction.lights[0]]
                self._actuate(junction, delta_s, counts, is_used=is_used, is_clear=is_clear)
            else:
                self._advance(junction, [0] * len(junction.phases))
            for light in junction.lights:
                shown_s[light] = 0.0
            for light in junction.phases[junction.active]:
                shown_s[light] = junction.elapsed_s
        self.elapsed_s[:] = shown_s

    def _actuate(
        self,
        junction: _Junction,
        delta_s: float,
        counts: list[int],
        *,
        is_used: bool,
        is_clear: bool,
    ) -> None:
        """Advances one cycle as its detectors want it.

        Args:
            delta_s: by so much, which is in the cycle's time already.
            counts: vehicles before each phase.
            is_used: whether one is near the active phase.
            is_clear: whether nobody is on the junction.
        """
        junction.unused_s = 0.0 if is_used else junction.unused_s + delta_s
        junction.waited_s = [
            waited_s + delta_s if count else 0.0
            for waited_s, count in zip(junction.waited_s, counts, strict=True)
        ]
        if junction.part == TrafficLightState.GREEN and any(counts):
            junction.waited_s[junction.active] = 0.0
            if not _green_ends(junction, counts):
                junction.elapsed_s = min(junction.elapsed_s, self._duration_s(junction))
                return
            junction.elapsed_s = self._duration_s(junction)
        elif junction.part == TrafficLightState.RED and any(counts) and is_clear:
            junction.elapsed_s = self._duration_s(junction)
        self._advance(junction, counts)

    def _advance(self, junction: _Junction, counts: list[int]) -> None:
        """Begins the parts of a cycle that are due."""
        while junction.elapsed_s + _ROUNDING_S >= self._duration_s(junction):
            junction.elapsed_s = max(junction.elapsed_s - self._duration_s(junction), 0.0)
            junction.part = _NEXT[junction.part]
            if junction.part == TrafficLightState.GREEN:
                junction.active = _next_phase(junction, counts)
                junction.unused_s = 0.0
            self.state[junction.phases[junction.active]] = junction.part

    def _duration_s(self, junction: _Junction) -> float:
        light = junction.phases[junction.active][0]
        durations = {
            TrafficLightState.GREEN: self.green_s,
            TrafficLightState.YELLOW: self.yellow_s,
            TrafficLightState.RED: self.red_s,
        }
        # A zero duration in every part must not spin for ever.
        return max(float(durations[junction.part][light]), 1e-3)

    def set_state(self, index: int, state: int) -> None:
        """Shows a state at one light until its junction's cycle next changes it."""
        self._junction_of[index].is_led_by_client = True
        self.state[index] = TrafficLightState(state)

    def show(self, index: int, state: int, elapsed_s: float) -> None:
        """Shows what a replay says of one light."""
        self.state[index] = TrafficLightState(state)
        self.elapsed_s[index] = elapsed_s

    def adopt_states(self) -> None:
        """Lets every cycle go on from the states that are shown, for the end of a replay."""
        running = (TrafficLightState.GREEN, TrafficLightState.YELLOW)
        for junction in self._junctions:
            junction.part = TrafficLightState.RED
            since_s = np.array([self.elapsed_s[phase[0]] for phase in junction.phases])
            # While all are red one clock runs; in older logs all do, and that phase's began last.
            junction.active = int(np.argmin(np.where(since_s > 0.0, since_s, np.inf)))
            for number, phase in enumerate(junction.phases):
                if self.state[phase[0]] in running:
                    junction.active = number
                    junction.part = TrafficLightState(int(self.state[phase[0]]))
            junction.elapsed_s = float(self.elapsed_s[junction.phases[junction.active][0]])

    def set_times(
        self,
        index: int,
        green: float | None = None,
        yellow: float | None = None,
        red: float | None = None,
    ) -> None:
        """Sets durations (s) for the whole phase that a light belongs to.

        Raises:
            ValueError: a negative duration.
        """
        lights = self._phase_of(index)
        self._junction_of[index].is_led_by_client = True
        for column, value in ((self.green_s, green), (self.yellow_s, yellow), (self.red_s, red)):
            if value is None:
                continue
            if not value >= 0.0:
                raise ValueError(f"a traffic light cannot last {value} s")
            column[lights] = value

    def freeze(self, index: int, frozen: bool) -> None:
        """Stops or restarts the cycle of the junction that a light belongs to."""
        self.frozen[self.group(index)] = frozen

    def freeze_all(self, frozen: bool) -> None:
        """Stops or restarts every cycle."""
        self.frozen[:] = frozen

    def reset_group(self, index: int) -> None:
        """Starts the cycle of a light's junction over, with its first phase green."""
        self._reset(self._junction_of[index])

    def reset_all(self) -> None:
        """Starts every cycle over."""
        for junction in self._junctions:
            self._reset(junction)

    def _reset(self, junction: _Junction) -> None:
        junction.active, junction.part, junction.elapsed_s = 0, TrafficLightState.GREEN, 0.0
        junction.unused_s, junction.waited_s = 0.0, [0.0] * len(junction.phases)
        self.elapsed_s[junction.lights] = 0.0
        self.state[junction.lights] = TrafficLightState.RED
        self.state[junction.phases[0]] = TrafficLightState.GREEN

    def group(self, index: int) -> list[int]:
        """Indices of all lights of a light's junction, itself included, ascending."""
        return sorted(self._junction_of[index].lights)

    def _phase_of(self, index: int) -> list[int]:
        for phase in self._junction_of[index].phases:
            if index in phase:
                return phase
        raise KeyError(index)

    def lights_at(
        self,
        center: NDArray[np.float64],
        half_size: NDArray[np.float64],
        yaw_rad: NDArray[np.float64],
    ) -> NDArray[np.int32]:
        """The light that governs each vehicle.

        As in CARLA (``TrafficLightComponent.cpp``) a vehicle is at a light while any part of it is
        in one of the light's trigger volumes: from its front bumper's entry to its rear's exit.

        Args:
            center, half_size, yaw_rad: the vehicles' bodies, see :meth:`TriggerBoxes.owners_at`.

        Returns:
            ``(N,)`` int32 index of a light, or -1.
        """
        return self._triggers.owners_at(center, half_size, yaw_rad)


def _green_ends(junction: _Junction, counts: list[int]) -> bool:
    """Whether a green gives way: it is unused or outnumbered, or others have waited long."""
    own = counts[junction.active]
    others = max(count for phase, count in enumerate(counts) if phase != junction.active)
    if not others or junction.elapsed_s + _ROUNDING_S < LEAST_GREEN_S:
        return False
    return (
        junction.unused_s + _ROUNDING_S >= GAP_S
        or others >= OUTNUMBERED * max(own, 1)
        or max(junction.waited_s) + _ROUNDING_S >= LONGEST_WAIT_S
    )


def _next_phase(junction: _Junction, counts: list[int]) -> int:
    """Who has waited too long, else the longest queue; the next in turn where nobody is."""
    turns = [(junction.active + step) % len(counts) for step in range(1, len(counts) + 1)]
    late = [phase for phase in turns if junction.waited_s[phase] >= LONGEST_WAIT_S]
    if late:
        return max(late, key=lambda phase: junction.waited_s[phase])
    return max(turns, key=lambda phase: counts[phase])


def _junctions_of(sites: Sequence[TrafficLightSite]) -> list[_Junction]:
    """Junctions and their phases, both in ascending order of their numbers."""
    grouped: dict[int, dict[int, list[int]]] = {}
    for index, site in enumerate(sites):
        grouped.setdefault(site.junction_id, {}).setdefault(site.phase, []).append(index)
    return [
        _Junction([phases[phase] for phase in sorted(phases)])
        for _, phases in sorted(grouped.items())
    ]
