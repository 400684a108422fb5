"""Names that came to the client after 0.9.13, or went, by the first or last version that has them.

Read from the wheels themselves by ``dir``; a test compares them with the wheels that are installed.
``Class.*`` stands for a whole class.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

SINCE: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "0.9.14": (
            "AckermannControllerSettings.*",
            "AttachmentType.SpringArmGhost",
            "CityObjectLabel.Bicycle",
            "CityObjectLabel.Bus",
            "CityObjectLabel.Car",
            "CityObjectLabel.Motorcycle",
            "CityObjectLabel.Rider",
            "CityObjectLabel.Train",
            "CityObjectLabel.Truck",
            "GBufferTextureID.*",
            "LightManager.set_day_night_cycle",
            "ServerSideSensor.is_listening_gbuffer",
            "ServerSideSensor.listen_to_gbuffer",
            "ServerSideSensor.stop_gbuffer",
            "TrafficManager.global_lane_offset",
            "TrafficManager.set_desired_speed",
            "TrafficManager.vehicle_lane_offset",
            "Vehicle.apply_ackermann_control",
            "Vehicle.apply_ackermann_controller_settings",
            "Vehicle.get_ackermann_controller_settings",
            "Vehicle.get_failure_state",
            "VehicleAckermannControl.*",
            "VehicleFailureState.*",
            "WeatherParameters.DustStorm",
            "WeatherParameters.dust_storm",
            "command.ApplyVehicleAckermannControl.*",
        ),
        "0.9.15": (
            "Actor.set_collisions",
            "BlueprintLibrary.filter_by_attribute",
            "Client.load_world_if_different",
            "Client.set_replayer_ignore_spectator",
            "ServerSideSensor.disable_for_ros",
            "ServerSideSensor.enable_for_ros",
            "ServerSideSensor.is_enabled_for_ros",
            "WorldSettings.spectator_as_ego",
        ),
        "0.9.16": (
            "Actor.get_bone_names",
            "Actor.get_bone_relative_transforms",
            "Actor.get_bone_world_transforms",
            "Actor.get_component_names",
            "Actor.get_component_relative_transform",
            "Actor.get_component_world_transform",
            "Actor.get_socket_names",
            "Actor.get_socket_relative_transforms",
            "Actor.get_socket_world_transforms",
            "BoundingBox.actor_id",
            "CAMEvent.*",
            "CAMMessage.*",
            "CustomV2XData.*",
            "CustomV2XEvent.*",
            "DebugHelper.clear_debug_shape",
            "DebugHelper.clear_debug_string",
            "DebugHelper.draw_hud_arrow",
            "DebugHelper.draw_hud_box",
            "DebugHelper.draw_hud_line",
            "DebugHelper.draw_hud_point",
            "Map.geolocation_to_transform",
            "Map.get_all_road_marks",
            "Map.get_all_road_marks_of_type",
            "Map.get_road_marks_from_id",
            "RoadMark.*",
            "RoadMarkOrientation.*",
            "ServerSideSensor.enable_gbuffers",
            "ServerSideSensor.get_ignored_vehicles",
            "ServerSideSensor.send",
            "ServerSideSensor.set_ignored_vehicles",
            "TrafficManager.keep_slow_lane_rule_percentage",
            "Transform.inverse_transform",
            "Vehicle.get_telemetry_data",
            "Vehicle.get_vehicle_bone_world_transforms",
            "Vehicle.get_wheel_pitch_angle",
            "Vehicle.restore_physx_physics",
            "Vehicle.set_wheel_pitch_angle",
            "VehicleTelemetryData.*",
            "Waypoint.is_rht",
            "WheelTelemetryData.*",
            "World.get_imui_sensor_gravity",
            "World.set_annotations_traverse_translucency",
            "World.set_imui_sensor_gravity",
            "command.SpawnActor.attachment_type",
            "command.SpawnActor.socket_name",
            "vector_of_wheels_telemetry.*",
        ),
    }
)

UNTIL: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "0.9.13": ("CityObjectLabel.Vehicles", "ServerSideSensor"),
        "0.9.15": ("TrafficManager.keep_right_rule_percentage",),
    }
)


def names_of(version: str, newest: Iterable[str]) -> frozenset[str]:
    """The names of a version's client.

    Args:
        version: such as ``0.9.13``.
        newest: names of the newest client.
    """
    later = {name for first, names in SINCE.items() if first > version for name in names}
    gone = {name for last, names in UNTIL.items() if last >= version for name in names}
    kept = {
        name
        for name in newest
        if name not in later and f"{name.rpartition('.')[0] or name}.*" not in later
    }
    return frozenset(kept | gone)
