"""Attributes of the kinds: friendly names with units, and the strings that CARLA wants.

What is not set stays at the server's own default, with two exceptions. Cameras always get size and
field of view. Sensors that measure distances by rays get all: CARLA's own LiDAR defaults (10 m,
10 Hz, 45 % of the points dropped) give half sweeps and thinned clouds.
Source of names and defaults: CARLA's sensor reference, 0.9.16.
"""

from __future__ import annotations

from typing import Tuple

from carstage.sensor_kinds.model import Attribute, AttributeSet

RAYS_PER_CHANNEL = 1024
"""Rays of one LiDAR channel per sweep when points_per_second is ``auto``."""

_Rows = Tuple[Attribute, ...]

# fmt: off
_CAMERA: _Rows = (
    Attribute("image_size", "size", None, "Image size",
        "Width and height; left out, the run's `image_size`.", None, unit="px"),
    Attribute("fov_deg", "float", 90.0, "Field of view", "Horizontal field of view.", "fov",
        unit="deg", gt=0, lt=180),
    Attribute("lens_circle_falloff", "float", None, "Lens circle fall-off",
        "How fast the lens darkens to the edge.", "lens_circle_falloff", ge=0),
    Attribute("lens_circle_multiplier", "float", None, "Lens circle multiplier",
        "How strongly the lens darkens.", "lens_circle_multiplier", ge=0),
    Attribute("lens_k", "float", None, "Lens k", "Distortion.", "lens_k"),
    Attribute("lens_kcube", "float", None, "Lens k cube", "Cubic distortion.", "lens_kcube"),
    Attribute("lens_x_size", "float", None, "Lens x size", "Distortion along x.", "lens_x_size"),
    Attribute("lens_y_size", "float", None, "Lens y size", "Distortion along y.", "lens_y_size"),
)

_ROLLING: _Rows = (
    *_CAMERA,
    Attribute("rolling_shutter_s", "float", None, "Rolling shutter",
        "Time from the first row's exposure to the last's; embedded simulator only.",
        "rolling_shutter_s", unit="s", ge=0, le=0.1, embedded_only=True),
)

_COLOUR: _Rows = (
    Attribute("enable_postprocess_effects", "bool", None, "Post-processing",
        "Bloom, exposure, motion blur and the rest.", "enable_postprocess_effects"),
    Attribute("exposure_mode", "word", None, "Exposure mode", "Automatic by histogram, or manual.",
        "exposure_mode", words=("histogram", "manual")),
    Attribute("gamma", "float", None, "Gamma", "Target gamma.", "gamma", gt=0),
    Attribute("shutter_speed_hz", "float", None, "Shutter speed",
        "Reciprocal of the exposure time.", "shutter_speed", unit="1/s", gt=0),
    Attribute("iso", "float", None, "ISO", "Sensitivity.", "iso", gt=0),
    Attribute("fstop", "float", None, "F-stop", "Opening of the lens.", "fstop", gt=0),
    Attribute("min_fstop", "float", None, "Smallest f-stop", "Largest opening.", "min_fstop", gt=0),
    Attribute("blade_count", "int", None, "Blades", "Blades of the diaphragm.", "blade_count",
        ge=0),
    Attribute("exposure_compensation", "float", None, "Exposure compensation",
        "Brighter or darker.", "exposure_compensation", unit="EV", ge=-30, le=30),
    Attribute("exposure_min_bright", "float", None, "Lowest brightness",
        "Bound of automatic exposure.", "exposure_min_bright"),
    Attribute("exposure_max_bright", "float", None, "Highest brightness",
        "Bound of automatic exposure.", "exposure_max_bright"),
    Attribute("exposure_speed_up", "float", None, "Exposure speed up",
        "Speed of adaptation from dark to bright.", "exposure_speed_up", unit="EV/s"),
    Attribute("exposure_speed_down", "float", None, "Exposure speed down",
        "Speed of adaptation from bright to dark.", "exposure_speed_down", unit="EV/s"),
    Attribute("calibration_constant", "float", None, "Calibration constant",
        "Grey that exposure aims at.", "calibration_constant"),
    Attribute("focal_distance_cm", "float", None, "Focal distance", "Where the image is sharp.",
        "focal_distance", unit="cm", ge=0),
    Attribute("blur_amount", "float", None, "Blur amount", "Strength of defocus.", "blur_amount"),
    Attribute("blur_radius", "float", None, "Blur radius", "Radius of defocus.", "blur_radius"),
    Attribute("motion_blur_intensity", "float", None, "Motion blur", "Strength of motion blur.",
        "motion_blur_intensity", ge=0, le=1),
    Attribute("motion_blur_max_distortion", "float", None, "Motion blur limit",
        "Longest smear, share of the width.", "motion_blur_max_distortion"),
    Attribute("motion_blur_min_object_screen_size", "float", None, "Motion blur threshold",
        "Share of the screen below which nothing smears.", "motion_blur_min_object_screen_size"),
    Attribute("lens_flare_intensity", "float", None, "Lens flare", "Strength of lens flares.",
        "lens_flare_intensity", ge=0),
    Attribute("bloom_intensity", "float", None, "Bloom", "Strength of bloom.", "bloom_intensity"),
    Attribute("slope", "float", None, "Slope", "Steepness of the tone curve.", "slope"),
    Attribute("toe", "float", None, "Toe", "Dark end of the tone curve.", "toe"),
    Attribute("shoulder", "float", None, "Shoulder", "Bright end of the tone curve.", "shoulder"),
    Attribute("black_clip", "float", None, "Black clip", "Where black is cut.", "black_clip"),
    Attribute("white_clip", "float", None, "White clip", "Where white is cut.", "white_clip"),
    Attribute("temp_k", "float", None, "Temperature", "White balance.", "temp", unit="K", gt=0),
    Attribute("tint", "float", None, "Tint", "White balance, green to magenta.", "tint"),
    Attribute("chromatic_aberration_intensity", "float", None, "Chromatic aberration",
        "Strength of colour fringes.", "chromatic_aberration_intensity"),
    Attribute("chromatic_aberration_offset", "float", None, "Chromatic aberration offset",
        "Where fringes start.", "chromatic_aberration_offset"),
    Attribute("shutter_blur", "bool", None, "Shutter blur",
        "What moves is blurred over the exposure time, 1 / shutter_speed_hz; the embedded "
        "simulator alone has it.", "shutter_blur", embedded_only=True),
    Attribute("sensor_noise", "bool", None, "Sensor noise",
        "Shot and read noise by the sensitivity of the exposure; the embedded simulator alone has "
        "it.", "sensor_noise", embedded_only=True),
)

_SWEEP: _Rows = (
    Attribute("channels", "int", 64, "Channels", "Number of lasers.", "channels", ge=1, le=512),
    Attribute("range_m", "float", 100.0, "Range", "Longest distance.", "range", unit="m", gt=0,
        le=1000),
    Attribute("points_per_second", "int or auto", "auto", "Points per second",
        "Rays of all lasers; `auto`: %d per laser and sweep." % RAYS_PER_CHANNEL,
        "points_per_second", unit="1/s", ge=1),
    Attribute("rotation_frequency_hz", "float or auto", "auto", "Rotation frequency",
        "Turns per second; `auto`: `rate_hz`, else the frame rate, so that each sweep is one turn.",
        "rotation_frequency", unit="Hz", gt=0),
    Attribute("upper_fov_deg", "float", 10.0, "Upper field of view", "Highest laser.", "upper_fov",
        unit="deg", ge=-90, le=90),
    Attribute("lower_fov_deg", "float", -30.0, "Lower field of view", "Lowest laser.", "lower_fov",
        unit="deg", ge=-90, le=90),
    Attribute("horizontal_fov_deg", "float", 360.0, "Horizontal field of view", "Width of a sweep.",
        "horizontal_fov", unit="deg", gt=0, le=360),
)

_LIDAR: _Rows = (
    Attribute("atmosphere_attenuation_rate", "float", 0.004, "Attenuation",
        "Intensity is exp(-rate x distance).", "atmosphere_attenuation_rate", unit="1/m", ge=0),
    Attribute("dropoff_general_rate", "float", 0.0, "General drop-off",
        "Share of points lost at random.", "dropoff_general_rate", ge=0, le=1),
    Attribute("dropoff_intensity_limit", "float", 0.0, "Drop-off limit",
        "Intensity above which no point is lost.", "dropoff_intensity_limit", ge=0, le=1),
    Attribute("dropoff_zero_intensity", "float", 0.0, "Drop-off at zero",
        "Share of points lost at intensity 0.", "dropoff_zero_intensity", ge=0, le=1),
    Attribute("noise_stddev_m", "float", 0.0, "Noise", "Standard deviation along the ray.",
        "noise_stddev", unit="m", ge=0),
)

_FLASH: _Rows = (
    Attribute("columns", "int", 128, "Columns", "Beams side by side.", None, ge=1, le=1024),
    Attribute("rows", "int", 32, "Rows", "Beams one above the other.", None, ge=1, le=1024),
    Attribute("horizontal_fov_deg", "float", 60.0, "Horizontal field of view",
        "Columns lie in the middles of equal parts of it.", None, unit="deg", gt=0, le=360),
    Attribute("vertical_fov_deg", "float", 15.0, "Vertical field of view",
        "Rows lie in the middles of equal parts of it.", None, unit="deg", gt=0, le=180),
    Attribute("min_range_m", "float", 0.0, "Nearest range", "Nothing nearer is measured.", None,
        unit="m", ge=0),
    Attribute("range_m", "float", 100.0, "Range", "Longest distance.", None, unit="m", gt=0,
        le=990),
    Attribute("horizontal_divergence_deg", "float or auto", "auto", "Horizontal divergence",
        "Full angle of a beam; 0: a line; `auto`: up to the next column.", None, unit="deg", ge=0,
        le=10),
    Attribute("vertical_divergence_deg", "float or auto", "auto", "Vertical divergence",
        "Full angle of a beam; 0: a line; `auto`: up to the next row.", None, unit="deg", ge=0,
        le=10),
    Attribute("samples", "int", 3, "Samples",
        "Depths to either side of a beam's footprint; 3: nine in all.", None, ge=1, le=9),
    Attribute("oversampling", "float or auto", "auto", "Oversampling",
        "Recorded pixels per sample, straight ahead; `auto`: 4 for lines, 2 for footprints.", None,
        ge=0.5, le=8),
    Attribute("returns", "word", "strongest", "Returns",
        "Which echoes of a beam become points; `dual`: the strongest and the last.", None,
        words=("first", "strongest", "last", "dual", "all")),
    Attribute("echo_separation_m", "float", 0.6, "Echo separation",
        "Gap between two surfaces from which on they are two echoes.", None, unit="m", ge=0),
    Attribute("reflectivity", "float", 0.5, "Reflectivity", "Of every surface.", None, gt=0, le=1),
    Attribute("range_reflectivity", "float", 0.0, "Reflectivity at the range",
        "Of the darkest surface that is seen at range_m, square on; 0: no echo is too weak.", None,
        ge=0, le=1),
    Attribute("attenuation_per_m", "float", 0.0, "Attenuation", "Of the air, one way.", None,
        unit="1/m", ge=0, le=0.1),
    Attribute("full_scale_range_m", "float", 10.0, "Full scale",
        "Where a white surface, square on, has intensity 1; 0: intensities do not fall with the "
        "square of the range.", None, unit="m", ge=0, le=1000),
    Attribute("noise_stddev_m", "float", 0.0, "Noise", "Standard deviation along the beam.", None,
        unit="m", ge=0),
    Attribute("ambient_noise", "float", 0.0, "Ambient noise",
        "Standard deviation of background light, as a share of the weakest signal.", None, ge=0,
        le=1),
    Attribute("false_return_rate", "float", 0.0, "False returns",
        "Share of the beams with an echo of background light.", None, ge=0, le=1),
    Attribute("dropoff_rate", "float", 0.0, "Drop-off", "Share of echoes lost at random.", None,
        ge=0, le=1),
)

_RADAR: _Rows = (
    Attribute("horizontal_fov_deg", "float", 30.0, "Horizontal field of view", "Width of the cone.",
        "horizontal_fov", unit="deg", gt=0, lt=180),
    Attribute("vertical_fov_deg", "float", 30.0, "Vertical field of view", "Height of the cone.",
        "vertical_fov", unit="deg", gt=0, lt=180),
    Attribute("range_m", "float", 100.0, "Range", "Longest distance.", "range", unit="m", gt=0,
        le=1000),
    Attribute("points_per_second", "int", 1500, "Rays per second",
        "Rays cast; those that hit something are returned.", "points_per_second", unit="1/s", ge=1,
        le=10000000),
)

_RCS_RADAR: _Rows = (
    *_RADAR,
    Attribute("fluctuation", "bool", True, "Fluctuation",
        "Whether cross sections of vehicles and people change from tick to tick.", "fluctuation"),
)

_IMU: _Rows = (
    Attribute("noise_accel_stddev_x", "float", None, "x", "Noise that is added; none by default.",
        "noise_accel_stddev_x", unit="m/s²", ge=0),
    Attribute("noise_accel_stddev_y", "float", None, "y", "Noise that is added; none by default.",
        "noise_accel_stddev_y", unit="m/s²", ge=0),
    Attribute("noise_accel_stddev_z", "float", None, "z", "Noise that is added; none by default.",
        "noise_accel_stddev_z", unit="m/s²", ge=0),
    Attribute("noise_gyro_stddev_x", "float", None, "x", "Noise that is added; none by default.",
        "noise_gyro_stddev_x", unit="rad/s", ge=0),
    Attribute("noise_gyro_stddev_y", "float", None, "y", "Noise that is added; none by default.",
        "noise_gyro_stddev_y", unit="rad/s", ge=0),
    Attribute("noise_gyro_stddev_z", "float", None, "z", "Noise that is added; none by default.",
        "noise_gyro_stddev_z", unit="rad/s", ge=0),
    Attribute("noise_gyro_bias_x", "float", None, "x", "Noise that is added; none by default.",
        "noise_gyro_bias_x", unit="rad/s"),
    Attribute("noise_gyro_bias_y", "float", None, "y", "Noise that is added; none by default.",
        "noise_gyro_bias_y", unit="rad/s"),
    Attribute("noise_gyro_bias_z", "float", None, "z", "Noise that is added; none by default.",
        "noise_gyro_bias_z", unit="rad/s"),
)

_GNSS: _Rows = (
    Attribute("noise_lat_stddev", "float", None, "Latitude",
        "Noise that is added; none by default.", "noise_lat_stddev", unit="deg", ge=0),
    Attribute("noise_lon_stddev", "float", None, "Longitude",
        "Noise that is added; none by default.", "noise_lon_stddev", unit="deg", ge=0),
    Attribute("noise_alt_stddev", "float", None, "Altitude",
        "Noise that is added; none by default.", "noise_alt_stddev", unit="m", ge=0),
    Attribute("noise_lat_bias", "float", None, "Latitude bias",
        "Noise that is added; none by default.", "noise_lat_bias", unit="deg"),
    Attribute("noise_lon_bias", "float", None, "Longitude bias",
        "Noise that is added; none by default.", "noise_lon_bias", unit="deg"),
    Attribute("noise_alt_bias", "float", None, "Altitude bias",
        "Noise that is added; none by default.", "noise_alt_bias", unit="m"),
)

_V2X: _Rows = (
    Attribute("transmit_power_dbm", "float", None, "Transmit power", "What it sends with.",
        "transmit_power", unit="dBm"),
    Attribute("receiver_sensitivity_dbm", "float", None, "Sensitivity",
        "Weaker messages are not received.", "receiver_sensitivity", unit="dBm"),
    Attribute("frequency_ghz", "float", None, "Frequency", "Of the carrier.", "frequency_ghz",
        unit="GHz", gt=0),
    Attribute("combined_antenna_gain_dbi", "float", None, "Antenna gain",
        "Of sender and receiver together.", "combined_antenna_gain", unit="dBi"),
    Attribute("scenario", "word", None, "Scenario", "Surroundings that the path loss is of.",
        "scenario", words=("highway", "rural", "urban")),
    Attribute("path_loss_model", "word", None, "Path loss model",
        "WINNER+, or two rays and diffraction.", "path_loss_model", words=("winner", "geometric")),
    Attribute("path_loss_exponent", "float", None, "Path loss exponent",
        "Of the geometric model behind buildings.", "path_loss_exponent", gt=0),
    Attribute("reference_distance_m", "float", None, "Reference distance",
        "Of the geometric model behind buildings.", "d_ref", unit="m", gt=0),
    Attribute("filter_distance_m", "float", None, "Filter distance",
        "Nothing from farther away is received.", "filter_distance", unit="m", ge=0),
    Attribute("use_etsi_fading", "bool", None, "ETSI fading",
        "Shadow fading as the standard has it.", "use_etsi_fading"),
    Attribute("custom_fading_stddev_db", "float", None, "Fading",
        "Standard deviation of the fading without use_etsi_fading.", "custom_fading_stddev",
        unit="dB", ge=0),
    Attribute("gen_cam_min_s", "float", None, "Shortest interval",
        "Between two messages that it sends.", "gen_cam_min", unit="s", gt=0),
    Attribute("gen_cam_max_s", "float", None, "Longest interval",
        "Between two messages that it sends.", "gen_cam_max", unit="s", gt=0),
    Attribute("fixed_rate", "bool", None, "Fixed rate",
        "It sends at the shortest interval, whatever changes.", "fixed_rate"),
    Attribute("noise_lat_stddev", "float", None, "Latitude",
        "Noise of what it sends; none by default.", "noise_lat_stddev", unit="deg", ge=0),
    Attribute("noise_lon_stddev", "float", None, "Longitude",
        "Noise of what it sends; none by default.", "noise_lon_stddev", unit="deg", ge=0),
    Attribute("noise_alt_stddev", "float", None, "Altitude",
        "Noise of what it sends; none by default.", "noise_alt_stddev", unit="m", ge=0),
    Attribute("noise_head_stddev", "float", None, "Heading",
        "Noise of what it sends; none by default.", "noise_head_stddev", unit="deg", ge=0),
    Attribute("noise_vel_stddev", "float", None, "Speed",
        "Noise of what it sends; none by default.", "noise_vel_stddev_x", unit="m/s", ge=0),
    Attribute("noise_yawrate_stddev", "float", None, "Yaw rate",
        "Noise of what it sends; none by default.", "noise_yawrate_stddev", unit="rad/s", ge=0),
)

# fmt: on

CAMERA = AttributeSet(
    "CameraAttributes",
    "Attributes of every camera; two cameras with equal ones and one pose see the same pixels.",
    _ROLLING,
    shape="camera",
)
FLOW_CAMERA = AttributeSet(
    "FlowAttributes",
    "Those of every camera but a rolling shutter: motion is that between two moments.",
    _CAMERA,
    shape="camera",
)
COLOUR_CAMERA = AttributeSet(
    "RgbAttributes",
    "A colour camera's: geometry, exposure and the effects of CARLA's post-processing.",
    _ROLLING + _COLOUR,
    shape="camera",
)
LIDAR = AttributeSet(
    "LidarAttributes",
    "A ray-cast LiDAR's. The defaults lose no points.",
    _SWEEP + _LIDAR,
    shape="sweep",
)
SEMANTIC_LIDAR = AttributeSet(
    "SemanticLidarAttributes",
    "A semantic LiDAR's; CARLA gives it neither noise nor drop-off.",
    _SWEEP,
    shape="sweep",
)
FLASH_LIDAR = AttributeSet(
    "FlashLidarAttributes",
    "A flash LiDAR's. The defaults lose nothing; what each does to the points stands in "
    "[flash LiDARs](formats/flash-lidar.md).",
    _FLASH,
    shape="flash",
)
RADAR = AttributeSet(
    "RadarAttributes",
    "A radar's: its cone, and how many rays it casts at random into it.",
    _RADAR,
)
RCS_RADAR = AttributeSet(
    "RcsRadarAttributes",
    "Those of a radar, and whether its radar cross sections fluctuate.",
    _RCS_RADAR,
)
RAY_FLASH_LIDAR = AttributeSet(
    "RayFlashLidarAttributes",
    "Those of a flash LiDAR that is made of pictures; rays need no `oversampling`.",
    tuple(row for row in _FLASH if row.name != "oversampling"),
    shape="flash rays",
)
IMU = AttributeSet("ImuAttributes", "An inertial measurement unit's: its noise.", _IMU)
GNSS = AttributeSet("GnssAttributes", "A satellite receiver's: its noise.", _GNSS)
V2X = AttributeSet(
    "V2xAttributes",
    "A V2X station's: radio, how often it sends, the noise of what it says of itself.",
    _V2X,
)
