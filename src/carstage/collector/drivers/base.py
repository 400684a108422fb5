"""The seam of the drivers: what one is told ahead of each step, and what it answers."""

from __future__ import annotations

from typing import Any, Mapping, NamedTuple, Sequence, Tuple


class Observation(NamedTuple):
    """What a driver is told ahead of a step: the world as it is after the step before.

    Objects are CARLA's own; lengths are in metres, angles in degrees, axes CARLA's world axes
    (left-handed, z up). Whatever is asked of the handles is answered as in any CARLA program.

    Attributes:
        tick: the recorded step that the answer acts in, from 0.
        frame: the server's frame that all of this is of; the answer acts in the next one.
        time_s: simulated seconds of the server at that frame.
        step_s: simulated seconds of a step.
        transform: ``carla.Transform`` of the ego.
        velocity: ``carla.Vector3D`` of the ego in the world, m/s.
        speed_limit_kmh: of the place where the ego is, km/h.
        last_control: ``carla.VehicleControl`` that acted in ``frame``; before the first recorded
            step the brakes are on.
        goals: ``carla.Location`` of each place of scenario ``route``, in order; else empty.
        ego: ``carla.Vehicle``.
        world: ``carla.World``; a driver neither ticks it nor changes its settings.
        map: ``carla.Map``.
        data: ``carla.SensorData`` of this frame by sensor id, of the sensors that the driver names.
    """

    tick: int
    frame: int
    time_s: float
    step_s: float
    transform: Any
    velocity: Any
    speed_limit_kmh: float
    last_control: Any
    goals: Tuple[Any, ...]
    ego: Any
    world: Any
    map: Any
    data: Mapping[str, Any]


class Driver:
    """Drives the ego of one episode; derive from it.

    It is made with the parameters of ``ego.driver.parameters`` as keyword arguments. The calls
    come in this order: ``start``, then ``drive`` ahead of every recorded step, ``stop``. In the
    warm-up the ego stands with its brakes on. What is raised ends the episode.

    Replaying and resuming need the same answers for the same observations: a driver takes no
    random number that it has not seeded, and looks at no clock.

    Attributes:
        sensors: ids of sensors of the rig that it looks at; set it before ``start``.
    """

    sensors: Sequence[str] = ()

    def start(self, observation: Observation) -> None:
        """Called once, ahead of the first recorded step; by default nothing.

        Args:
            observation: the one that the first ``drive`` is called with.
        """

    def drive(self, observation: Observation) -> Any:
        """Say what the ego does in the next step.

        Args:
            observation: what is known.

        Returns:
            ``carla.VehicleControl``: throttle and brake from 0 to 1, steer from -1 (left) to 1.
        """
        raise NotImplementedError

    def stop(self) -> None:
        """Called once at the end, also after a failure; by default nothing."""
