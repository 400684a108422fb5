"""Planning: the same configuration gives the same episodes; labelled cameras get their twins."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import astuple, fields, replace
from typing import get_args

import numpy as np
import pytest

from carstage.config import Config, load_demo, parse_config
from carstage.config.labels import DEFAULT_LEVEL_OBJECTS, Labels
from carstage.config.weather import WEATHER_PRESETS
from carstage.errors import ConfigError
from carstage.plan import Recording, ServerFacts, Track, estimate_run, plan_episodes
from carstage.spec import EpisodeSpec, GroundTruthSpec, LabelsSpec, RouteSpec, Seeds
from carstage.spec.defaults import MAX_DISTANCE_M, MIN_LIDAR_POINTS

CAMERA = {"role_name", "image_size_x", "image_size_y", "fov", "iso"}
FACTS = ServerFacts(
    maps={"Stage01": 100, "Town02": 7},
    blueprints={
        "vehicle.tesla.model3": {"color": "0,0,0", "base_type": "car", "generation": "1"},
        "vehicle.ford.ambulance": {"base_type": "van", "generation": "2"},
        "walker.pedestrian.0001": {"generation": "1"},
        "sensor.camera.rgb": dict.fromkeys(CAMERA, ""),
        "sensor.other.imu": {},
    },
    limits={"image_size_x": 4096, "image_size_y": 4096, "pixels": 1e7, "channels": 64},
)
MAPS_ONLY = ServerFacts(maps=FACTS.maps)


def plan(text: str = "", facts: ServerFacts = MAPS_ONLY) -> tuple[EpisodeSpec, ...]:
    return tuple(plan_episodes(parse_config(text), facts))


def sensors(text: str) -> dict[str, object]:
    return {sensor.id: sensor for sensor in plan(text)[0].sensors}


def test_same_configuration_gives_the_same_episodes() -> None:
    assert plan("episodes: 3") == plan("episodes: 3")


def test_more_episodes_do_not_change_the_first_ones() -> None:
    assert plan("episodes: 5")[:2] == plan("episodes: 2")


def test_episodes_differ_from_each_other_and_from_another_seed() -> None:
    ids = [spec.episode_id for spec in plan("episodes: 20") + plan("{episodes: 20, seed: 8}")]
    assert len(set(ids)) == 40


def test_spawn_points_that_nobody_counted_are_not_refused() -> None:
    town = ServerFacts(maps={"Town05": 50, "Town01": 50}, spawn_points={"Town01": 255})
    through = "scenario: {kind: route, through: [120]}"
    for name in ("Town05", "Town01"):
        (spec,) = plan(f"{{map: {name}, ego: {{spawn: 120}}, {through}}}", town)
        assert spec.ego.spawn_index == 120
    with pytest.raises(ConfigError, match=r"ego\.spawn: Town01 has no spawn point 255"):
        plan("{map: Town01, ego: {spawn: 255}}", town)


def test_id_is_the_hash_of_the_canonical_json() -> None:
    spec = plan()[0]
    document = json.loads(spec.canonical_json())
    assert document == spec.to_json()
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    assert spec.episode_id == hashlib.sha256(text.encode()).hexdigest()[:16]


def test_demo_id_is_fixed_by_the_format() -> None:
    as_it_was = (
        "vehicles={count: 20}",
        "pedestrians={count: 10}",
        "ego={blueprint: vehicle.tesla.model3}",
    )
    spec = plan_episodes(load_demo(as_it_was), ServerFacts(maps={"Stage01": 100}))[0]
    assert spec.episode_id == "feff8a4135eb4b88", "this breaks the resuming of older datasets"


@pytest.mark.parametrize(
    "text",
    [
        "name: other",
        "conversion: {mode: deferred, workers: 1}",
        "output: {keep_raw: true}",
        "server: {kind: embedded, port: 4000, threads: 1}",
        "rig: {sensors: [{id: CAM_FRONT, kind: rgb, pose: {x: 1.5, y: -0.0, z: 1.6}}]}",
    ],
)
def test_what_changes_no_truth_changes_no_id(text: str) -> None:
    assert plan(text)[0].episode_id == plan()[0].episode_id


@pytest.mark.parametrize(
    "text",
    [
        "fps: 20",
        "duration_s: 4",
        "save_every: 2",
        "weather: WetNoon",
        "vehicles: {count: 21}",
        "labels: {method: stage_vo}",
        "min_lidar_points: 0",
        "ground_truth: {ego_motion: false}",
        "rig: {sensors: [{id: CAM_FRONT, kind: rgb, pose: {x: 1.5, z: 1.7}}]}",
    ],
)
def test_what_changes_truth_or_labels_changes_the_id(text: str) -> None:
    assert plan(text)[0].episode_id != plan()[0].episode_id


@pytest.mark.parametrize("substep_s", ["0.033333333", "0.0333333333", "0.04"])
def test_substeps_that_a_configuration_may_have_are_read_again(substep_s: str) -> None:
    substepping = f"{{max_substep_delta_time_s: {substep_s}, max_substeps: 1}}"
    (spec,) = plan(f"fps: 30\ntiming: {{substepping: {substepping}}}")
    assert EpisodeSpec.from_json(spec.to_json()) == spec


def test_every_consumer_has_its_own_seed() -> None:
    seeds = [spec.seeds for spec in plan("episodes: 10")]
    assert len({value for seed in seeds for value in astuple(seed)}) == 10 * len(fields(Seeds))


def test_random_choices_are_drawn_per_episode_from_what_is_allowed() -> None:
    specs = plan("{episodes: 40, map: {random_from: [all]}, weather: {random_from: [all]}}")
    assert {spec.map for spec in specs} == {"Stage01", "Town02"}
    assert len({spec.weather.preset for spec in specs}) > 10
    assert all(spec.ego.spawn_index < FACTS.maps[spec.map] for spec in specs)


def test_fixing_one_choice_moves_no_other() -> None:
    free = plan("{map: {random_from: [Stage01]}, weather: {random_from: [all]}}")[0]
    fixed = plan("{map: Stage01, weather: {random_from: [all]}}")[0]
    assert free == fixed


def test_explicit_weather_has_no_preset() -> None:
    names = "cloudiness precipitation precipitation_deposits wind_intensity sun_azimuth_angle "
    names += "sun_altitude_angle fog_density fog_distance fog_falloff wetness "
    names += "scattering_intensity mie_scattering_scale rayleigh_scattering_scale dust_storm"
    values = ", ".join(f"{name}: 1" for name in names.split())
    weather = plan(f"weather: {{parameters: {{{values}}}}}")[0].weather
    assert weather.preset is None
    assert weather.parameters == dict.fromkeys(names.split(), 1.0)


def test_labelled_camera_gets_hidden_twins_of_its_pose_and_intrinsics() -> None:
    planned = sensors("rig: {sensors: [{id: C, kind: rgb, pose: {y: 1}, attributes: {iso: 50}}]}")
    assert list(planned) == ["C", "C.depth", "C.instance"]
    camera, depth = planned["C"], planned["C.depth"]
    assert (camera.depth, camera.instance) == ("C.depth", "C.instance")
    assert depth.hidden
    assert depth.pose == camera.pose
    assert depth.attributes == {"image_size_x": "640", "image_size_y": "360", "fov": "90.0"}


@pytest.mark.parametrize("kind", ["lidar", "imu"])
def test_only_cameras_are_labelled_where_agents_use_an_id_again(kind: str) -> None:
    (spec,) = plan(
        f"""
        labels: {{cameras: [TOP]}}
        rig: {{sensors: [{{id: TOP, kind: rgb}}]}}
        agents: [{{name: one, kind: vehicle, rig: {{sensors: [{{id: TOP, kind: {kind}}}]}}}}]
        """
    )
    assert [sensor.labelled for sensor in spec.sensors if not sensor.hidden] == [True]
    assert not any(sensor.labelled for sensor in spec.seen_by("one").sensors)


def test_twins_of_a_rolling_shutter_roll_alike() -> None:
    rolling = "attributes: {rolling_shutter_s: 0.02}"
    planned = sensors(
        f"rig: {{sensors: [{{id: D, kind: depth}}, {{id: C, kind: rgb, {rolling}}}, "
        f"{{id: I, kind: instance, {rolling}}}]}}"
    )
    assert (planned["C"].depth, planned["C"].instance) == ("C.depth", "I")
    assert planned["C.depth"].attributes["rolling_shutter_s"] == "0.02"


def test_requested_sensor_of_the_same_view_serves_instead_of_a_twin() -> None:
    planned = sensors(
        "rig: {sensors: [{id: D, kind: depth}, {id: C, kind: rgb}, "
        "{id: I, kind: instance, attributes: {fov_deg: 60}}]}"
    )
    assert list(planned) == ["D", "C", "I", "C.instance"]
    assert (planned["C"].depth, planned["C"].instance) == ("D", "C.instance")


def test_cameras_of_one_view_share_the_twins() -> None:
    planned = sensors("rig: {sensors: [{id: A, kind: rgb}, {id: B, kind: rgb}]}")
    assert list(planned) == ["A", "B", "A.depth", "A.instance"]
    assert planned["B"].depth == "A.depth"


def test_labelled_lidar_gets_a_twin_that_scans_alike_and_is_recorded() -> None:
    lidar = "{id: L, kind: lidar, pose: {z: 2}, attributes: {channels: 16, noise_stddev_m: 0.1}}"
    planned = sensors(f"{{rig: {{sensors: [{lidar}]}}, labels: {{lidars: all}}}}")
    assert list(planned) == ["L", "L.semantic"]
    twin = planned["L.semantic"]
    assert (twin.blueprint, twin.hidden) == ("sensor.lidar.ray_cast_semantic", False)
    assert twin.pose == planned["L"].pose
    assert twin.attributes == {
        name: text
        for name, text in planned["L"].attributes.items()
        if not name.startswith(("noise", "dropoff", "atmosphere"))
    }


def test_semantic_lidar_of_the_rig_serves_instead_of_a_twin() -> None:
    pair = "{id: L, kind: lidar}, {id: S, kind: semantic_lidar}"
    assert list(sensors(f"{{rig: {{sensors: [{pair}]}}, labels: {{lidars: [L]}}}}")) == ["L", "S"]


def test_stage_vo_needs_depth_only() -> None:
    assert list(sensors("labels: {method: stage_vo}")) == ["CAM_FRONT", "CAM_FRONT.depth"]


def test_cameras_without_labels_get_no_twins() -> None:
    assert list(sensors("labels: {cameras: []}")) == ["CAM_FRONT"]


@pytest.mark.parametrize(
    ("text", "start", "hint"),
    [
        ("map: Stage1", "map.choice: unknown map 'Stage1'", "'Stage01'"),
        ("map: {random_from: [Town02, Town3]}", "map.random_from[1]: ", "'Town02'"),
        ("ego: {spawn: 100}", "ego.spawn: ", "counted from 0"),
        ("ego: {blueprint: vehicle.tesla.model_3}", "ego.blueprint: ", "'vehicle.tesla.model3'"),
        ("vehicles: {filter: vehicle.audi.*}", "vehicles.filter: ", "vehicle"),
        ("vehicles: {filter: sensor.*}", "vehicles.filter: ", "vehicle"),
        ("pedestrians: {filter: vehicle.*}", "pedestrians.filter: ", "walker"),
        (
            "vehicles: {groups: [{count: 1, base_type: vans}]}",
            "vehicles.groups[0].base_type: unknown base type 'vans'",
            "'van'",
        ),
        (
            "vehicles: {groups: [{count: 1, base_type: van, generation: '1'}]}",
            "vehicles.groups[0].generation: ",
            "2",
        ),
        ("pedestrians: {generation: '3'}", "pedestrians.generation: ", "1"),
        (
            "image_size: [5000, 4000]",
            "image_size: image_size_x of 5000",
            "at most 4096",
        ),
        (
            "image_size: [4000, 3000]",
            "image_size: pixels of 12000000",
            "at most 10000000",
        ),
        ("rig: {sensors: [{id: L, kind: lidar}]}", "rig.sensors[0].kind: ", "another server"),
        (
            "rig: {sensors: [{id: L, kind: rgb, attributes: {gamma: 2}}]}",
            "rig.sensors[0].attributes.gamma: ",
            "Known",
        ),
    ],
)
def test_what_the_server_does_not_have_is_refused(text: str, start: str, hint: str) -> None:
    with pytest.raises(ConfigError) as caught:
        plan(text, FACTS)
    assert caught.value.message.startswith(start)
    assert hint in caught.value.hint


def test_map_may_be_named_with_its_folders() -> None:
    assert plan("map: Carla/Maps/Town02")[0].map == "Town02"


def test_raw_logs_count_in_full_only_while_they_are_kept() -> None:
    def estimate(text: str) -> tuple[int, int, int]:
        config = parse_config(text)
        result = estimate_run(config, plan_episodes(config, MAPS_ONLY))
        return result.dataset_bytes, result.raw_bytes, result.peak_bytes

    streamed = estimate("episodes: 10")
    kept = estimate("{episodes: 10, output: {keep_raw: true}}")
    assert streamed[:2] == kept[:2]
    assert kept[2] == kept[0] + kept[1]
    assert streamed[2] == pytest.approx(streamed[0] + streamed[1] / 5)


OLDEST_SERVER = replace(MAPS_ONLY, dialect="0.9.13")


@pytest.mark.parametrize(
    ("text", "path"),
    [
        ("weather: DustStorm", "weather.choice"),
        ("weather: {random_from: [all, DustStorm]}", "weather.random_from[1]"),
        ("weather: {parameters: {dust_storm: 1}}", "weather.parameters.dust_storm"),
        ("weather: {changes: [{at_s: 1, choice: DustStorm}]}", "weather.changes[0].choice"),
        (
            "weather: {changes: [{at_s: 1, parameters: {dust_storm: 1}}]}",
            "weather.changes[0].parameters.dust_storm",
        ),
        (
            "{labels: {cameras: []}, rig: {sensors: [{id: C, kind: rgb, "
            "attachment: spring_arm_ghost}]}}",
            "rig.sensors[0].attachment",
        ),
    ],
)
def test_what_carla_0_9_13_lacks_is_refused_by_its_field(text: str, path: str) -> None:
    with pytest.raises(ConfigError) as caught:
        plan(text, OLDEST_SERVER)
    assert caught.value.message.startswith(f"{path}: CARLA 0.9.13 has no ")
    assert plan(text)


def test_every_preset_is_every_one_that_the_server_has() -> None:
    text = "{weather: {random_from: [all], parameters: {dust_storm: 0}}, episodes: 300}"
    newer = {spec.weather.preset for spec in plan(text)}
    assert {spec.weather.preset for spec in plan(text, OLDEST_SERVER)} == newer - {"DustStorm"}
    assert newer == set(WEATHER_PRESETS)


def test_estimate_grows_with_pixels_and_saved_frames() -> None:
    small, large = (
        estimate_run(Config(), [replace(plan(text)[0])])
        for text in ("save_every: 10", "image_size: [1280, 720]")
    )
    assert large.dataset_bytes > 20 * small.dataset_bytes


def test_estimate_of_a_flash_lidar_by_rays_counts_its_rays_and_points() -> None:
    lidar = "{labels: {cameras: []}, rig: {sensors: [{id: L, kind: %s}]}}"
    (ray,), (imu,) = plan(lidar % "ray_flash_lidar"), plan(lidar % "imu")
    flash = ray.streams["L"].flash
    assert flash is not None
    rays, without = (estimate_run(Config(), [spec]) for spec in (ray, imu))
    frames = ray.saved_frames
    assert rays.raw_bytes - without.raw_bytes == frames * flash.beams * flash.samples**2 * 24
    assert rays.dataset_bytes > frames * flash.most_points * 4


@pytest.mark.parametrize("method", get_args(Labels.model_fields["method"].annotation))
def test_the_labeller_understands_every_method_that_can_be_asked_for(method: str) -> None:
    (spec,) = plan(f"labels: {{method: {method}}}")
    assert spec.labels.method == method
    assert spec.labels.pixels == (method != "stage_vo")


def test_every_label_setting_can_be_asked_for() -> None:
    """What the labeller reads from a spec is what the configuration writes into it."""
    (spec,) = plan(
        """
        {labels: {method: stage_vo, boxes: [3d], min_visible_px: 3, distance_origin: ego,
                  level_objects: [walls], stage_vo_tolerance_m: 0.1, stage_vo_strict: true,
                  stage_vo_vote: true, vector_map: false, birds_eye: {}, occupancy: {}},
         rig: {sensors: [{id: S, kind: semantic_lidar}]},
         ground_truth: {vehicles: false, pedestrians: false, ego_motion: false},
         max_distance_m: 55, min_lidar_points: 2}
        """
    )
    (default,) = plan()
    not_asked = []
    for section in ("labels", "ground_truth"):
        chosen, usual = getattr(spec, section), getattr(default, section)
        not_asked += [f.name for f in fields(chosen)
                      if getattr(chosen, f.name) == getattr(usual, f.name)]  # fmt: skip
    assert not_asked == ["lane_lines", "disparity"]  # they need a vector map, and stereo pairs
    (with_lines,) = plan("labels: {lane_lines: true}")
    assert with_lines.labels.lane_lines
    assert spec.labels.boxes_3d
    assert not spec.labels.boxes_2d
    assert (spec.max_distance_m, spec.min_lidar_points) == (55.0, 2)


def test_label_settings_have_one_set_of_defaults() -> None:
    (planned,) = plan()
    assert planned.labels == LabelsSpec(level_objects=tuple(sorted(DEFAULT_LEVEL_OBJECTS)))
    assert planned.ground_truth == GroundTruthSpec()
    assert (planned.max_distance_m, planned.min_lidar_points) == (MAX_DISTANCE_M, MIN_LIDAR_POINTS)


def test_twins_hang_where_their_camera_hangs() -> None:
    planned = sensors(
        "rig: {sensors: [{id: A, kind: rgb, attachment: follow, pose: {z: 30}}, "
        "{id: B, kind: rgb, pose: {z: 30}}, {id: C, kind: depth, attach_to: world, pose: {z: 30}}]}"
    )
    assert planned["A"].depth == "A.depth"
    assert planned["B"].depth == "B.depth"
    assert planned["A.depth"].attachment == planned["A.instance"].attachment == "follow"
    assert planned["B.depth"].attachment == "rigid"
    assert planned["C"].attach_to == "world"


def test_twins_measure_when_their_camera_does() -> None:
    planned = sensors(
        "{timing: {sensor_sync: false}, rig: {sensors: [{id: A, kind: rgb, rate_hz: 2}]}}"
    )
    assert planned["A"].attributes["sensor_tick"] == "0.5"
    assert planned["A.depth"].attributes["sensor_tick"] == "0.5"


def test_changes_of_the_weather_are_planned_with_their_times() -> None:
    spec = plan("weather: {choice: WetNoon, changes: [{at_s: 2, parameters: {wetness: 5}}]}")[0]
    assert spec.weather.preset == "WetNoon"
    assert spec.to_json()["weather"]["changes"] == [
        {"at_s": 2.0, "preset": None, "parameters": {"wetness": 5.0}}
    ]


def test_the_ego_may_begin_at_a_place_of_its_own() -> None:
    ego = plan("ego: {spawn: {x: 1, y: 2, yaw_deg: 90}, color: [1, 2, 3]}")[0].to_json()["ego"]
    assert ego["spawn_index"] is None
    assert ego["spawn_place"] == {"x_m": 1.0, "y_m": 2.0, "z_m": 0.3, "yaw_deg": 90.0}
    assert ego["color"] == [1, 2, 3]


def test_a_route_through_a_spawn_point_that_is_not_there_is_refused() -> None:
    assert plan("scenario: {kind: route, through: [99]}")[0].scenario == RouteSpec((99,))
    with pytest.raises(
        ConfigError, match=r"scenario\.through\[1\]: the map has no spawn point 100"
    ):
        plan("scenario: {kind: route, through: [{x: 1, y: 2}, 100]}")


def recording(**changes: object) -> Recording:
    times_s = np.arange(11) / 10
    poses = np.zeros((11, 6))
    poses[:, 0] = 10.0 * times_s
    poses[:, 4] = (175.0 + 10.0 * np.arange(11) + 180.0) % 360.0 - 180.0
    ego = Track("vehicle.tesla.model3", {"color": "1,2,3"}, True, times_s, poses)
    late = Track("vehicle.audi.tt", {}, False, times_s[4:], poses[4:])
    return replace(Recording("abc", "Stage01", 1.0, (ego, late)), **changes)


def replay(text: str, **changes: object) -> EpisodeSpec:
    config = parse_config("{scenario: {kind: replay, episode: x}, map: Town02, " + text + "}")
    return plan_episodes(config, MAPS_ONLY, recording(**changes))[0]


def test_a_replay_has_a_pose_for_every_step_by_the_short_way_round() -> None:
    spec = replay("fps: 20, duration_s: 1")
    ego, late = spec.scenario.actors
    assert spec.map == "Stage01"
    assert len(ego.poses) == 20
    assert ego.poses[1] == (0.5, 0.0, 0.0, 0.0, -180.0, 0.0)
    assert ego.attributes == {"color": "1,2,3"}
    assert late.poses[7] is None
    assert late.poses[8] is not None


def test_a_replay_longer_than_its_recording_is_refused() -> None:
    assert len(replay("fps: 10, duration_s: 1.1").scenario.actors[0].poses) == 11
    with pytest.raises(ConfigError, match=r"duration_s: .* ends after 1 s") as caught:
        replay("fps: 10, duration_s: 1.2")
    assert "1.1 s" in caught.value.hint


def test_a_replay_on_a_server_without_its_map_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"scenario\.episode: unknown map 'Atlantis'"):
        replay("fps: 10, duration_s: 1", map="Atlantis")


def test_exact_voxels_are_asked_of_a_hidden_sensor_where_their_frame_is() -> None:
    reach = "ahead_m: 10, behind_m: 6, resolution_m: 0.5, up_m: 5"
    text = f"labels: {{occupancy: {{exact: true, {reach}}}}}"
    asked = sensors(text)["ego.voxels"]
    assert (asked.kind, asked.blueprint) == ("occupancy", "sensor.other.occupancy")
    assert (asked.hidden, asked.labelled, asked.attach_to) == (True, False, "ego")
    assert astuple(asked.pose) == (0.0,) * 6
    assert asked.attributes == {
        "ahead": "10.0", "behind": "6.0", "left": "40.0", "right": "40.0", "up": "5.0",
        "down": "1.0", "resolution": "0.5",
    }  # fmt: skip
    rig = "rig: {sensors: [{id: L, kind: lidar, pose: {z: 2, yaw_deg: 9}, attach_to: vehicle.*}]}"
    found = sensors(f"{{labels: {{occupancy: {{exact: true, frame: L}}}}, {rig}}}")
    of_lidar = found["L.voxels"]
    assert (of_lidar.pose, of_lidar.attach_to) == (found["L"].pose, "vehicle.*")
    assert "ego.voxels" not in sensors("labels: {occupancy: {}}")


def test_exact_voxels_need_more_disk_while_they_are_recorded() -> None:
    raw = [
        int(
            plan_episodes(parse_config(f"labels: {{occupancy: {asked}}}"), MAPS_ONLY).costs[
                "raw_bytes"
            ][0]
        )
        for asked in ("{}", "{exact: true}")
    ]
    assert 1.5e6 < (raw[1] - raw[0]) / 50 < 4e6


@pytest.mark.parametrize(
    ("kind", "blueprint"),
    [
        ("sweeping_lidar", "lidar.ray_cast_sweeping"),
        ("rcs_radar", "other.radar_rcs"),
        ("ray_flash_lidar", "lidar.ray_cast_flash"),
        ("semantic_ray_flash_lidar", "lidar.ray_cast_flash"),
    ],
)
def test_a_sensor_of_the_simulators_own_is_refused_by_name_elsewhere(
    kind: str, blueprint: str
) -> None:
    rig = f"{{rig: {{sensors: [{{id: S, kind: {kind}}}]}}}}"
    refused = rf"sensors\[0\]\.kind: this server has no sensor\.{re.escape(blueprint)}"
    with pytest.raises(ConfigError, match=refused):
        plan(rig, FACTS)


def test_exact_voxels_are_refused_where_the_server_has_no_such_sensor() -> None:
    with pytest.raises(ConfigError, match=r"labels\.occupancy\.exact: this server has no sensor"):
        plan("labels: {occupancy: {exact: true}}", FACTS)
    has = replace(FACTS, blueprints={**FACTS.blueprints, "sensor.other.occupancy": {}})
    assert plan("labels: {occupancy: {exact: true}}", has)


@pytest.mark.parametrize(("ego", "first"), [("random", "random"), ("random", "3"), ("3", "random")])
def test_no_two_vehicles_begin_at_one_spawn_point(ego: str, first: str) -> None:
    rig = "rig: {sensors: [{id: C, kind: rgb}]}"
    text = (
        f"episodes: 60\nego: {{spawn: {ego}}}\nagents:\n"
        f"- {{name: a, spawn: {first}, {rig}}}\n- {{name: b, spawn: random, {rig}}}\n"
    )
    facts = ServerFacts(maps={"Stage01": 8}, blueprints={}, dialect="0.9.16")
    drawn = []
    for spec in plan_episodes(parse_config(text), facts):
        vehicles = [agent.vehicle for agent in spec.agents]
        starts = [spec.ego.spawn_index, *(one.spawn_index for one in vehicles if one is not None)]
        assert len(set(starts)) == 3
        drawn.append(tuple(starts))
    assert len(set(drawn)) > 20
