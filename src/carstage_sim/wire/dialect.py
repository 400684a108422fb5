"""What differs between the protocol versions, as tables.

The client never announces its version, so a server speaks one dialect per port. A new version is a
new :class:`Dialect` in :data:`DIALECTS`; no other module branches on a version.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from carstage_sim.wire.errors import UnknownProtocolError

COMMANDS_0_9_14 = (
    "SpawnActor",
    "DestroyActor",
    "ApplyVehicleControl",
    "ApplyVehicleAckermannControl",
    "ApplyWalkerControl",
    "ApplyVehiclePhysicsControl",
    "ApplyTransform",
    "ApplyWalkerState",
    "ApplyTargetVelocity",
    "ApplyTargetAngularVelocity",
    "ApplyImpulse",
    "ApplyForce",
    "ApplyAngularImpulse",
    "ApplyTorque",
    "SetSimulatePhysics",
    "SetEnableGravity",
    "SetAutopilot",
    "ShowDebugTelemetry",
    "SetVehicleLightState",
    "ApplyLocation",
    "ConsoleCommand",
    "SetTrafficLightState",
)

SENSORS_0_9_16 = (
    "sensor.other.collision",
    "sensor.camera.depth",
    "sensor.camera.normals",
    "sensor.camera.dvs",
    "sensor.other.gnss",
    "sensor.other.imu",
    "sensor.other.lane_invasion",
    "sensor.other.obstacle",
    "sensor.camera.optical_flow",
    "sensor.other.radar",
    "sensor.lidar.ray_cast_semantic",
    "sensor.lidar.ray_cast",
    "sensor.other.rss",
    "sensor.camera.rgb",
    "sensor.camera.semantic_segmentation",
    "sensor.camera.instance_segmentation",
    "sensor.camera.cosmos_visualization",
    "world_observer",
    "gbuffer.uint8",
    "gbuffer.float",
    "sensor.other.v2x",
    "sensor.other.v2x_custom",
)


@dataclass(frozen=True, slots=True)
class Dialect:
    """One protocol version.

    Attributes:
        version: what the ``version`` call answers.
        attribute_type_base: number of the attribute type ``bool``; the others follow.
        sensors: the sensor registry in its order; a message's ``sensor_type`` is an index in it.
        commands: the commands of ``apply_batch`` in their order.
        vehicle_failure_byte: whether a vehicle's record ends with its failure state.
        reopens_episode: whether the client opens a new episode after ``load_new_episode``.
        labels: semantic label of 0.9.14 and later -> this version's, where they differ.
    """

    version: str
    attribute_type_base: int
    sensors: tuple[str, ...]
    commands: tuple[str, ...]
    vehicle_failure_byte: bool = True
    reopens_episode: bool = False
    labels: Mapping[int, int] = field(default_factory=dict)

    @property
    def world_observer(self) -> int:
        """Registry index of the world-observer message."""
        return self.sensors.index("world_observer")


DIALECTS: Mapping[str, Dialect] = {
    "0.9.16": Dialect(
        version="0.9.16",
        attribute_type_base=1,
        sensors=SENSORS_0_9_16,
        commands=COMMANDS_0_9_14,
        reopens_episode=True,
    ),
}


def dialect(version: str) -> Dialect:
    """The dialect of a protocol version.

    Raises:
        UnknownProtocolError: no table for that version is built in.
    """
    try:
        return DIALECTS[version]
    except KeyError:
        raise UnknownProtocolError(version, tuple(DIALECTS)) from None
