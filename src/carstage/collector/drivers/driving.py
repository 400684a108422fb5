"""A driver at work, the ego's or an agent's: asked ahead of each step, applied, and noted."""

from __future__ import annotations

import logging
import math
from typing import Any, Callable, List, Mapping, NamedTuple, Optional, Sequence

import carla

from carstage.collector.drivers.base import Driver, Observation
from carstage.collector.drivers.loading import blamed, load_driver
from carstage.collector.drivers.page import page_driver
from carstage.collector.drivers.replay import ReplayDriver, control_of
from carstage.collector.drivers.route import RouteDriver
from carstage.collector.drivers.watching import NewestData
from carstage.collector.internals.errors import DriverError
from carstage.collector.scenario.autopilot import places_of
from carstage.collector.sensors.rig import Rig
from carstage.collector.world import WorldSession
from carstage.spec import (
    ClassDriverSpec,
    Command,
    DeviceDriverSpec,
    DriverSpec,
    EpisodeSpec,
    ReplayDriverSpec,
    RouteDriverSpec,
)

_log = logging.getLogger(__name__)

_RANGES = {"throttle": (0.0, 1.0), "steer": (-1.0, 1.0), "brake": (0.0, 1.0)}


class AtPage(NamedTuple):
    """How a driver hears of a device at the page.

    Attributes:
        file: where the page's server writes the device's state; empty: there is no page.
        pause: waits so many seconds; raises when somebody asks to end.
    """

    file: str
    pause: Callable[[float], None]


def make_driver(spec: DriverSpec, folders: Sequence[str], step_s: float, page: AtPage) -> Driver:
    """The driver that is planned.

    Args:
        spec: who drives.
        folders: where the user's modules are looked for.
        step_s: simulated time of a step.
        page: how it hears of a device there.

    Raises:
        DriverError: it is not found, or raised when it was made.
    """
    if isinstance(spec, ClassDriverSpec):
        return load_driver(spec, folders)
    if isinstance(spec, ReplayDriverSpec):
        return ReplayDriver(spec.commands)
    if isinstance(spec, DeviceDriverSpec) and spec.at_page:
        return page_driver(spec, step_s, page.file, page.pause)
    if isinstance(spec, DeviceDriverSpec):
        from carstage.collector.drivers.devices import device_driver

        return device_driver(spec, step_s)
    assert isinstance(spec, RouteDriverSpec)
    return RouteDriver(spec.speed_m_s, spec.turns)


def command_of(control: Any) -> Command:
    """What a ``carla.VehicleControl`` commands, exactly as the client sends it.

    Raises:
        ValueError: a number is out of its range.
    """
    for name, (low, high) in _RANGES.items():
        value = getattr(control, name)
        if not (math.isfinite(value) and low <= value <= high):
            raise ValueError("%s is %r; it goes from %g to %g" % (name, value, low, high))
    return Command(
        control.throttle,
        control.steer,
        control.brake,
        int(control.hand_brake),
        int(control.reverse),
        int(control.manual_gear_shift),
        control.gear,
    )


class EgoDriving:
    """Has a driver drive the ego, or an agent's vehicle.

    Args:
        session: the episode's world; the driver is stopped before it is given back.
        spec: the episode; it has a driver. Of an agent, as the agent sees it.
        driver: who drives.
        ego: ``carla.Vehicle``.
        rig: its sensors; nobody listens to them yet.
        timeout_s: how long data of a sensor are waited for.
        field: of the configuration, where errors name the driver.

    Raises:
        DriverError: the driver looks at a sensor that there is none of.
    """

    def __init__(
        self,
        session: WorldSession,
        spec: EpisodeSpec,
        driver: Driver,
        ego: Any,
        rig: Rig,
        timeout_s: float,
        field: str = "ego.driver",
    ) -> None:
        planned = spec.ego.driver
        assert planned is not None
        self._session = session
        self._field = field
        self._driver = driver
        self._name = planned.name if isinstance(planned, ClassDriverSpec) else planned.kind
        self._ego = ego
        self._goals = tuple(places_of(session, spec))
        self._spec = spec
        self._timeout_s = timeout_s
        self._data = NewestData(driver.sensors)
        unknown = sorted(set(driver.sensors) - set(rig.actors))
        if unknown:
            raise DriverError(
                "%s: %s looks at sensor %s, which the rig lacks."
                % (field, self._name, ", ".join(unknown)),
                "The rig has: %s." % ", ".join(rig.actors),
            )
        rig.watch(self._data.callbacks())
        self._control = carla.VehicleControl(brake=1.0, hand_brake=True)
        self._command = command_of(self._control)
        self._ego.apply_control(self._control)

    @property
    def command(self) -> List[Any]:
        """What was commanded for the last step, in the order of ``Command``."""
        return list(self._command)

    def before_step(self, tick: Optional[int]) -> None:
        """Ask the driver and apply what it answers; nothing in the warm-up, where ``tick`` is None.

        Raises:
            DriverError: it raised, or its answer is none.
        """
        if tick is None:
            return
        observation = self._observe(tick)
        when = "ahead of step %d (frame %d)" % (tick, observation.frame + 1)
        if tick == 0:
            self._session.on_exit("driver", self._stop)
            with blamed(self._name, when):
                self._driver.start(observation)
        with blamed(self._name, when):
            control = self._driver.drive(observation)
        if not isinstance(control, carla.VehicleControl):
            raise DriverError(
                "%s: %s returned %.60r %s." % (self._field, self._name, control, when),
                "drive returns a carla.VehicleControl.",
            )
        try:
            self._command = command_of(control)
        except ValueError as error:
            raise DriverError(
                "%s: %s returned a control out of range %s: %s."
                % (self._field, self._name, when, error),
                "Clamp what drive returns.",
            ) from error
        # A copy: the driver may change its own while this one is noted.
        self._control = control_of(self._command)
        self._ego.apply_control(self._control)

    def _observe(self, tick: int) -> Observation:
        snapshot = self._session.world.get_snapshot()
        return Observation(
            tick=tick,
            frame=snapshot.frame,
            time_s=snapshot.timestamp.elapsed_seconds,
            step_s=self._spec.step_s,
            transform=self._ego.get_transform(),
            velocity=self._ego.get_velocity(),
            speed_limit_kmh=self._ego.get_speed_limit(),
            last_control=self._control,
            goals=self._goals,
            ego=self._ego,
            world=self._session.world,
            map=self._session.map,
            data=self._data_of(tick, snapshot.frame),
        )

    def _data_of(self, tick: int, frame: int) -> Mapping[str, Any]:
        """What the sensors that the driver looks at measured; they may not have begun to."""
        spec = self._spec
        if spec.timing.demands_all and (tick or spec.warmup_ticks):
            return self._data.of_frame(frame, self._timeout_s)
        return self._data.newest()

    def _stop(self) -> None:
        """Stop the driver; the episode is recorded by now, and what follows must be given back."""
        try:
            with blamed(self._name, "when it was stopped"):
                self._driver.stop()
        except DriverError as error:
            _log.error("%s", error)
