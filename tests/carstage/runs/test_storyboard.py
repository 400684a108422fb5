"""Car-STAGE plays an OpenSCENARIO file: the labels show what the file asks for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

import carstage
from carstage.config import check_config
from carstage.dataset import Episode
from carstage.errors import ConfigError
from carstage.runs.preflight import judge
from carstage.spec import StoryboardSpec
from running_simulator import RunningSimulator
from storyboard_file import (
    HERO,
    LEAD,
    WALKER,
    after,
    at,
    event,
    group,
    lane_change,
    of,
    pedestrian,
    placed,
    scenario,
    speed,
    vehicle,
    when,
    world,
)

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.xdist_group("following"),
    pytest.mark.timeout(600),
]

EXAMPLES = Path(__file__).parents[3] / "examples"
FPS, DURATION_S = 20, 9.0
STEP_S = 1.0 / FPS
LEFT_Y, RIGHT_Y = 1.75, 5.25
"""Road 4 of Stage01 leads along x from 67 to 178 m; middles of its lanes -1 and -2, CARLA's y."""
GAP_M, CHANGE_S, BRAKES_M_S2 = 6.0, 2.0, 4.0
NEAR = (
    f'<RelativeDistanceCondition entityRef="{HERO}" value="{GAP_M}" freespace="true" '
    'rule="greaterThan" relativeDistanceType="longitudinal"/>'
)
ENTITIES = [
    vehicle(HERO, kind="ego_vehicle"),
    vehicle(LEAD, "vehicle.audi.tt"),
    vehicle("parked", "vehicle.nissan.patrol"),
    pedestrian(WALKER),
]
LANE = '<Position><LanePosition roadId="4" laneId="{}" s="{}"/></Position>'
INIT = [
    placed(HERO, LANE.format(-2, 5), 8.0),
    placed(LEAD, LANE.format(-1, 11), 10.0),
    placed("parked", world(170.0, 8.0, 12.0)),
    placed(WALKER, world(76.0, 8.5, -90.0)),
]
TTC_S = 4.0
TTC = (
    f'<TimeToCollisionCondition value="{TTC_S}" rule="lessThan" freespace="true"><'
    'TimeToCollisionConditionTarget><EntityRef entityRef="parked"/>'
    "</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
)
EXTERNAL = (
    '<PrivateAction><ControllerAction><AssignControllerAction><Controller name="Driver">'
    '<Properties><Property name="module" value="external_control"/></Properties></Controller>'
    "</AssignControllerAction></ControllerAction></PrivateAction>"
)


class Track(NamedTuple):
    """One road user of the labels, by step: middle of its box, velocity, half its length."""

    at: NDArray[Any]
    velocity: NDArray[Any]
    half_m: float


def configuration(simulator: RunningSimulator, file: Path, **changes: Any) -> dict[str, Any]:
    at_host = {"kind": "remote", "host": simulator.host, "port": simulator.port}
    return {
        "seed": 5,
        "fps": FPS,
        "duration_s": DURATION_S,
        "timing": {"warmup_ticks": 4},
        "max_distance_m": 300.0,
        "conversion": {"workers": 1},
        "rig": {"sensors": [{"id": "IMU", "kind": "imu"}]},
        "server": {**at_host, "self_test": "off"},
        "scenario": {"kind": "openscenario", "file": str(file)},
        **changes,
    }


def record(out: Path, config: dict[str, Any]) -> Episode:
    result = carstage.run(config, out, retries=0)
    assert not result.failures, result.failures
    (episode,) = carstage.Dataset(out).episodes
    return episode


def track(episode: Episode, role: str) -> Track:
    """Of who has that role in the labels."""
    rows = [row for row in episode.objects().to_pylist() if row["role_name"] == role]
    assert [row["k"] for row in rows] == list(range(episode.frames))
    at_m = np.array([row["box_center"] for row in rows])
    return Track(at_m, np.array([row["velocity"] for row in rows]), rows[0]["box_extent"][0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("storyboard")


@pytest.fixture(scope="module")
def played(simulator: RunningSimulator, folder: Path) -> Episode:
    brake = speed(0.0, "linear", "rate", BRAKES_M_S2)
    events = [
        event("CutIn", [lane_change(LEAD, -1, CHANGE_S)], when(of(LEAD, NEAR))),
        event("Brake", [brake], when(after("action", "CutIn0"), delay_s=0.5)),
    ]
    file = folder / "story.xosc"
    file.write_text(
        scenario(
            ENTITIES,
            INIT,
            [
                group(LEAD, *events),
                group(WALKER, event("Walk", [speed(1.5)], when(at(2.0)))),
                group(HERO, event("Slow", [speed(2.0, "cubic", "time", 2.0)], when(at(5.0)))),
            ],
        )
    )
    return record(folder / "out", configuration(simulator, file))


def test_a_car_cuts_in_at_the_distance_and_in_the_time_that_the_file_says(played: Episode) -> None:
    hero, lead = track(played, "hero"), track(played, LEAD)
    gap_m = lead.at[:, 0] - hero.at[:, 0] - lead.half_m - hero.half_m
    k = int(np.argmax(gap_m > GAP_M))
    assert 20 < k < 80
    steps = round(CHANGE_S * FPS)
    assert lead.at[: k + 1, 1] == pytest.approx(LEFT_Y, abs=0.01)
    assert lead.at[k + steps // 2, 1] == pytest.approx(0.5 * (LEFT_Y + RIGHT_Y), abs=0.05)
    assert lead.at[k + steps - 4, 1] < RIGHT_Y - 0.02
    assert lead.at[k + steps :, 1] == pytest.approx(RIGHT_Y, abs=0.01)
    # Half a second after the last step of the lane change it begins to brake.
    first = k + steps + 1 + FPS // 2
    assert lead.velocity[:first, 0] == pytest.approx(10.0, abs=0.05)
    driven_s = np.arange(1, len(lead.at) - first + 1) * STEP_S - 0.5 * STEP_S
    slower = np.maximum(10.0 - BRAKES_M_S2 * driven_s, 0.0)
    assert lead.velocity[first:, 0] == pytest.approx(slower, abs=0.12)
    assert lead.velocity[-1, 0] == 0.0


def test_the_ego_and_a_pedestrian_move_as_the_file_says(played: Episode) -> None:
    hero, walker = track(played, "hero"), track(played, WALKER)
    assert hero.at[:, 0] == pytest.approx(72.0 + np.cumsum(hero.velocity[:, 0]) * STEP_S, abs=0.5)
    after_5_s = round(5.0 * FPS) + 2
    assert hero.velocity[:after_5_s, 0] == pytest.approx(8.0, abs=0.01)
    assert hero.velocity[after_5_s + 40 :, 0] == pytest.approx(2.0, abs=0.01)
    after_2_s = round(2.0 * FPS) + 2
    assert abs(walker.velocity[:after_2_s, :2]).max() < 0.01
    assert walker.velocity[after_2_s + 4 :, 1] == pytest.approx(-1.5, abs=0.1)
    assert walker.at[-1, 0] == pytest.approx(76.0, abs=0.1)


def test_who_is_not_told_to_move_stands_where_the_file_puts_it(played: Episode) -> None:
    parked = track(played, "parked")
    assert parked.at[:, 0] == pytest.approx(170.0, abs=0.2)
    assert parked.at[:, 1] == pytest.approx(8.0, abs=0.2)
    assert np.ptp(parked.at, axis=0).max() < 0.01
    rows = [row for row in played.objects().to_pylist() if row["role_name"] == "parked"]
    assert rows[-1]["actor_rotation_deg"][1] == pytest.approx(12.0, abs=0.1)


def test_the_specification_holds_what_the_file_says(played: Episode, folder: Path) -> None:
    assert isinstance(played.spec.scenario, StoryboardSpec)
    assert [one.name for one in played.spec.scenario.entities] == [HERO, LEAD, "parked", WALKER]
    assert carstage.validate(folder / "out").ok


def rows_of(episode: Episode) -> dict[str, dict[str, Any]]:
    """Rows of ``events.parquet`` by the name of the event, or of the action, in the file."""
    table = episode.events()
    assert table is not None
    found = {}
    for row in table.to_pylist():
        part = json.loads(row["parameters"])
        found[part.get("action", part["event"])] = {**row, **part}
    return found


def test_the_table_of_events_says_when_each_event_of_the_file_was(played: Episode) -> None:
    hero, lead = track(played, "hero"), track(played, LEAD)
    gap_m = lead.at[:, 0] - hero.at[:, 0] - lead.half_m - hero.half_m
    k = int(np.argmax(gap_m > GAP_M))
    rows = rows_of(played)
    assert list(rows) == [
        "CutIn", "CutIn0", "Brake", "Brake0", "Walk", "Walk0", "Slow", "Slow0",
    ]  # fmt: skip
    assert {row["state"] for row in rows.values()} == {"happened"}
    steps = round(CHANGE_S * FPS)
    cut_in, action = rows["CutIn"], rows["CutIn0"]
    assert (cut_in["begin_tick"], cut_in["end_tick"]) == (k + 1, k + steps)
    assert (action["begin_tick"], action["end_tick"]) == (k + 1, k + steps)
    assert (cut_in["kind"], action["kind"]) == ("storyboard_event", "storyboard_action")
    assert (action["does"], action["entities"], action["execution"]) == ("lane_change", [LEAD], 1)
    assert cut_in["begin_s"] == pytest.approx((k + 1) * STEP_S)
    assert lead.at[cut_in["begin_tick"], 1] > LEFT_Y
    first = rows["Brake"]["begin_tick"]
    assert first == k + steps + 1 + FPS // 2
    assert lead.velocity[first - 1, 0] == pytest.approx(10.0, abs=0.05)
    assert lead.velocity[first, 0] < 10.0
    # From the step after 5 s it slows for 2 s.
    assert rows["Slow"]["begin_tick"] == round(5.0 * FPS) + 2
    assert rows["Slow"]["end_s"] - rows["Slow"]["begin_s"] == pytest.approx(2.0 - STEP_S)


def test_the_table_of_events_says_who_acted_and_how_near_they_came(played: Episode) -> None:
    rows = rows_of(played)
    ids = {row["role_name"]: row["track_id"] for row in played.objects().to_pylist()}
    assert rows["CutIn"]["actors"] == rows["CutIn0"]["actors"] == [ids[LEAD]]
    assert rows["Walk"]["actors"] == [ids[WALKER]]
    hero, lead = track(played, "hero"), track(played, LEAD)
    brake = rows["Brake"]
    during = slice(brake["begin_tick"], brake["end_tick"] + 1)
    gap_m = lead.at[during, 0] - hero.at[during, 0] - lead.half_m - hero.half_m
    assert brake["min_distance"] == pytest.approx(gap_m.min(), abs=0.02)
    assert brake["min_ttc"] is not None
    assert brake["collision"] == bool(gap_m.min() <= 0.0)
    # The ego alone slows, and the event names nobody else.
    slow = rows["Slow"]
    assert slow["actors"] == [ids["hero"]]
    assert (slow["min_distance"], slow["min_ttc"], slow["collision"]) == (None, None, None)
    assert slow["ego_deceleration"] > 3.0


def test_an_event_that_never_begins_says_why_and_one_that_happens_again_has_rows(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    faster = '<SpeedCondition value="1.1" rule="lessThan"/>'
    slower = '<SpeedCondition value="2.9" rule="greaterThan"/>'
    go, wait = speed(3.0, "linear", "time", 0.5), speed(1.0, "linear", "time", 0.5)
    events = [
        event("Go", [go], when(of(LEAD, faster), edge="none"), most=2),
        event("Wait", [wait], when(of(LEAD, slower), edge="none"), priority="skip", most=2),
        event("Late", [go], when(at(60.0))),
    ]
    file = tmp_path / "again.xosc"
    placed_there = [placed(HERO, LANE.format(-2, 5)), placed(LEAD, LANE.format(-1, 11), 1.0)]
    file.write_text(scenario(ENTITIES[:2], placed_there, [group(LEAD, *events)]))
    episode = record(tmp_path / "out", configuration(simulator, file, duration_s=5.0))
    table = episode.events()
    assert table is not None
    rows = [{**row, **json.loads(row["parameters"])} for row in table.to_pylist()]
    whole = [row for row in rows if row["kind"] == "storyboard_event"]
    assert [(row["event"], row["execution"], row["state"]) for row in whole] == [
        ("Go", 1, "happened"), ("Go", 2, "happened"), ("Wait", 1, "happened"),
        ("Wait", 2, "happened"), ("Late", 1, "did not happen"),
    ]  # fmt: skip
    assert whole[-1]["reason"] == "its trigger did not hold"
    begins = [row["begin_tick"] for row in whole[:-1]]
    assert begins[0] < begins[2] < begins[1] < begins[3]
    assert all(row["end_tick"] - row["begin_tick"] == FPS // 2 - 1 for row in whole[:-1])
    assert carstage.validate(tmp_path / "out").ok


def test_the_same_file_recorded_twice_has_the_same_bytes(
    simulator: RunningSimulator, played: Episode, folder: Path, tmp_path: Path
) -> None:
    again = record(tmp_path / "out", configuration(simulator, folder / "story.xosc"))
    assert again.id == played.id
    hashes = [{one.path: one.hash for one in each.marker.files} for each in (played, again)]
    assert "events.parquet" in hashes[0]
    assert hashes[0] == hashes[1]


def test_a_driver_drives_the_ego_and_conditions_look_at_it(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    go = speed(6.0, "linear", "time", 2.0)
    stop = of(HERO, '<TraveledDistanceCondition value="62"/>')
    file = tmp_path / "ttc.xosc"
    file.write_text(
        scenario(
            ENTITIES[:3],
            [
                placed(HERO, LANE.format(-2, 5), 8.0, EXTERNAL),
                placed(LEAD, LANE.format(-1, 20)),
                placed("parked", world(165.0, -RIGHT_Y, 0.0)),
            ],
            [group(LEAD, event("Go", [go], when(of(HERO, TTC))))],
            stop=when(stop, tag="Stop"),
            axes="to the left",
        )
    )
    driver = {"driver": {"kind": "route", "speed_m_s": 8.0}}
    episode = record(tmp_path / "out", configuration(simulator, file, ego=driver))
    hero, lead, parked = (track(episode, one) for one in ("hero", LEAD, "parked"))
    gap_m = parked.at[:, 0] - hero.at[:, 0] - parked.half_m - hero.half_m
    k = int(np.argmax(gap_m / hero.velocity[:, 0] < TTC_S))
    assert k > 40
    assert hero.velocity[1, 0] == pytest.approx(8.0, abs=0.5)
    assert abs(lead.velocity[:k, 0]).max() < 0.01
    assert lead.velocity[k + 2, 0] > 0.01
    traveled_m = np.cumsum(np.hypot(*np.diff(hero.at[:, :2], axis=0).T))
    end = int(np.argmax(traveled_m >= 62.0)) + 1
    assert k + 10 < end < len(hero.at) - 20
    assert (np.diff(lead.velocity[k:end, 0]) > 0.01).all()
    assert (np.diff(lead.velocity[end + 1 : end + 6, 0]) < 0).all()
    assert lead.velocity[-1, 0] == 0.0


def test_in_the_example_a_car_cuts_in_and_stops_for_a_pedestrian(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    asked = yaml.safe_load((EXAMPLES / "openscenario.yaml").read_text("utf-8"))
    file = EXAMPLES / "cut_in.xosc"
    scenario = {**asked["scenario"], "file": str(file)}
    changes = {"duration_s": asked["duration_s"], "ego": asked["ego"], "scenario": scenario}
    episode = record(tmp_path / "out", configuration(simulator, file, **changes))
    hero, car, walker = (track(episode, one) for one in ("hero", "overtaker", "pedestrian"))
    assert car.at[0, 1] == pytest.approx(LEFT_Y, abs=0.01)
    assert car.at[-1, 1] == pytest.approx(RIGHT_Y, abs=0.01)
    stands = int(np.argmax(car.velocity[:, 0] < 0.01))
    assert 0 < stands < len(car.at) - FPS
    assert abs(walker.velocity[: stands + FPS // 2 - 2, 1]).max() < 0.01
    assert walker.at[-1, 1] < RIGHT_Y - 1.0  # it has passed before the car
    gap_m = car.at[:, 0] - hero.at[:, 0] - car.half_m - hero.half_m
    assert gap_m[stands:].min() > 0.5  # the ego stops behind it
    assert hero.velocity[-1, 0] < 0.5


def test_an_ego_that_the_file_moves_has_no_driver(tmp_path: Path) -> None:
    file = tmp_path / "a.xosc"
    moved = group(HERO, event("Go", [speed(1.0)], ""))
    file.write_text(scenario(ENTITIES, INIT, [moved]))
    config = {"scenario": {"kind": "openscenario", "file": str(file)}}
    assert isinstance(judge(check_config(config))[0].scenario, StoryboardSpec)
    with pytest.raises(ConfigError, match=r"ego\.driver: .* moves 'hero' itself"):
        judge(check_config({**config, "ego": {"driver": {"kind": "route"}}}))


def test_a_blueprint_that_the_server_lacks_is_refused_before_it_starts(tmp_path: Path) -> None:
    file = tmp_path / "a.xosc"
    file.write_text(scenario([vehicle(HERO, "vehicle.tesla.model9")], INIT[:1], []))
    config = {"scenario": {"kind": "openscenario", "file": str(file)}}
    with pytest.raises(ConfigError, match=r"scenario\.file: hero: .*vehicle\.tesla\.model9"):
        judge(check_config(config))


def test_a_lane_that_the_map_lacks_fails_the_episode_in_words(
    simulator: RunningSimulator, tmp_path: Path
) -> None:
    file = tmp_path / "a.xosc"
    file.write_text(scenario(ENTITIES[:1], [placed(HERO, LANE.format(-9, 5))], []))
    result = carstage.run(configuration(simulator, file), tmp_path / "out", retries=0)
    (problem,) = result.failures.values()
    assert "scenario.file: the map has no lane -9 of road 4" in problem
