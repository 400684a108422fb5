"""The names of the ``carla`` client that no recording goes without, by class."""

from __future__ import annotations

from typing import Dict, Tuple

NEEDED: Dict[str, Tuple[str, ...]] = {
    "ActorBlueprint": ("get_attribute", "has_attribute", "id", "set_attribute"),
    "Actor": (
        *("attributes", "bounding_box", "destroy", "get_acceleration", "get_angular_velocity"),
        *("get_transform", "get_velocity", "id", "parent", "semantic_tags"),
        *("set_simulate_physics", "type_id"),
    ),
    "ActorList": ("filter", "find"),
    "ActorSnapshot": (
        *("get_acceleration", "get_angular_velocity", "get_transform", "get_velocity", "id"),
    ),
    "AttachmentType": ("Rigid",),
    "BlueprintLibrary": ("filter", "find"),
    "BoundingBox": ("extent", "location", "rotation"),
    "CityObjectLabel": ("names",),
    "Client": (
        *("apply_batch", "apply_batch_sync", "get_available_maps", "get_client_version"),
        *("get_server_version", "get_trafficmanager", "get_world", "load_world", "set_timeout"),
    ),
    "command": (
        *("ApplyTargetAngularVelocity", "ApplyTargetVelocity", "ApplyTransform"),
        *("ApplyVehicleControl", "ApplyWalkerControl", "DestroyActor", "SetSimulatePhysics"),
        *("SetVehicleLightState",),
    ),
    "LaneType": ("Driving", "Sidewalk"),
    "Location": ("x", "y", "z"),
    "Map": (
        *("get_crosswalks", "get_spawn_points", "get_waypoint", "name", "to_opendrive"),
        "transform_to_geolocation",
    ),
    "MapLayer": ("All", "NONE", "names"),
    "Rotation": ("pitch", "roll", "yaw"),
    "Sensor": ("is_listening", "listen", "stop"),
    "TrafficLight": ("get_state", "get_stop_waypoints"),
    "TrafficLightState": ("Green", "Off", "Red", "Unknown", "Yellow"),
    "TrafficManager": (
        *("set_hybrid_physics_mode", "set_random_device_seed", "set_synchronous_mode", "shut_down"),
        *("update_vehicle_lights", "vehicle_percentage_speed_difference"),
    ),
    "Transform": ("get_forward_vector", "location", "rotation"),
    "Vector3D": ("x", "y", "z"),
    "Vehicle": (
        *("apply_control", "get_control", "get_traffic_light_state", "set_autopilot"),
        *("set_light_state",),
    ),
    "VehicleControl": ("brake", "gear", "hand_brake", "reverse", "steer", "throttle"),
    "VehicleLightState": ("Brake", "LeftBlinker", "RightBlinker"),
    "WalkerAIController": ("go_to_location", "set_max_speed", "start", "stop"),
    "WalkerControl": ("direction", "speed"),
    "WeatherParameters": ("cloudiness", "sun_altitude_angle"),
    "World": (
        *("apply_settings", "get_actors", "get_blueprint_library", "get_map", "get_settings"),
        *("get_random_location_from_navigation", "get_snapshot", "get_weather", "id", "on_tick"),
        *("remove_on_tick", "set_weather", "spawn_actor", "tick"),
    ),
    "WorldSettings": (
        *("fixed_delta_seconds", "max_substep_delta_time", "max_substeps", "no_rendering_mode"),
        *("substepping", "synchronous_mode"),
    ),
    "WorldSnapshot": ("find", "frame", "id", "timestamp"),
}
"""All of them exist in the clients 0.9.13 to 0.9.16."""
