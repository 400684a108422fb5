"""Episodes keep the ids that version 0.1 gave them: another id breaks resuming its datasets."""

from __future__ import annotations

import json

import pytest

from carstage.config import parse_config
from carstage.plan import ServerFacts, plan_episodes
from carstage.spec import EpisodeSpec

FACTS = ServerFacts(maps={"Stage01": 100, "Stage02": 50, "Stage03": 7})

#: By configuration, the ids of its episodes, as version 0.1 planned them.
IDS_OF_VERSION_0_1 = {
    "episodes: 3": ["e1d5fb8861db6c96", "036b5b1afdd20180", "fef8760f022fbd2a"],
    "{episodes: 3, map: {random_from: [all]}, weather: {random_from: [all]}}": [
        "43bf7ca54d2e8b65", "b5c440f6db61e8ed", "096cb9707829eeb0",
    ],
    "scenario: {kind: hold}": ["6add4a4c41678eaa"],
    "scenario: {kind: stationary}": ["6add4a4c41678eaa"],
    "scenario: {kind: route, through: [3, {x: 1, y: 2.5}, 9]}": ["76426f25ac9fc0af"],
    "ego: {spawn: {x: 1, y: -2, yaw_deg: 90}, color: [1,2,3]}": ["4d4e8582e9302c44"],
    "ego: {spawn: 5}": ["ee099fbbdbb1af41"],
    "vehicles: {count: 3, radius_m: null, generation: '2', shortfall: fill, groups: ["
    "{count: 2, base_type: truck}, {count: 1, filter: 'vehicle.audi.*', generation: '1'}]}": [
        "5836c57eeae975e1"
    ],
    "pedestrians: {count: 0, radius_m: 12, running_percent: 20, crossing_percent: 5, "
    "shortfall: fail}": ["3e02936a268e37ff"],
    "traffic: {speed_difference_percent: [-10, 30], distance_m: 3, lane_changes: false, "
    "ignore_lights_percent: 5, include_ego: true, hybrid_physics_radius_m: 70}": [
        "70e6a216e8df7cc3"
    ],
    "weather: {choice: WetNoon, parameters: {fog_density: 30}, lights: 'on', changes: ["
    "{at_s: 1, choice: ClearNight}, {at_s: 2, parameters: {cloudiness: 4}}]}": [
        "b73f55479743da42"
    ],
    "map: {choice: Stage02, layers: [Buildings, Walls]}": ["3ef9d40fa962e425"],
    "{fps: 24, duration_s: 3.3, save_every: 7, timing: {warmup_ticks: 3, mode: async, "
    "on_incomplete: skip, substepping: {max_substep_delta_time_s: 0.02, max_substeps: 5}}}": [
        "0329c2c638a5b640"
    ],
    "{timing: {sensor_sync: false}, "
    "rig: {sensors: [{id: A, kind: imu, rate_hz: 5}, {id: C, kind: rgb}]}}": ["1221c87c07d29f7a"],
    "labels: {method: stage_vo, boxes: [3d], cameras: [], level_objects: [walls, poles, walls], "
    "min_visible_px: 3, distance_origin: ego, stage_vo_tolerance_m: 0.1, stage_vo_strict: true, "
    "stage_vo_vote: true}": ["97ec275b1a37df22"],
    "{ground_truth: {vehicles: false, ego_motion: false}, max_distance_m: 55, "
    "min_lidar_points: 0}": ["b3d97f76dc796559"],
    "rig: {sensors: [{id: A, kind: rgb, attachment: follow, pose: {z: 30, yaw_deg: -0.0}}, "
    "{id: B, kind: lidar, attach_to: 'vehicle.*', attach_index: 2}, "
    "{id: W, kind: depth, attach_to: world}, {id: R, kind: radar}, {id: G, kind: gnss}, "
    "{id: F, kind: flow}]}": ["2ae12176cab545db"],
    "rig: {preset: demo}": ["feff8a4135eb4b88"],
    "rig: {preset: kitti}": ["a90afa85aafcb5b9"],
    "rig: {preset: nuscenes}": ["15a403d4dd79c5d9"],
    "rig: {preset: waymo}": ["0c324ea54f29ca0d"],
    "rig: {preset: paper}": ["02cd815aa9b14775"],
}  # fmt: skip


@pytest.mark.parametrize("text", IDS_OF_VERSION_0_1)
def test_a_configuration_gives_the_ids_of_version_0_1(text: str) -> None:
    planned = plan_episodes(parse_config(text), FACTS)
    assert [spec.episode_id for spec in planned] == IDS_OF_VERSION_0_1[text]
    for spec in planned:
        assert EpisodeSpec.from_json(json.loads(spec.canonical_json())) == spec
