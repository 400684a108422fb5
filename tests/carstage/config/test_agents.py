"""`agents:` of the configuration, and the specification that follows from it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from carstage.config import Config, parse_config
from carstage.errors import ConfigError
from carstage.plan import ServerFacts, plan_episodes
from carstage.spec import EpisodeSpec, SpecError, agent_of, stream_of

LIDAR = {"id": "LIDAR", "kind": "lidar"}
PANORAMA = {"id": "PANO", "kind": "rgb", "lens": {"model": "equirectangular"}}
CAR = {"name": "car2", "rig": {"sensors": [{"id": "CAM", "kind": "rgb"}, LIDAR]}}
MAST = {"name": "mast", "kind": "roadside", "pose": {"x": 1, "z": 5}, "rig": {"sensors": [LIDAR]}}
ORBIT = {"kind": "orbit", "radius_m": 20}
DRONE = {"name": "drone", "kind": "drone", "path": ORBIT, "rig": {"preset": "drone"}}
CORNER = {"name": "corner", "kind": "junction", "rig": {"preset": "junction"}}
TWICE = {"kind": "waypoints", "points": [[0, 0, 9], [0, 0, 9]]}
FACTS = ServerFacts(maps={"Stage01": 80})


def config(*agents: dict[str, Any], **settings: Any) -> Config:
    text = json.dumps({"map": "Stage01", "agents": list(agents), **settings})
    return parse_config(text)


def spec(*agents: dict[str, Any], **settings: Any) -> EpisodeSpec:
    return plan_episodes(config(*agents, **settings), FACTS)[0]


@pytest.mark.parametrize(
    ("agents", "settings", "message"),
    [
        ([{**CAR, "name": "ego"}], {}, r"agents\[0\].name"),
        ([{**CAR, "name": "a/b"}], {}, r"agents\[0\].name"),
        ([CAR, {**MAST, "name": "CAR2"}], {}, r"agents\[1\].name: 'CAR2' is the name of another"),
        ([{**CAR, "kind": "ship"}], {}, r"agents\[0\].kind: unknown kind 'ship'"),
        ([{**DRONE, "path": {"kind": "dive"}}], {}, r"agents\[0\].path.kind: unknown kind 'dive'"),
        ([{**DRONE, "path": TWICE}], {}, r"agents\[0\].path.points\[1\]: is the point before"),
        (
            [{**DRONE, "path": {**ORBIT, "speed_m_s": 30}}],
            {},
            r"agents\[0\].path.speed_m_s: 30 m/s is more than max_speed_m_s, 20",
        ),
        (
            [{**DRONE, "gimbal": {"look_at": "ego", "pitch_deg": -30}}],
            {},
            r"agents\[0\].gimbal.pitch_deg: look_at says where to",
        ),
        (
            [DRONE],
            {"timing": {"mode": "async", "sensor_sync": False}},
            r"agents\[0\].kind: a drone needs",
        ),
        ([{**CORNER, "junction": "all"}], {}, r"agents\[0\].junction"),
        (
            [CAR, {**MAST, "rig": {"sensors": [{"id": "IMU", "kind": "imu"}]}}],
            {"labels": {"occupancy": {}}},
            r"labels.occupancy: no sensor of the agent 'mast' tells the classes",
        ),
        (
            [CAR],
            {"labels": {"occupancy": {"frame": "CAM_FRONT"}}},
            r"labels.occupancy.frame: the agent 'car2' has no sensor 'CAM_FRONT'",
        ),
        ([{**CAR, "driver": "keyboard"}], {}, r"agents\[0\].driver: only the ego"),
        ([{**CAR, "rig": {"sensors": [{**LIDAR, "id": "L" * 20}]}}], {}, "at most 19"),
        ([{**CAR, "rig": {"sensors": [{**PANORAMA, "id": "P" * 18}]}}], {}, "at most 17"),
        ([{**CAR, "rig": {"sensors": []}}], {}, r"agents\[0\].rig"),
        ([{key: MAST[key] for key in ("name", "kind", "rig")}], {}, r"agents\[0\].pose"),
        ([CAR], {"scenario": {"kind": "replay", "episode": "x"}}, "agents: a file says"),
        ([CAR], {"scenario": {"kind": "scenic", "file": "x.scenic"}}, "agents: a file says"),
        (
            [{**CAR, "driver": "route"}],
            {"timing": {"mode": "async", "sensor_sync": False}},
            r"agents\[0\].driver: a driver needs",
        ),
        ([CAR], {"labels": {"cameras": ["OTHER"]}}, r"labels.cameras\[0\]"),
    ],
)
def test_agents_that_cannot_be_are_refused_with_their_path(
    agents: list[dict[str, Any]], settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        config(*agents, **settings)


def test_a_spawn_point_or_a_car_that_the_server_lacks_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"agents\[0\].spawn: Stage01 has no spawn point 80"):
        spec({**CAR, "spawn": 80})
    facts = replace(FACTS, blueprints={"vehicle.tesla.model3": {}, "sensor.camera.rgb": {}})
    with pytest.raises(ConfigError, match=r"agents\[0\].blueprint: unknown blueprint"):
        plan_episodes(config({**CAR, "blueprint": "vehicle.tesla.model4"}), facts)


def test_names_in_labels_mean_the_sensors_of_all_rigs() -> None:
    planned = spec(CAR, MAST, labels={"cameras": ["CAM"], "lidars": ["LIDAR"]})
    assert not any(sensor.labelled for sensor in planned.sensors)
    car, mast = planned.agents
    assert [sensor.id for sensor in car.sensors if sensor.labelled] == ["CAM"]
    assert [sensor.id for sensor in mast.sensors] == ["LIDAR", "LIDAR.semantic"]


def test_agents_change_nothing_of_the_ego_and_the_traffic() -> None:
    alone, fleet = spec(), spec(CAR, MAST)
    assert "agents" not in alone.to_json()
    assert replace(fleet, agents=()) == alone
    assert replace(fleet, agents=()).episode_id == alone.episode_id != fleet.episode_id


def test_one_agent_more_changes_no_other() -> None:
    first, second = spec({**CAR, "spawn": "random"}), spec({**CAR, "spawn": "random"}, MAST)
    assert second.agents[0] == first.agents[0]


def test_the_specification_survives_json() -> None:
    driven = {**CAR, "driver": "route", "spawn": {"x": 1, "y": 2}}
    planned = spec(driven, MAST, {**CAR, "name": "c"})
    again = EpisodeSpec.from_json(json.loads(planned.canonical_json()))
    assert again == planned
    for agent in planned.agents:
        seen = planned.seen_by(agent.name)
        assert EpisodeSpec.from_json(json.loads(seen.canonical_json())) == seen


def test_drones_and_masts_survive_json_and_have_no_vehicle() -> None:
    flights = [
        {"path": ORBIT, "gimbal": {"look_at": "ego"}},
        {"path": {**ORBIT, "center": [1, -0.0, 2], "clockwise": False}},
        {"path": {"kind": "follow"}, "gimbal": {"look_at": [1, 2, 3]}},
        {"path": {"kind": "waypoints", "points": [[0, 0, 9], [5, 0, 9]], "loop": True}},
    ]
    drones = [{**DRONE, "name": f"d{i}", **flight} for i, flight in enumerate(flights)]
    masts = [{**CORNER, "name": f"j{i}", "junction": j} for i, j in enumerate([3, "random"])]
    planned = spec(*drones, CORNER, *masts)
    assert EpisodeSpec.from_json(json.loads(planned.canonical_json())) == planned
    assert not any(agent.ego.is_vehicle for agent in planned.agents)
    first = planned.agents[0].drone
    assert first is not None
    assert first.looks_at_ego
    junctions = [agent.junction for agent in planned.agents if agent.junction is not None]
    assert [(one.near_ego, one.id, one.draw is None) for one in junctions] == [
        (True, None, True),
        (False, 3, True),
        (False, None, False),
    ]


def test_an_agent_sees_the_episode_as_its_ego() -> None:
    planned = spec(CAR, MAST, scenario={"kind": "stationary"})
    seen = planned.seen_by("car2")
    assert seen.ego.near_ego
    assert seen.sensors == planned.agents[0].sensors
    assert seen.agents == ()
    assert seen.scenario.kind == "autopilot"
    assert seen.seeds.sensor_noise == planned.agents[0].seeds.sensor_noise
    assert not planned.seen_by("mast").ego.is_vehicle
    with pytest.raises(KeyError):
        planned.seen_by("ego")


def test_a_specification_with_two_agents_of_one_name_is_refused() -> None:
    document = spec(CAR).to_json()
    document["agents"] *= 2
    with pytest.raises(SpecError, match=r"agents\[1\].name: 'car2' is taken already"):
        EpisodeSpec.from_json(document)


def test_streams_of_the_log_tell_sensor_and_agent() -> None:
    assert list(spec(CAR, MAST).streams)[-2:] == ["CAM.instance@1", "LIDAR@2"]
    assert agent_of(stream_of("CAM.depth", 12)) == ("CAM.depth", 12)
    assert agent_of("LIDAR") == ("LIDAR", 0)
