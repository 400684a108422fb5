"""IMU and GNSS: sensors that measure the motion and place of what carries them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.town import Town
from carstage_sim.sensors.attributes import number, require, whole
from carstage_sim.sensors.measurements import GnssFrame, ImuFrame, SensorRequest
from carstage_sim.sensors.noise import noise_stream
from carstage_sim.sensors.projection import geodetic
from carstage_sim.sensors.sensor import MeasuringSensor, SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.columns import Rotation
from carstage_sim.world.state import WorldState

GRAVITY_M_S2 = 9.81

Vector = NDArray[np.float64]


def compass_rad(yaw_deg: float) -> float:
    """Heading from north (-y), clockwise, in [0, 2 pi): ``(yaw + 90 deg) mod 360 deg``."""
    return math.radians((yaw_deg + 90.0) % 360.0)


@SensorRegistry.register("sensor.other.imu")
class Imu(MeasuringSensor):
    """Accelerometer, gyroscope and compass."""

    looks = False

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        a = request.attributes
        self.seed = whole(a, "noise_seed", 0)
        self.accel_stddev = np.array([number(a, f"noise_accel_stddev_{k}", 0.0) for k in "xyz"])
        self.gyro_stddev = np.array([number(a, f"noise_gyro_stddev_{k}", 0.0) for k in "xyz"])
        self.gyro_bias = np.array([number(a, f"noise_gyro_bias_{k}", 0.0) for k in "xyz"])
        require(
            bool((self.accel_stddev >= 0).all() and (self.gyro_stddev >= 0).all()),
            "standard deviations of an IMU must not be negative",
        )
        self._track: list[tuple[Vector, float]] = []

    def observe(self, state: WorldState, request: SensorRequest) -> None:
        """Remember where the sensor was."""
        self._track = [*self._track[-2:], (np.array(request.location), state.delta_s)]

    def _acceleration(self) -> Vector:
        """Second difference of the last three locations (m/s^2, world); 0 before there are three.

        CARLA's ``InertialMeasurementUnit.cpp``, with its unequal steps.
        """
        if len(self._track) < 3:
            return np.zeros(3)
        (oldest, _), (middle, before_s), (newest, step_s) = self._track
        if before_s <= 0.0 or step_s <= 0.0:
            return np.zeros(3)
        both_s = before_s + step_s
        acceleration: Vector = 2.0 * (
            newest / (step_s * both_s) - middle / (step_s * before_s) + oldest / (before_s * both_s)
        )
        return acceleration

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> ImuFrame:
        """The carrier's motion; an IMU at rest on the level reads (0, 0, 9.81)."""
        self.observe(state, request)
        rotation = rotation_matrix(request.rotation_deg)
        random = noise_stream(self.seed, request, state)
        force = self._acceleration() + np.array([0.0, 0.0, request.gravity])
        accelerometer = force @ rotation + random.normal(0.0, 1.0, 3) * self.accel_stddev
        turn = np.zeros(3)
        (rows,) = np.nonzero(state.actor_id == request.owner_id)
        if request.owner_id and len(rows):
            owner = rotation_matrix(state.rotation_deg[rows[0]])
            local = np.radians(state.angular_velocity_deg[rows[0]]) @ owner
            # CARLA turns by the sensor's relative rotation forwards: right only for none.
            turn = (owner.T @ rotation) @ local
        gyroscope = turn + self.gyro_bias + random.normal(0.0, 1.0, 3) * self.gyro_stddev
        ax, ay, az = accelerometer.tolist()
        gx, gy, gz = gyroscope.tolist()
        return ImuFrame((ax, ay, az), (gx, gy, gz), compass_rad(request.rotation_deg[Rotation.YAW]))


@SensorRegistry.register("sensor.other.gnss")
class Gnss(MeasuringSensor):
    """Geographic position of the sensor."""

    looks = False

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        a = request.attributes
        self.seed = whole(a, "noise_seed", 0)
        axes = ("lat", "lon", "alt")
        self.bias = np.array([number(a, f"noise_{axis}_bias", 0.0) for axis in axes])
        self.stddev = np.array([number(a, f"noise_{axis}_stddev", 0.0) for axis in axes])
        require(
            bool((self.stddev >= 0).all()),
            "standard deviations of a GNSS sensor must not be negative",
        )

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> GnssFrame:
        """Latitude, longitude, altitude with the attributes' bias and noise."""
        random = noise_stream(self.seed, request, state)
        noise = self.bias + random.normal(0.0, 1.0, 3) * self.stddev
        reference = self.town.geo_reference
        place = np.array(geodetic(request.location, reference, request.projection)) + noise
        latitude, longitude, altitude = place.tolist()
        return GnssFrame(latitude, longitude, altitude)
