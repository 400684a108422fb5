"""Events on the embedded simulator: recorded, labelled by the world's record, the same again."""

from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import carla
import numpy as np
import pytest

import small_maps
from carstage.annotation.events import event_rows
from carstage.collector.internals.errors import SceneError
from carstage.collector.scenario.events import check_map
from carstage.conversion import EpisodeConversion
from carstage.dataset.tables import read_table
from carstage.rawlog.reader import EpisodeLog, WorldFrame
from carstage.spec import EpisodeSpec
from carstage.storage import FolderFiles
from running_collector import GIVEN_BACK, Collector

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("collector")]

PlanMaker = Callable[..., dict[str, Any]]
POSE = dict.fromkeys(("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg"), 0.0)
GNSS = {
    "id": "GNSS", "kind": "gnss", "blueprint": "sensor.other.gnss", "pose": POSE, "attributes": {},
}  # fmt: skip
CROSSING = {
    "kind": "pedestrian_crosses", "at_s": 0.0, "distance_m": 30.0, "trigger_m": 18.0,
    "speed_m_s": 2.0, "side": "right", "parked_car": False,
}  # fmt: skip
LEADER = {
    "kind": "hard_braking_leader", "at_s": 9.0, "gap_m": 10.0, "lead_s": 1.0,
    "deceleration_m_s2": 5.0, "stand_s": 1.0,
}  # fmt: skip
TOO_LATE = {
    "kind": "stopped_vehicle", "at_s": 80000.0, "distance_m": 40.0, "trigger_m": 20.0,
    "stand_s": 1.0,
}  # fmt: skip


def recorded(collector: Collector, make_plan: PlanMaker, folder: Path) -> EpisodeLog:
    plan = make_plan(
        folder,
        steps=200,
        sensors=[GNSS],
        vehicles={"count": 0, "filter": "vehicle.*"},
        pedestrians={"count": 0, "filter": "walker.pedestrian.*"},
        traffic={"ignore_lights_percent": 100.0, "include_ego": True},
        scenario={"kind": "autopilot", "events": [CROSSING, LEADER, TOO_LATE]},
    )
    code, events = collector.run(plan)
    assert code == 0, [event for event in events if event["event"] == "error"]
    return EpisodeLog(folder)


def world(log: EpisodeLog) -> list[WorldFrame]:
    return [frame for index in log.sealed_segments("world") for frame in log.world_frames(index)]


def rows_of(log: EpisodeLog) -> list[dict[str, Any]]:
    return event_rows(log.spec, world(log), log.actors(), int(log.header["ego_id"]))


def test_events_happen_as_asked_and_the_same_again(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    log = recorded(collector, make_plan, tmp_path / "raw")
    frames, ego_id = world(log), int(log.header["ego_id"])
    crossing, leader, late = rows_of(log)
    assert [crossing["state"], leader["state"], late["state"]] == [
        "happened", "happened", "not placed",
    ], (crossing["reason"], leader["reason"])  # fmt: skip
    assert late["reason"] == "its time has not come"
    assert late["actors"] == []

    walker = crossing["actors"][0]
    assert log.actors()[walker].type_id.startswith("walker.")
    during = frames[crossing["begin_tick"] : crossing["end_tick"] + 1]
    ego, feet = (
        np.array([one.location[one.row(who)][:2] for one in during]) for who in (ego_id, walker)
    )
    assert 12.0 < np.linalg.norm(feet[0] - ego[0]) < 20.0
    speeds = np.linalg.norm(np.diff(feet, axis=0), axis=1) * log.spec.fps
    assert np.median(speeds) == pytest.approx(2.0, rel=0.1)
    middles = np.linalg.norm(feet - ego, axis=1)
    assert crossing["min_distance"] < middles.min() < crossing["min_distance"] + 4.0

    car = leader["actors"][0]
    during = frames[leader["begin_tick"] : leader["end_tick"] + 1]
    speed = np.array([np.linalg.norm(one.velocity[one.row(car)]) for one in during])
    slower = -np.diff(speed) * log.spec.fps
    assert np.median(slower[slower > 0.5]) == pytest.approx(5.0, rel=0.1)
    assert speed[-1] < 0.05
    assert leader["min_ttc"] > 0.0
    assert not leader["collision"]

    again = recorded(collector, make_plan, tmp_path / "again")
    assert rows_of(again) == [crossing, leader, late]
    for one, other in zip(frames, world(again), strict=True):
        assert np.array_equal(one.location, other.location)
        assert one.meta["events"] == other.meta["events"]
    assert collector.left_on_server() == GIVEN_BACK

    with ThreadPoolExecutor(1) as pool:
        EpisodeConversion(log.folder, FolderFiles(tmp_path / "a1"), pool).finish()
    table = read_table(tmp_path / "a1" / "events.parquet")
    assert table.to_pylist() == [crossing, leader, late]


CUT_IN = {"kind": "cut_in", "at_s": 0.0, "gap_m": 8.0, "change_s": 2.0, "slower_m_s": 1.0}
OVERTAKER = {
    "kind": "oncoming_overtaker", "at_s": 0.0, "distance_m": 60.0, "speed_m_s": 12.0,
    "slower_m_s": 8.0, "change_s": 1.0,
}  # fmt: skip

RED_LIGHT = {
    "kind": "red_light_runner", "at_s": 0.0, "trigger_m": 25.0, "speed_m_s": 10.0, "before_s": 1.0,
}  # fmt: skip


@pytest.mark.parametrize(
    "event", [CUT_IN, OVERTAKER, RED_LIGHT], ids=lambda event: str(event["kind"])
)
def test_a_map_without_a_place_for_an_event_is_refused_before_recording(
    make_plan: PlanMaker, event: dict[str, Any]
) -> None:
    one_way = re.sub("<left>.*?</left>", "<left/>", small_maps.one_road(), flags=re.DOTALL)
    one_lane = carla.Map("OneLane", one_way)
    scenario = {"kind": "autopilot", "events": [CROSSING, event]}
    plan = make_plan("raw", sensors=[GNSS], scenario=scenario)
    spec = EpisodeSpec.from_json(plan["episodes"][0]["spec"])
    with pytest.raises(SceneError, match=r"^scenario.events\[1\]: map Stage01 has no place for"):
        check_map(spec, one_lane)
