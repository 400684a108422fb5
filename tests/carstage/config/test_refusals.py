"""The schema refuses what cannot be, names the field first, and says what to do."""

from __future__ import annotations

import pytest

from carstage.config import load_config, parse_config
from carstage.errors import ConfigError

ONE = "rig: {sensors: [{id: A, kind: rgb}, {id: B, kind: %s}]}"

REFUSED = {
    "unknown key": ("fsp: 5", "fsp: ", "Did you mean 'fps'?"),
    "unknown key below": ("timing: {mod: sync}", "timing.mod: ", "Did you mean 'mode'?"),
    "negative fps": ("fps: -5", "fps: -5", "at least 1"),
    "fraction of an episode": ("episodes: 1.5", "episodes: ", "whole number"),
    "number as text": ("seed: '7'", "seed: ", "whole number"),
    "not a number": ("duration_s: .nan", "duration_s: ", "finite"),
    "no step": ("duration_s: 0.01", "duration_s: ", "at least 0.1 s"),
    "number for a section": ("vehicles: 20", "vehicles: ", "key: value"),
    "classes of no sensor": (
        "labels: {method: stage_vo, lidars: all, occupancy: {}}",
        "labels.occupancy: ",
        "Label a camera",
    ),
    "one of several drivers without a camera": (
        "rig: {sensors: [{id: A, kind: imu}]}\n"
        "ego: {driver: {choice: [{kind: autopilot}, {kind: keyboard}]}}",
        "ego.driver",
        "kind rgb",
    ),
    "one of several drivers by the clock": (
        "timing: {mode: async}\nego: {driver: {choice: [{kind: autopilot}, {kind: route}]}}",
        "ego.driver",
        "sync",
    ),
    "agent at the ego's spawn point": (
        "ego: {spawn: 3}\nagents: [{name: car2, spawn: 3, rig: {sensors: [{id: A, kind: rgb}]}}]",
        "agents[0].spawn: ",
        "'ego'",
    ),
    "sensor called as a stream": (
        "rig: {sensors: [{id: world, kind: rgb}]}",
        "rig.sensors[0].id: ",
        "'world_sensor'",
    ),
    "sensor called as a frame": (
        "rig: {sensors: [{id: ego, kind: rgb}]}",
        "rig.sensors[0].id: ",
        "'ego_sensor'",
    ),
    "weather preset": ("weather: ClearMoon", "weather.choice: ", "'ClearNoon'"),
    "one weather preset": (
        "weather: {random_from: [ClearNoon, Sunny]}",
        "weather.random_from[1]: ",
        "Known: ",
    ),
    "two weathers": (
        "weather: {choice: ClearNoon, random_from: [WetNoon]}",
        "weather.random_from: ",
        "Keep one",
    ),
    "weather by few parameters": (
        "weather: {choice: null, parameters: {cloudiness: 3}}",
        "weather.parameters: ",
        "missing parameters",
    ),
    "cloudiness": (
        "weather: {parameters: {cloudiness: 101}}",
        "weather.parameters.cloudiness: ",
        "at most 100",
    ),
    "two maps": ("map: {choice: A, random_from: [B]}", "map.choice: ", "Keep one"),
    "sub-stepping": (
        "timing: {substepping: {max_substep_delta_time_s: 0.01, max_substeps: 9}}",
        "timing.substepping: ",
        "at least 10",
    ),
    "too many sub-steps": (
        "timing: {substepping: {max_substeps: 17}}",
        "timing.substepping.max_substeps: ",
        "at most 16",
    ),
    "spawn": ("ego: {spawn: somewhere}", "ego.spawn: ", "or 'random'"),
    "no sensor": ("rig: {}", "rig.sensors: ", "at least one"),
    "two of one name": (
        "rig: {sensors: [{id: A, kind: rgb}, {id: a, kind: imu}]}",
        "rig.sensors[1].id: ",
        "own id",
    ),
    "preset and one of its names": (
        "rig: {preset: demo, sensors: [{id: IMU, kind: imu}]}",
        "rig.sensors[0].id: ",
        "own id",
    ),
    "kind": (ONE % "deth", "rig.sensors[1].kind: ", "'depth'"),
    "no kind": ("rig: {sensors: [{id: A}]}", "rig.sensors[0].kind: ", "rgb, depth"),
    "no id": ("rig: {sensors: [{kind: rgb}]}", "rig.sensors[0].id: ", "Add it"),
    "reserved id": ("rig: {sensors: [{id: world, kind: imu}]}", "rig.sensors[0].id: ", "world_"),
    "id with a slash": ("rig: {sensors: [{id: a/b, kind: imu}]}", "rig.sensors[0].id: ", "letters"),
    "long id": (
        f"rig: {{sensors: [{{id: {'x' * 23}, kind: imu}}]}}",
        "rig.sensors[0].id: ",
        "at most 22",
    ),
    "id of a twin": ("rig: {sensors: [{id: A.depth, kind: rgb}]}", "rig.sensors[0].id: ", "'_'"),
    "labelled LiDAR": (
        "{rig: {sensors: [{id: L, kind: lidar}]}, labels: {lidars: [M]}}",
        "labels.lidars[0]: ",
        "Known: L",
    ),
    "id of a table": ("rig: {sensors: [{id: A.parquet, kind: rgb}]}", "rig.sensors[0].id: ", "'_'"),
    "attribute": (
        ONE % "rgb, attributes: {fov_dg: 90}",
        "rig.sensors[1].attributes.fov_dg: ",
        "'fov_deg'",
    ),
    "attribute's value": (
        ONE % "rgb, attributes: {fov_deg: 180}",
        "rig.sensors[1].attributes.fov_deg: ",
        "less than 180",
    ),
    "attribute of the run": (
        ONE % "rgb, attributes: {sensor_tick: 0.1}",
        "rig.sensors[1].attributes.sensor_tick: ",
        "save_every",
    ),
    "half an image size": (
        ONE % "rgb, attributes: {image_size_x: 10}",
        "rig.sensors[1].attributes.image_size_x: ",
        "[width, height]",
    ),
    "lidar that overtakes itself": (
        ONE % "lidar, attributes: {rotation_frequency: 20}",
        "rig.sensors[1].attributes.rotation_frequency_hz: ",
        "at most 10 Hz",
    ),
    "lidar upside down": (
        ONE % "lidar, attributes: {upper_fov_deg: -31}",
        "rig.sensors[1].attributes.lower_fov_deg: ",
        "Exchange",
    ),
    "carrier of nobody": (
        ONE % "rgb, attach_to: ego_vehicle",
        "rig.sensors[1].attach_to: ",
        "`world`",
    ),
    "second ego": (ONE % "rgb, attach_index: 1", "rig.sensors[1].attach_index: ", "only one ego"),
    "arm on the map": (
        ONE % "imu, attach_to: world, attachment: follow",
        "rig.sensors[1].attachment: ",
        "Leave attachment out",
    ),
    "labelled on a spring arm": (
        ONE % "rgb, attachment: spring_arm",
        "rig.sensors[1].attachment: ",
        "labels.cameras",
    ),
    "own rate in step": (ONE % "imu, rate_hz: 2", "rig.sensors[1].rate_hz: ", "sensor_sync"),
    "own rate above the world's": (
        "timing: {sensor_sync: false}\n" + ONE % "imu, rate_hz: 20",
        "rig.sensors[1].rate_hz: ",
        "at most 10",
    ),
    "rig preset": ("rig: {preset: kiti}", "rig.preset: ", "'kitti'"),
    "changes backwards": (
        "weather: {changes: [{at_s: 3, choice: WetNoon}, {at_s: 2, choice: ClearNoon}]}",
        "weather.changes[1].at_s: ",
        "order of time",
    ),
    "change of nothing": (
        "weather: {changes: [{at_s: 3}]}",
        "weather.changes[0].choice: ",
        "Give choice",
    ),
    "change to nowhere": (
        "weather: {changes: [{at_s: 3, choice: WetMoon}]}",
        "weather.changes[0].choice: ",
        "'WetNoon'",
    ),
    "map layer": ("map: {layers: [Bildings]}", "map.layers[0]: ", "'Buildings'"),
    "scenario": ("scenario: {kind: replai}", "scenario.kind: ", "'replay'"),
    "route to nowhere": ("scenario: {kind: route}", "scenario.through: ", "Add it"),
    "route by half a place": (
        "scenario: {kind: route, through: [{x: 3}]}",
        "scenario.through[0].y: ",
        "Add it",
    ),
    "replay of nothing": ("scenario: {kind: replay}", "scenario.episode: ", "Add it"),
    "Scenic's map": (
        "scenario: {kind: scenic, file: a.scenic, params: {map: b}}",
        "scenario.params.map: Car-STAGE sets it.",
        "scenario.map",
    ),
    "Scenic by the clock": (
        "scenario: {kind: scenic, file: a.scenic}\ntiming: {mode: async}",
        "scenario.kind: what a file tells needs a world that waits",
        "timing.mode",
    ),
    "a replay by the clock": (
        "scenario: {kind: replay, episode: e}\ntiming: {mode: async}",
        "scenario.kind: what a file tells needs a world that waits",
        "timing.mode",
    ),
    "a log by the clock": (
        "scenario: {kind: log, file: f}\ntiming: {mode: async}",
        "scenario.kind: what a file tells needs a world that waits",
        "timing.mode",
    ),
    "a list for scenario_runner": (
        "scenario: {kind: openscenario, file: a.xosc, scenario_runner: r, params: {a: '1,b:2'}}",
        "scenario.params.a: this cannot be given.",
        "commas",
    ),
    "spread upside down": (
        "traffic: {speed_difference_percent: [20, -10]}",
        "traffic.speed_difference_percent: ",
        "[low, high]",
    ),
    "chance above all": (
        "traffic: {ignore_lights_percent: 101}",
        "traffic.ignore_lights_percent: ",
        "at most 100",
    ),
    "chance in words": (
        "traffic: {ignore_lights_percent: often}",
        "traffic.ignore_lights_percent: ",
        "a number",
    ),
    "group of nobody": ("vehicles: {groups: [{count: 0}]}", "vehicles.groups[0].count: ", "1"),
    "shortfall": ("vehicles: {shortfall: ignore}", "vehicles.shortfall: ", "Known: "),
    "colour": ("ego: {color: [1, 2]}", "ego.color[2]: ", "Add it"),
    "start without a place": ("ego: {spawn: {x: 1}}", "ego.spawn.y: ", "Add it"),
    "camera to label": ("labels: {cameras: [CAM_FRNT]}", "labels.cameras[0]: ", "'CAM_FRONT'"),
    "voxels around nobody": (
        "labels: {occupancy: {frame: CAM_FRNT}}",
        "labels.occupancy.frame: ",
        "'CAM_FRONT'",
    ),
    "voxels without classes": (
        "labels: {occupancy: {}, method: stage_vo}",
        "labels.occupancy: ",
        "labels.lidars",
    ),
    "voxels of distorted pictures": (
        "{labels: {occupancy: {}}, "
        "rig: {sensors: [{id: CAM, kind: rgb, attributes: {lens_k: -0.5}}]}}",
        "labels.occupancy: ",
        "labels.lidars",
    ),
    "exact voxels of CARLA": (
        "{labels: {occupancy: {exact: true}}, server: {kind: carla, path: /carla}}",
        "labels.occupancy.exact: ",
        "kind: embedded",
    ),
    "half a voxel": (
        "labels: {occupancy: {ahead_m: 40.1}}",
        "labels.occupancy.ahead_m: ",
        "whole number of voxels",
    ),
    "too many voxels": (
        "labels: {occupancy: {resolution_m: 0.1}}",
        "labels.occupancy.resolution_m: ",
        "more than 4194304",
    ),
    "codec of nobody": (
        "conversion: {codecs: {CAM_FRNT: png}}",
        "conversion.codecs.CAM_FRNT: ",
        "'CAM_FRONT'",
    ),
    "server kind": ("server: {kind: crla}", "server.kind: ", "'carla'"),
    "carla without a path": ("server: {kind: carla}", "server.path: ", "Add it"),
    "key twice": ("fps: 10\nfps: 20", "config, line 2", "'fps' stands twice"),
    "not YAML": ("a: [", "config, line 1", "Correct"),
    "not a mapping": ("- 1", "config: ", "mapping"),
}


@pytest.mark.parametrize(("text", "path", "help_"), REFUSED.values(), ids=REFUSED.keys())
def test_refusal_begins_with_the_field_and_says_what_to_do(
    text: str, path: str, help_: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config(text)
    assert caught.value.message.startswith(path)
    assert help_ in str(caught.value)
    assert caught.value.hint
    assert "\n" not in str(caught.value)


def test_all_problems_are_told_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config("fps: 0\nepisodes: 0\nrig: {sensors: [{id: A, kind: rbg}]}")
    assert [line.split(":")[0] for line in str(caught.value).splitlines()] == [
        "episodes",
        "fps",
        "rig.sensors[0].kind",
    ]


def test_missing_file_is_a_sentence() -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.yaml cannot be read: No such file"):
        load_config("nowhere.yaml")
