"""The row of ``ego.parquet``: the ego's motion, its control commands, its place on the earth."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from carstage.geometry import (
    GeoFrame,
    flu_rotation,
    length,
    quaternion_from_matrix,
    rotate,
    rotation_matrix,
)
from carstage.rawlog.reader import WorldFrame
from carstage.spec import EpisodeSpec, WeatherSpec


@dataclass(frozen=True, slots=True)
class EpisodeFacts:
    """What stays the same for a whole episode and stands in each ego row.

    Attributes:
        map_name: as the server gives it.
        weather: as planned.
        geo_frame: how the map lies on the globe.
    """

    map_name: str
    weather: WeatherSpec
    geo_frame: GeoFrame

    @classmethod
    def from_header(cls, header: Mapping[str, Any], spec: EpisodeSpec) -> EpisodeFacts:
        """Read them from the raw log's ``episode.json``."""
        return cls(
            map_name=header["map"],
            weather=spec.weather,
            geo_frame=GeoFrame.from_json(header["geo_reference"]),
        )


def ego_row(
    world: WorldFrame,
    row: int,
    keys: Mapping[str, Any],
    facts: EpisodeFacts,
    *,
    acceleration_valid: bool,
) -> dict[str, Any]:
    """Build the ego's row.

    Args:
        world: the snapshot.
        row: the ego's row in it.
        keys: ``k``, ``timestamp_s`` and ``episode_id``.
        facts: of the episode.
        acceleration_valid: false in an episode's very first frame.
    """
    rotation = rotation_matrix(world.rotation_deg[row])
    velocity, acceleration = world.velocity[row], world.acceleration[row]
    angular_velocity = np.radians(world.angular_velocity_deg[row])
    acceleration_ego = rotate(rotation.T, acceleration)
    control: Mapping[str, Any] = world.meta.get("ego", {})
    light = control.get("traffic_light_state")
    place = facts.geo_frame.place(world.location[row])
    return {
        "k": keys["k"],
        "timestamp_s": keys["timestamp_s"],
        "track_id": int(world.actor_id[row]),
        "episode_id": keys["episode_id"],
        "location": world.location[row].tolist(),
        "rotation_deg": world.rotation_deg[row].tolist(),
        "quaternion": quaternion_from_matrix(flu_rotation(rotation)).tolist(),
        "velocity": velocity.tolist(),
        "velocity_ego": rotate(rotation.T, velocity).tolist(),
        "acceleration": acceleration.tolist() if acceleration_valid else None,
        "acceleration_ego": acceleration_ego.tolist() if acceleration_valid else None,
        "angular_velocity": angular_velocity.tolist(),
        "angular_velocity_ego": rotate(rotation.T, angular_velocity).tolist(),
        "speed": float(length(velocity)),
        "yaw_rate": float(angular_velocity[2]),
        "yaw_rate_flu": -float(angular_velocity[2]),
        "throttle": control.get("throttle"),
        "steer": control.get("steer"),
        "brake": control.get("brake"),
        "hand_brake": control.get("hand_brake"),
        "reverse": control.get("reverse"),
        "gear": control.get("gear"),
        "speed_limit_kmh": control.get("speed_limit_kmh"),
        "traffic_light_state": None if light is None else str(light),
        "weather_preset": facts.weather.preset_at(keys["timestamp_s"]),
        "weather": json.dumps(world.meta.get("weather", {}), sort_keys=True, separators=(",", ":")),
        "map": facts.map_name,
        "latitude_deg": place.latitude_deg,
        "longitude_deg": place.longitude_deg,
        "altitude_m": place.altitude_m,
    }
