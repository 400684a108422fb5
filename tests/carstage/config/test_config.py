"""The configuration: its defaults, overrides, presets, template and schema."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from math import isclose
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from carstage.config import (
    RIG_PRESETS,
    SENSOR_KINDS,
    WEATHER_PRESETS,
    Config,
    check_config,
    config_schema,
    config_template,
    dump_config,
    load_demo,
    parse_config,
)
from carstage.config.attributes import attributes_model
from carstage.config.drivers import AutopilotDriver
from carstage.config.timing import MAX_SUBSTEPS, Timing
from carstage.config.traffic import VehicleGroup
from carstage.errors import BadInputError, ConfigError
from carstage.sensor_kinds import kinds
from carstage.sensor_kinds.attributes import COLOUR_CAMERA, LIDAR

_BELOW = {"birds_eye", "occupancy"}
ONE = "rig: {sensors: [{id: A, kind: rgb}, {id: B, kind: %s}]}"


def test_template_parses_to_the_defaults() -> None:
    assert parse_config(config_template()) == Config()


def test_empty_document_is_the_defaults() -> None:
    assert parse_config("") == Config()


def test_defaults_are_those_of_the_contract() -> None:
    config = Config()
    assert (config.name, config.seed, config.episodes) == ("quickstart", 7, 1)
    assert (config.duration_s, config.fps, config.save_every) == (5.0, 10, 1)
    assert (config.vehicles.count, config.pedestrians.count) == (20, 10)
    assert (config.max_distance_m, config.min_lidar_points) == (80.0, 5)
    assert config.image_size == (640, 360)
    assert config.rig.sensors[0].pose.x == 1.5


def test_demo_has_the_rig_that_is_promised() -> None:
    config = load_demo()
    kinds = [sensor.kind for sensor in config.sensors]
    assert kinds == ["rgb", "rgb", "depth", "semantic", "instance", "lidar", "imu", "gnss"]
    assert (config.saved_frames, config.image_size) == (50, (640, 360))
    poses = {sensor.pose for sensor in config.sensors if sensor.row.is_camera}
    assert len(poses) == 2


def test_demo_drives_with_comfort_and_other_configurations_as_carla_does() -> None:
    for config, comfort in (
        (load_demo(), True),
        (Config(), False),
        (parse_config("ego: {spawn: 3}"), False),
    ):
        assert isinstance(config.ego.driver, AutopilotDriver)
        assert config.ego.driver.comfort is comfort


@pytest.mark.parametrize(
    "config",
    [
        Config(),
        load_demo(),
        parse_config("{vehicles: {radius_m: null}, pedestrians: {radius_m: null}}"),
        parse_config("{map: {random_from: [all]}, weather: {random_from: [all]}}"),
    ],
    ids=["default", "demo", "null where null says something", "random"],
)
def test_dumped_configuration_loads_to_the_same(config: Config) -> None:
    assert check_config(dump_config(config)) == config


@pytest.mark.parametrize(
    ("override", "value"),
    [
        ("fps=20", lambda c: c.fps == 20.0),
        ("weather=WetNoon", lambda c: c.weather.choice == "WetNoon"),
        ("weather.lights=on", lambda c: c.weather.lights == "on"),
        ("rig.sensors[0].attributes.fov_deg=60", lambda c: c.sensors[0].attributes.fov_deg == 60),
        ("rig.sensors.1.pose.z=2", lambda c: c.sensors[1].pose.z == 2.0),
        ("rig.sensors[LIDAR_TOP].attributes.range_m=50", lambda c: c.sensors[5].attributes.range_m),
        ("map.choice=Town01", lambda c: c.map.choice == "Town01"),
        ("duration_s=1e1", lambda c: c.duration_s == 10.0),
        ("timing.substepping={max_substeps: 16}", lambda c: c.timing.substepping.max_substeps),
    ],
)
def test_override_sets_one_value(override: str, value: Callable[[Any], Any]) -> None:
    assert value(load_demo([override]))


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("fps", "not key=value"),
        ("=3", "not key=value"),
        ("rig.sensors[9].id=X", "no entry 9"),
        ("rig.sensors[LIDAR].id=X", "LIDAR_TOP"),
        ("fps=-1", "fps: -1"),
        ("fpx=1", "'fps'"),
        ("events[0].kind=x", "events is no list"),
    ],
)
def test_bad_override_is_refused(override: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message.replace("[", r"\[")):
        load_demo([override])


@pytest.mark.parametrize(
    ("short", "override", "choice"),
    [
        ("weather: ClearNight", "weather.lights=on", "ClearNight"),
        ("weather: ClearNight", "weather.parameters.fog_density=40", "ClearNight"),
        ("weather: ClearNight", "weather.choice=WetNoon", "WetNoon"),
        ("weather: ClearNight", "weather.random_from=[WetNoon]", None),
        ("weather: null", "weather.lights=on", "ClearNoon"),
    ],
)
def test_override_keeps_what_a_short_form_said(
    short: str, override: str, choice: str | None
) -> None:
    assert parse_config(short, [override]).weather.choice == choice


@pytest.mark.parametrize(
    ("text", "sensor", "count", "position"),
    [
        ("rig: {preset: nuscenes}", "CAM_FRONT", 14, 0),
        ("rig: {preset: nuscenes}", "0", 14, 0),
        ("rig: {preset: nuscenes, sensors: [{id: EXTRA, kind: rgb}]}", "CAM_FRONT", 15, 0),
        ("rig: {preset: nuscenes, sensors: [{id: EXTRA, kind: rgb}]}", "EXTRA", 15, 14),
        ("rig: {preset: nuscenes, sensors: [{id: EXTRA, kind: rgb}]}", "0", 15, 14),
        ("", "CAM_FRONT", 1, 0),
    ],
)
def test_override_reaches_the_sensors_of_a_preset(
    text: str, sensor: str, count: int, position: int
) -> None:
    plain = parse_config(text).sensors
    found = parse_config(text, [f"rig.sensors[{sensor}].attributes.fov_deg=61"]).sensors
    assert len(found) == len(plain) == count
    assert found[position].attributes.fov_deg == 61.0
    assert [one for one in found if one.id != found[position].id] == [
        one for one in plain if one.id != found[position].id
    ]


def test_override_of_a_sensor_that_a_preset_lacks_names_those_it_has() -> None:
    with pytest.raises(ConfigError, match="CAM_FRONT"):
        parse_config("rig: {preset: nuscenes}", ["rig.sensors[CAM_FRONTAL].attributes.fov_deg=61"])


def test_override_of_a_map_replaces_its_short_form() -> None:
    assert parse_config("map: Town01", ["map.random_from=[Town02]"]).map.random_from == ("Town02",)


def test_words_that_yaml_once_took_for_booleans_stay_words() -> None:
    assert parse_config("weather: {lights: off}").weather.lights == "off"
    assert parse_config("name: yes").name == "yes"


@given(fps=st.floats(1, 240))
def test_automatic_substepping_reaches_the_step(fps: float) -> None:
    longest_s, count = Timing().substeps(fps)
    assert 1 <= count <= MAX_SUBSTEPS
    assert 1.0 / fps <= longest_s * count + 1e-9


def test_automatic_substepping_is_ten_milliseconds_where_that_suffices() -> None:
    assert Timing().substeps(10) == (0.01, 10)
    assert Timing().substeps(20) == (0.01, 10)
    assert Timing().substeps(8) == (0.01, 13)


@given(fps=st.floats(1, 240))
def test_lidar_makes_one_full_sweep_per_step(fps: float) -> None:
    strings = attributes_model(LIDAR)().carla(fps=fps, image_size=(1, 1))
    assert isclose(float(strings["rotation_frequency"]) / fps, 1.0, rel_tol=1e-12)
    rays_per_laser = round(int(strings["points_per_second"]) / fps / 64)
    assert rays_per_laser == 1024


def test_lidar_loses_no_points_by_default() -> None:
    strings = attributes_model(LIDAR)().carla(fps=10, image_size=(1, 1))
    assert strings["range"] == "100.0"
    assert {strings[f"dropoff_{end}"] for end in ("general_rate", "zero_intensity")} == {"0.0"}


def test_camera_takes_the_size_of_the_run_unless_it_has_its_own() -> None:
    own = attributes_model(COLOUR_CAMERA)(image_size=(100, 50)).carla(fps=10, image_size=(640, 360))
    run = attributes_model(COLOUR_CAMERA)().carla(fps=10, image_size=(640, 360))
    assert (own["image_size_x"], own["image_size_y"]) == ("100", "50")
    assert (run["image_size_x"], run["image_size_y"]) == ("640", "360")


def test_carla_names_are_the_same_attributes() -> None:
    friendly = parse_config(ONE % "rgb, attributes: {image_size: [8, 4], fov_deg: 60, iso: 200}")
    native = parse_config(
        ONE % "rgb, attributes: {image_size_x: 8, image_size_y: 4, fov: 60, iso: 200}"
    )
    assert friendly == native


def test_every_form_field_has_title_and_description() -> None:
    schema = config_schema()
    nodes = [schema, *schema["$defs"].values()]
    for node in nodes:
        for name, field in node.get("properties", {}).items():
            reference = field.get("$ref", "").rsplit("/", 1)[-1]
            described = field.get("description") or schema["$defs"].get(reference, {})
            assert described, name
            assert field.get("title") or reference, name


def test_presets_are_those_of_the_client() -> None:
    carla = pytest.importorskip("carla")
    client = {
        name
        for name in dir(carla.WeatherParameters)
        if isinstance(getattr(carla.WeatherParameters, name), carla.WeatherParameters)
    }
    assert set(WEATHER_PRESETS) == client - {"Default"}


def test_a_template_with_every_key_taken_in_is_still_the_defaults() -> None:
    lines = config_template().splitlines()
    commented = [line for line in lines if re.match(r" *#[a-z]| *#  [a-z_]+:", line)]
    assert len(commented) > 40
    taken_in = "\n".join(
        re.sub(r"^( *)#", r"\1", line) if line in commented else line for line in lines
    )
    config = parse_config(taken_in.replace("\nrandom_from: null", ""))
    assert config == Config()


def test_the_template_shows_the_basics_without_a_comment_sign() -> None:
    shown = set(yaml.safe_load(config_template()))
    assert shown >= {"name", "fps", "map", "weather", "vehicles", "ego", "rig", "server"}
    assert not shown & {"timing", "traffic", "conversion"}


@pytest.mark.parametrize("name", RIG_PRESETS)
def test_preset_rigs_are_valid_and_name_their_source(name: str) -> None:
    config = parse_config(f"rig: {{preset: {name}}}")
    assert len(config.sensors) >= {"drone": 2, "junction": 1}.get(name, 4)
    assert RIG_PRESETS[name].source
    assert config.warnings() == []


def test_preset_rigs_have_the_sensors_of_their_models() -> None:
    def count(name: str, kind: str) -> int:
        return sum(sensor.kind == kind for sensor in RIG_PRESETS[name].sensors())

    assert [count("kitti", kind) for kind in ("rgb", "lidar")] == [2, 1]
    assert [count("nuscenes", kind) for kind in ("rgb", "lidar", "radar")] == [6, 1, 5]
    assert [count("waymo", kind) for kind in ("rgb", "lidar")] == [5, 5]
    assert [count("paper", kind) for kind in ("rgb", "lidar", "semantic_lidar")] == [4, 1, 1]
    left, right = (s for s in RIG_PRESETS["kitti"].sensors() if s.kind == "rgb")
    assert right.pose.y - left.pose.y == pytest.approx(0.54)


def test_a_partial_sweep_is_warned_of_with_its_field() -> None:
    config = parse_config(ONE % "lidar, attributes: {rotation_frequency: 5}")
    (warning,) = config.warnings()
    assert warning.startswith("rig.sensors[1].attributes.rotation_frequency_hz: ")
    assert "50%" in warning
    assert parse_config(ONE % "semantic_lidar").warnings() == []


def test_own_rates_and_skipped_steps_are_warned_of_where_they_may_not_meet() -> None:
    """The embedded simulator's sensors measure in the first recorded step; CARLA's may not."""
    text = "save_every: 4\ntiming: {sensor_sync: false}\n" + ONE % "gnss, rate_hz: 5"
    assert parse_config(text).warnings() == []
    (warning,) = parse_config("server: {kind: remote}\n" + text).warnings()
    assert warning.startswith("rig.sensors[1].rate_hz: ")
    every_step = text.replace("save_every: 4", "save_every: 1")
    assert parse_config("server: {kind: remote}\n" + every_step).warnings() == []


def test_a_turned_imu_is_warned_of() -> None:
    (warning,) = parse_config(ONE % "imu, pose: {roll_deg: 90}").warnings()
    assert warning.startswith("rig.sensors[1].pose: ")
    assert parse_config(ONE % "imu, pose: {x: 1, z: 2}").warnings() == []


def test_a_lidar_of_a_rate_of_its_own_makes_one_turn_in_a_measurement() -> None:
    slow = "fps: 20\ntiming: {sensor_sync: false}\n" + ONE % "lidar, rate_hz: 5"
    config = parse_config(slow)
    strings = config.sensors[1].carla(fps=config.fps, image_size=config.image_size)
    assert float(strings["rotation_frequency"]) == 5.0
    assert int(strings["points_per_second"]) == 64 * 1024 * 5
    assert config.warnings() == []
    with pytest.raises(BadInputError, match="at most 5 Hz"):
        parse_config(slow.replace("rate_hz: 5", "rate_hz: 5, attributes: {rotation_frequency: 20}"))


def test_short_scenario_is_the_autopilot() -> None:
    assert parse_config("scenario: {}").scenario.kind == "autopilot"


def test_kinds_have_distinct_blueprints_but_those_made_of_another_ones_data() -> None:
    own = [kind.blueprint for kind in kinds() if not kind.recorded]
    assert len(set(own)) == len(own)
    assert {kind.name for kind in kinds() if kind.recorded} == {
        "flash_lidar", "ray_flash_lidar", "semantic_flash_lidar", "semantic_ray_flash_lidar",
        "sweeping_lidar",
    }  # fmt: skip
    assert len(SENSOR_KINDS) == len(own) + 5


def test_models_of_kinds_that_nobody_asks_for_are_not_made() -> None:
    program = (
        "from carstage.config.loading import parse_config\n"
        "from carstage.config.sensors import CameraSensor, Sensor\n"
        "parse_config('rig: {sensors: [{id: L, kind: lidar}]}')\n"
        "made = [*Sensor.__subclasses__(), *CameraSensor.__subclasses__()]\n"
        "print(*(one.__name__ for one in made if 'kind' in one.__annotations__))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert ended.stdout.split() == ["LidarSensor"]


def test_schema_holds_the_models_of_all_kinds() -> None:
    sensors = config_schema()["$defs"]["Rig"]["properties"]["sensors"]["items"]
    assert set(sensors["discriminator"]["mapping"]) == set(SENSOR_KINDS)
    assert len(sensors["oneOf"]) == len(SENSOR_KINDS)


def test_sensor_that_the_chosen_version_lacks_is_refused_at_its_place() -> None:
    text = (
        'server: {carla_version: "%s"}\n'
        "rig: {sensors: [{id: N, kind: normals, pose: {x: 1.0, z: 2.0}}]}\n"
    )
    with pytest.raises(ConfigError, match=r"rig\.sensors\[0\]\.kind: .*0\.9\.13.*0\.9\.14"):
        parse_config(text % "0.9.13")
    assert parse_config(text % "0.9.14").sensors[0].kind == "normals"


def test_v2x_sensors_need_a_late_server_and_there_a_vehicle() -> None:
    text = (
        "server: {kind: embedded, carla_version: '%s'}\n"
        "rig: {sensors: [{id: V2X, kind: v2x, pose: {z: 2.0}}]}\n"
    )
    assert parse_config(text % "0.9.16").sensors[0].kind == "v2x"
    with pytest.raises(ConfigError, match=r"rig.sensors\[0\].kind: .*0\.9\.16"):
        parse_config(text % "0.9.15")
    real = "server: {kind: remote, host: h, port: 2000}\n"
    light = "{id: V2X, kind: v2x, attach_to: traffic.traffic_light}"
    with pytest.raises(ConfigError, match=r"rig.sensors\[0\].attach_to: .* but a vehicle"):
        parse_config(real + f"rig: {{sensors: [{light}]}}\n")
    rig = "rig: {sensors: [{id: V2X, kind: v2x}]}"
    mast = f"agents: [{{name: m, kind: roadside, pose: {{z: 6}}, {rig}}}]\n"
    with pytest.raises(ConfigError, match=r"agents\[0\].rig.sensors\[0\].kind: .* but a vehicle"):
        parse_config(real + mast)
    assert parse_config(mast).agents[0].name == "m"


def test_the_shortest_interval_of_messages_is_not_above_the_longest() -> None:
    text = "rig: {sensors: [{id: V2X, kind: v2x, attributes: {gen_cam_min_s: 2}}]}\n"
    with pytest.raises(ConfigError, match=r"attributes.gen_cam_min_s: 2 s is above .* 1 s"):
        parse_config(text)


def test_values_by_key_are_those_of_a_flat_section_as_it_is_dumped() -> None:
    config = load_demo(["vehicles.radius_m=null", "labels.birds_eye={}", "labels.occupancy={}"])
    for section in (config.pedestrians, config.traffic, config.ground_truth, config.labels):
        flat = {key: value for key, value in section.by_key().items() if key not in _BELOW}
        assert flat == section.model_dump(exclude=_BELOW)
    assert config.labels.birds_eye is config.labels.by_key()["birds_eye"]
    assert "base_type" not in VehicleGroup(count=1).by_key()
    rest = {"count", "groups"}
    assert config.vehicles.by_key(without=rest) == config.vehicles.model_dump(exclude=rest)


def test_planning_makes_no_serializer_of_a_single_section() -> None:
    """Each takes some milliseconds of every run."""
    program = (
        "from carstage.config import parse_config\n"
        "from carstage.config.labels import GroundTruth, Labels\n"
        "from carstage.config.traffic import Pedestrians, Traffic, Vehicles\n"
        "from carstage.plan import ServerFacts, plan_episodes\n"
        "kinds = (GroundTruth, Labels, Pedestrians, Traffic, Vehicles)\n"
        "made = lambda: [k.__name__ for k in kinds if k.__pydantic_complete__]\n"
        "config = parse_config('labels: {birds_eye: {}}')\n"
        "before = made()\n"
        "assert len(list(plan_episodes(config, ServerFacts(maps={'Stage01': 10})))) == 1\n"
        "print(before == made(), len(before) < len(kinds))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert ended.stdout == "True True\n"
