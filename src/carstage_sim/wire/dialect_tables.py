"""The tables that dialects are put together from, each under the first version that has it.

All of it was read from the client wheels themselves: the sensor registries, the numbers of commands
and labels from their debug information, the calls from the names that they can send.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from carstage_sim.labels import CityObjectLabel

WORLD_OBSERVER = "world_observer"
"""Name of the world-observer message in a sensor registry; no blueprint has it."""

SENSORS_0_9_13 = (
    "sensor.other.collision",
    "sensor.camera.depth",
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
    WORLD_OBSERVER,
)

SENSORS_0_9_14 = (
    *SENSORS_0_9_13[:2],
    "sensor.camera.normals",
    *SENSORS_0_9_13[2:],
    "gbuffer.uint8",
    "gbuffer.float",
)

SENSORS_0_9_16 = (
    *SENSORS_0_9_14[:16],
    "sensor.camera.cosmos_visualization",
    *SENSORS_0_9_14[16:],
    "sensor.other.v2x",
    "sensor.other.v2x_custom",
)

COMMANDS_0_9_13 = (
    "SpawnActor",
    "DestroyActor",
    "ApplyVehicleControl",
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
)

COMMANDS_0_9_14 = (
    *COMMANDS_0_9_13[:3],
    "ApplyVehicleAckermannControl",
    *COMMANDS_0_9_13[3:],
    "ApplyLocation",
    "ConsoleCommand",
    "SetTrafficLightState",
)

CALLS_SINCE_0_9_14 = frozenset(
    {
        "get_sensor_token",
        "apply_ackermann_control_to_vehicle",
        "get_ackermann_controller_settings",
        "apply_ackermann_controller_settings",
        "update_day_night_cycle",
        "get_gbuffer_token",
    }
)

BLUEPRINTS_SINCE_0_9_15 = frozenset({"util.actor.empty"})

CALLS_SINCE_0_9_15 = frozenset(
    {
        "set_actor_collisions",
        "set_actor_dead",
        "enable_sensor_for_ros",
        "disable_sensor_for_ros",
        "is_sensor_enabled_for_ros",
        "set_replayer_ignore_spectator",
    }
)

CALLS_SINCE_0_9_16 = frozenset(
    {
        "get_telemetry_data",
        "set_wheel_pitch_angle",
        "get_wheel_pitch_angle",
        "get_actor_bounding_box",
        "get_actor_component_names",
        "get_actor_bone_names",
        "get_actor_socket_names",
        "get_actor_component_world_transform",
        "get_actor_component_relative_transform",
        "get_actor_bone_world_transforms",
        "get_actor_bone_relative_transforms",
        "get_actor_socket_world_transforms",
        "get_actor_socket_relative_transforms",
        "get_vehicle_bone_world_transforms",
        "restore_physx_physics",
        "clear_debug_shape",
        "clear_debug_string",
        "get_imui_gravity",
        "set_imui_gravity",
        "set_annotations_traverse_translucency",
        "set_ignored_vehicles",
        "enable_gbuffers",
        "are_gbuffers_enabled",
        "send",
    }
)

_VEHICLES_0_9_13 = 10

LABELS_0_9_13: Mapping[int, int] = MappingProxyType(
    {
        CityObjectLabel.BUILDINGS: 1,
        CityObjectLabel.FENCES: 2,
        CityObjectLabel.OTHER: 3,
        CityObjectLabel.PEDESTRIANS: 4,
        # CARLA's sensor reference of 0.9.13: "humans that walk or ride/drive any kind of vehicle".
        CityObjectLabel.RIDER: 4,
        CityObjectLabel.POLES: 5,
        CityObjectLabel.ROAD_LINES: 6,
        CityObjectLabel.ROADS: 7,
        CityObjectLabel.SIDEWALKS: 8,
        CityObjectLabel.VEGETATION: 9,
        CityObjectLabel.CAR: _VEHICLES_0_9_13,
        CityObjectLabel.TRUCK: _VEHICLES_0_9_13,
        CityObjectLabel.BUS: _VEHICLES_0_9_13,
        CityObjectLabel.TRAIN: _VEHICLES_0_9_13,
        CityObjectLabel.MOTORCYCLE: _VEHICLES_0_9_13,
        CityObjectLabel.BICYCLE: _VEHICLES_0_9_13,
        CityObjectLabel.WALLS: 11,
        CityObjectLabel.TRAFFIC_SIGNS: 12,
        CityObjectLabel.SKY: 13,
        CityObjectLabel.GROUND: 14,
        CityObjectLabel.BRIDGE: 15,
        CityObjectLabel.RAIL_TRACK: 16,
        CityObjectLabel.GUARD_RAIL: 17,
        CityObjectLabel.TRAFFIC_LIGHT: 18,
        CityObjectLabel.STATIC: 19,
        CityObjectLabel.DYNAMIC: 20,
        CityObjectLabel.WATER: 21,
        CityObjectLabel.TERRAIN: 22,
    }
)
"""Label of 0.9.14 and later -> label of 0.9.13, which knew one kind of vehicle and no riders."""
