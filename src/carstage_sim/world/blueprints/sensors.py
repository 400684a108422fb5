"""The sensors that the simulator produces, with CARLA's attributes and defaults.

Defaults follow CARLA's sensor reference (0.9.16). Attributes of effects that the renderer does not
model are accepted all the same, so that existing scripts run unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence

from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.state import ActorKind

_F = AttributeType.FLOAT
_I = AttributeType.INT
_B = AttributeType.BOOL
_S = AttributeType.STRING

_Row = tuple[str, AttributeType, str]

_ROLES = (
    "front",
    "back",
    "left",
    "right",
    "front_left",
    "front_right",
    "back_left",
    "back_right",
)

_CAMERA: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    ("image_size_x", _I, "800"),
    ("image_size_y", _I, "600"),
    ("fov", _F, "90.0"),
    ("lens_circle_falloff", _F, "5.0"),
    ("lens_circle_multiplier", _F, "0.0"),
    ("lens_k", _F, "-1.0"),
    ("lens_kcube", _F, "0.0"),
    ("lens_x_size", _F, "0.08"),
    ("lens_y_size", _F, "0.08"),
)

_ROLLING: tuple[_Row, ...] = (*_CAMERA, ("rolling_shutter_s", _F, "0.0"))
"""Cameras whose rows may be exposed one after the other, which CARLA's cannot."""

_POST_PROCESS: tuple[_Row, ...] = (
    ("enable_postprocess_effects", _B, "true"),
    ("gamma", _F, "2.2"),
    ("shutter_speed", _F, "200.0"),
    ("iso", _F, "100.0"),
    ("fstop", _F, "1.4"),
    ("min_fstop", _F, "1.2"),
    ("blade_count", _I, "5"),
    ("exposure_compensation", _F, "0.0"),
    ("exposure_min_bright", _F, "10.0"),
    ("exposure_max_bright", _F, "12.0"),
    ("exposure_speed_up", _F, "3.0"),
    ("exposure_speed_down", _F, "1.0"),
    ("calibration_constant", _F, "16.0"),
    ("focal_distance", _F, "1000.0"),
    ("blur_amount", _F, "1.0"),
    ("blur_radius", _F, "0.0"),
    ("motion_blur_intensity", _F, "0.45"),
    ("motion_blur_max_distortion", _F, "0.35"),
    ("motion_blur_min_object_screen_size", _F, "0.1"),
    ("lens_flare_intensity", _F, "0.1"),
    ("bloom_intensity", _F, "0.675"),
    ("slope", _F, "0.88"),
    ("toe", _F, "0.55"),
    ("shoulder", _F, "0.26"),
    ("black_clip", _F, "0.0"),
    ("white_clip", _F, "0.04"),
    ("temp", _F, "6500.0"),
    ("tint", _F, "0.0"),
    ("chromatic_aberration_intensity", _F, "0.0"),
    ("chromatic_aberration_offset", _F, "0.0"),
)

_FILM: tuple[_Row, ...] = (
    ("shutter_blur", _B, "false"),
    ("sensor_noise", _B, "false"),
    ("noise_seed", _I, "0"),
)
"""What CARLA's cameras do not have."""

_DVS: tuple[_Row, ...] = (
    ("positive_threshold", _F, "0.3"),
    ("negative_threshold", _F, "0.3"),
    ("sigma_positive_threshold", _F, "0.0"),
    ("sigma_negative_threshold", _F, "0.0"),
    ("refractory_period_ns", _I, "0"),
    ("use_log", _B, "true"),
    ("log_eps", _F, "0.001"),
)

_SEMANTIC_LIDAR: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    ("channels", _I, "32"),
    ("range", _F, "10.0"),
    ("points_per_second", _I, "56000"),
    ("rotation_frequency", _F, "10.0"),
    ("upper_fov", _F, "10.0"),
    ("lower_fov", _F, "-30.0"),
    ("horizontal_fov", _F, "360.0"),
)

_LIDAR: tuple[_Row, ...] = (
    *_SEMANTIC_LIDAR,
    ("atmosphere_attenuation_rate", _F, "0.004"),
    ("dropoff_general_rate", _F, "0.45"),
    ("dropoff_intensity_limit", _F, "0.8"),
    ("dropoff_zero_intensity", _F, "0.4"),
    ("noise_seed", _I, "0"),
    ("noise_stddev", _F, "0.0"),
)

_FLASH: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    ("columns", _I, "128"),
    ("rows", _I, "32"),
    ("horizontal_fov", _F, "60.0"),
    ("vertical_fov", _F, "15.0"),
    ("horizontal_divergence", _F, "0.0"),
    ("vertical_divergence", _F, "0.0"),
    ("samples", _I, "1"),
    ("range", _F, "50.0"),
)

_RADAR: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    ("horizontal_fov", _F, "30.0"),
    ("vertical_fov", _F, "30.0"),
    ("range", _F, "100.0"),
    ("points_per_second", _I, "1500"),
    ("noise_seed", _I, "0"),
)

_OBSTACLE: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    ("distance", _F, "5.0"),
    ("hit_radius", _F, "0.5"),
    ("only_dynamics", _B, "false"),
    ("debug_linetrace", _B, "false"),
)

_IMU: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    ("noise_seed", _I, "0"),
    *((f"noise_accel_stddev_{axis}", _F, "0.0") for axis in "xyz"),
    *((f"noise_gyro_stddev_{axis}", _F, "0.0") for axis in "xyz"),
    *((f"noise_gyro_bias_{axis}", _F, "0.0") for axis in "xyz"),
)

_GNSS: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    ("noise_seed", _I, "0"),
    *(
        (f"noise_{axis}_{kind}", _F, "0.0")
        for axis in ("lat", "lon", "alt")
        for kind in ("stddev", "bias")
    ),
)

_V2X_CUSTOM: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    ("noise_seed", _I, "0"),
    ("transmit_power", _F, "21.5"),
    ("receiver_sensitivity", _F, "-99.0"),
    ("frequency_ghz", _F, "5.9"),
    ("combined_antenna_gain", _F, "10.0"),
    ("scenario", _S, "highway"),
    ("path_loss_model", _S, "winner"),
    ("path_loss_exponent", _F, "2.7"),
    ("d_ref", _F, "1.0"),
    ("filter_distance", _F, "500.0"),
    ("use_etsi_fading", _B, "true"),
    ("custom_fading_stddev", _F, "0.0"),
)

_V2X: tuple[_Row, ...] = (
    *_V2X_CUSTOM,
    ("gen_cam_min", _F, "0.1"),
    ("gen_cam_max", _F, "1.0"),
    ("fixed_rate", _B, "false"),
    *(
        (f"noise_{axis}_{kind}", _F, "0.0")
        for axis in ("lat", "lon", "alt", "head")
        for kind in ("stddev", "bias")
    ),
    *((f"noise_accel_stddev_{axis}", _F, "0.0") for axis in "xyz"),
    ("noise_yawrate_stddev", _F, "0.0"),
    ("noise_yawrate_bias", _F, "0.0"),
    ("noise_vel_stddev_x", _F, "0.0"),
)

_CHOICES: dict[str, tuple[str, ...]] = {
    "scenario": ("highway", "rural", "urban"),
    "path_loss_model": ("winner", "geometric"),
}
"""Attributes that have one of a few words."""

_OCCUPANCY: tuple[_Row, ...] = (
    ("sensor_tick", _F, "0.0"),
    *((side, _F, "40.0") for side in ("ahead", "behind", "left", "right")),
    ("up", _F, "5.4"),
    ("down", _F, "1.0"),
    ("resolution", _F, "0.4"),
)

_SENSORS: dict[str, tuple[_Row, ...]] = {
    "sensor.camera.rgb": _ROLLING + _POST_PROCESS + _FILM,
    "sensor.camera.depth": _ROLLING,
    "sensor.camera.semantic_segmentation": _ROLLING,
    "sensor.camera.instance_segmentation": _ROLLING,
    "sensor.camera.normals": _ROLLING,
    "sensor.camera.optical_flow": _CAMERA,
    "sensor.camera.cosmos_visualization": _CAMERA,
    "sensor.camera.dvs": _CAMERA + _POST_PROCESS + _DVS,
    "sensor.lidar.ray_cast": _LIDAR,
    "sensor.lidar.ray_cast_semantic": _SEMANTIC_LIDAR,
    "sensor.lidar.ray_cast_sweeping": _LIDAR,
    "sensor.lidar.ray_cast_flash": _FLASH,
    "sensor.other.radar": _RADAR,
    "sensor.other.radar_rcs": (*_RADAR, ("fluctuation", _B, "true")),
    "sensor.other.collision": (),
    "sensor.other.lane_invasion": (),
    "sensor.other.obstacle": _OBSTACLE,
    "sensor.other.imu": _IMU,
    "sensor.other.gnss": _GNSS,
    "sensor.other.occupancy": _OCCUPANCY,
    "sensor.other.v2x": _V2X,
    "sensor.other.v2x_custom": _V2X_CUSTOM,
}

_SENT_AS: dict[str, str] = {
    "sensor.lidar.ray_cast_sweeping": "sensor.lidar.ray_cast_semantic",
    "sensor.lidar.ray_cast_flash": "sensor.lidar.ray_cast_semantic",
    "sensor.other.occupancy": "sensor.lidar.ray_cast_semantic",
    "sensor.other.radar_rcs": "sensor.lidar.ray_cast_semantic",
}
"""Sensors that CARLA has not: whose messages theirs are to a client."""


def add_sensor(
    type_id: str, like: str, attributes: Sequence[tuple[str, AttributeType, str]]
) -> None:
    """Add a sensor of a plug-in to the library.

    Args:
        type_id: its blueprint id.
        like: the sensor of CARLA whose attributes it has and whose messages it sends.
        attributes: further ones: name, type, default.

    Raises:
        ValueError: the id is taken or no sensor's, or there is no sensor ``like``.
    """
    if type_id in _SENSORS or not type_id.startswith("sensor."):
        raise ValueError(f"{type_id!r} is taken, or does not begin with 'sensor.'")
    if like not in _SENSORS or like in _SENT_AS:
        raise ValueError(f"{type_id!r} is to be like {like!r}, which is no sensor of CARLA")
    _SENSORS[type_id] = (*_SENSORS[like], *attributes)
    _SENT_AS[type_id] = like


def sent_as(type_id: str) -> str:
    """The sensor of CARLA as which clients read a sensor's messages: mostly itself."""
    return _SENT_AS.get(type_id, type_id)


def _attributes(sensor_id: str, rows: tuple[_Row, ...]) -> tuple[Attribute, ...]:
    attributes = [
        Attribute("role_name", _S, _ROLES[0], _ROLES),
        *(
            Attribute(name, kind, value, _CHOICES.get(name, (value,)), restrict=name in _CHOICES)
            for name, kind, value in rows
        ),
        Attribute("ros_name", _S, sensor_id, (sensor_id,)),
    ]
    if set(_POST_PROCESS) <= set(rows):
        modes = ("histogram", "manual")
        attributes.append(Attribute("exposure_mode", _S, modes[0], modes, restrict=True))
    return tuple(attributes)


def sensor_blueprints() -> list[Blueprint]:
    """The sensors, not yet numbered."""
    return [
        Blueprint(
            uid=0,
            id=sensor_id,
            tags=sensor_id.replace(".", ","),
            attributes=_attributes(sensor_id, rows),
            kind=ActorKind.SENSOR,
            box_center=(0.0, 0.0, 0.0),
            box_extent=(0.0, 0.0, 0.0),
            semantic_tags=(),
        )
        for sensor_id, rows in _SENSORS.items()
    ]
