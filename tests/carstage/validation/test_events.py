"""The check of the table of events: what labels, ledger and plan contradict is found."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pytest

import analytic_scene
from carstage.annotation.events import event_rows
from carstage.annotation.schema import EVENT_COLUMNS
from carstage.conversion.segment import rows_to_table
from carstage.dataset.reading import Episode
from carstage.rawlog.reader import ActorInfo, WorldFrame
from carstage.spec import EpisodeSpec
from carstage.validation.checks.events import check_events
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables

EGO, CAR, FAR_CAR, STEPS = 5, 7, 9, 30
HALF = (2.2, 0.9, 0.7)
EVENT = {
    "kind": "stopped_vehicle", "at_s": 0.0, "distance_m": 40.0, "trigger_m": 25.0, "stand_s": 2.0,
}  # fmt: skip


def actor(actor_id: int) -> ActorInfo:
    return ActorInfo(
        actor_id, "vehicle.tesla.model3", 0, {"base_type": "car", "number_of_wheels": "4"}, (),
        np.array([0.0, 0.0, 0.7]), np.array(HALF), np.zeros(3),
    )  # fmt: skip


def frame(tick: int, state: str, actors: tuple[int, ...] = (CAR,)) -> WorldFrame:
    """The ego drives 1 m in a tick towards cars that stand 40 m and 90 m ahead."""
    rows = np.zeros((3, 3))
    location, velocity = rows.copy(), rows.copy()
    location[:, 0], velocity[0, 0] = (tick, 40.0, 90.0), 10.0
    meta = {"events": [{"state": state, "actors": list(actors), "reason": ""}]}
    ids = np.array([EGO, CAR, FAR_CAR], np.uint32)
    return WorldFrame(tick, tick, tick / 10, ids, location, rows, velocity, rows, rows, meta)


@pytest.fixture
def spec() -> EpisodeSpec:
    scenario = {"kind": "autopilot", "events": [EVENT]}
    return EpisodeSpec.from_json({**analytic_scene.spec(steps=STEPS), "scenario": scenario})


@pytest.fixture
def row(spec: EpisodeSpec) -> dict[str, Any]:
    frames = [
        frame(tick, "placed" if tick < 5 else "running" if tick < 25 else "ended")
        for tick in range(STEPS)
    ]
    (found,) = event_rows(spec, frames, {one: actor(one) for one in (EGO, CAR)}, EGO)
    return found


def problems(spec: EpisodeSpec, *rows: dict[str, Any]) -> list[str]:
    table = rows_to_table(rows, EVENT_COLUMNS, "events.parquet")
    episode = SimpleNamespace(id=spec.episode_id, spec=spec, events=lambda: table)
    ledger = pa.table({"tick": range(STEPS), "k": range(STEPS)})
    objects = pa.Table.from_pylist(
        [
            {
                "k": k,
                "track_id": track,
                "is_ego": track == EGO,
                "box_center": [x, 0.0, 0.7],
                "box_rotation_deg": [0.0, 0.0, 0.0],
                "box_extent": list(HALF),
                "velocity": [speed, 0.0, 0.0],
            }
            for k in range(STEPS)
            for track, x, speed in (
                (EGO, float(k), 10.0),
                (CAR, 40.0, 0.0),
                (FAR_CAR, 90.0, 0.0),
            )
        ]
    )
    findings = Findings("x")
    tables = LabelTables(objects, objects, objects)
    check_events(cast(Episode, episode), ledger, tables, findings)
    return [problem.message for problem in findings.problems()]


def test_the_table_says_what_the_record_shows(spec: EpisodeSpec, row: dict[str, Any]) -> None:
    assert (row["state"], row["begin_tick"], row["end_tick"]) == ("happened", 5, 24)
    assert row["actors"] == [CAR]
    assert row["min_distance"] == pytest.approx(40.0 - 24.0 - 4.4)
    assert row["min_ttc"] == pytest.approx(1.16)
    assert row["min_distance_tick"] == row["min_ttc_tick"] == 24
    assert row["collision"] is False
    assert problems(spec, row) == []


def test_works_are_as_near_as_the_nearest_of_what_stands_there() -> None:
    works = {
        "kind": "works_zone", "at_s": 0.0, "distance_m": 40.0, "trigger_m": 25.0,
        "length_m": 4.0, "extent": "close", "width_m": 0.5, "speed_m_s": 5.0,
    }  # fmt: skip
    scenario = {"kind": "autopilot", "events": [works]}
    spec = EpisodeSpec.from_json({**analytic_scene.spec(steps=STEPS), "scenario": scenario})
    frames = [frame(tick, "running", (FAR_CAR, CAR)) for tick in range(10)]
    known = {one: actor(one) for one in (EGO, CAR, FAR_CAR)}
    (row,) = event_rows(spec, frames, known, EGO)
    assert row["actors"] == [FAR_CAR, CAR]
    assert row["min_distance"] == pytest.approx(40.0 - 9.0 - 4.4)
    row = {**row, "end_tick": 9, "end_s": 0.9}
    assert problems(spec, row) == []
    (found,) = problems(spec, {**row, "min_distance": 90.0 - 9.0 - 4.4})
    assert "smallest distance" in found


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "cut_in"}, "planned"),
        ({"parameters": "{}"}, "planned"),
        ({"min_distance": 9.0}, "smallest distance"),
        ({"min_distance": 13.0}, "smallest distance"),
        ({"min_distance": None}, "no smallest distance"),
        ({"min_ttc": 3.0}, "time to collision"),
        ({"min_ttc": None}, "time to collision"),
        ({"collision": True}, "collision"),
        ({"begin_s": 0.7}, "begin is 0.7 s at tick 5"),
        ({"end_tick": 3, "end_s": 0.3}, "no order"),
        ({"state": "not placed"}, "state"),
        ({"state": "cancelled"}, "state"),
        ({"episode_id": "0"}, "episode_id"),
        ({"reason": "it rained"}, "reason"),
        ({"actors": []}, "nobody"),
    ],
)
def test_what_was_changed_is_found(
    spec: EpisodeSpec, row: dict[str, Any], change: dict[str, Any], words: str
) -> None:
    (found, *_) = problems(spec, {**row, **change})
    assert words in found


STORY = {
    "kind": "storyboard",
    "entities": [
        {"name": name, "blueprint": "vehicle.tesla.model3", "attributes": {}, "speed_m_s": 0.0,
         "place": {"kind": "world", "x_m": 0.0, "y_m": 0.0, "z_m": 0.0, "yaw_deg": 0.0}}
        for name in ("hero", "lead")
    ],
    "acts": [
        {"name": "Act", "start": None, "stop": [], "groups": [
            {"name": "Group", "actors": ["lead"], "maneuvers": [
                {"name": "Maneuver", "events": [
                    {"name": "Jump", "priority": "parallel", "most": 2, "start": None, "actions": [
                        {"kind": "teleport", "name": "There",
                         "place": {"kind": "world", "x_m": 1.0, "y_m": 0.0, "z_m": 0.0,
                                   "yaw_deg": 0.0}}
                    ]}
                ]}
            ]}
        ]}
    ],
    "stop": [],
}  # fmt: skip


def story_frame(tick: int, *states: tuple[str, int], actors: tuple[int, ...]) -> WorldFrame:
    """Frame in which the parts of the storyboard stand so: state and number of execution."""
    plain = frame(tick, "running")
    meta = {
        "events": [
            {"state": state, "actors": list(actors), "reason": "wait", "execution": number}
            for state, number in states
        ]
    }
    return dataclasses.replace(plain, meta=meta)


def story_rows(spec: EpisodeSpec, actors: tuple[int, ...] = (CAR,)) -> list[dict[str, Any]]:
    """It happens from tick 5 to 9, and in tick 10 alone."""
    states = [("placed", 1)] * 5 + [("running", 1)] * 5 + [("running", 2)]
    states += [("ended", 2)] * (STEPS - len(states))
    frames = [story_frame(tick, each, each, actors=actors) for tick, each in enumerate(states)]
    known = {one: actor(one) for one in (EGO, CAR, FAR_CAR)}
    return event_rows(spec, frames, known, EGO)


@pytest.fixture
def story() -> EpisodeSpec:
    return EpisodeSpec.from_json({**analytic_scene.spec(steps=STEPS), "scenario": STORY})


def test_what_a_storyboard_has_happen_again_has_a_row_for_each_time(story: EpisodeSpec) -> None:
    rows = story_rows(story)
    assert [(row["event"], row["kind"]) for row in rows] == [
        (0, "storyboard_event"), (0, "storyboard_event"),
        (1, "storyboard_action"), (1, "storyboard_action"),
    ]  # fmt: skip
    assert [(row["placed_tick"], row["begin_tick"], row["end_tick"]) for row in rows[:2]] == [
        (0, 5, 9), (0, 10, 10),
    ]  # fmt: skip
    assert '"execution":2' in rows[1]["parameters"]
    assert rows[1]["min_distance"] == pytest.approx(40.0 - 10.0 - 4.4)
    assert problems(story, *rows) == []


def test_the_ego_is_no_distance_from_itself(story: EpisodeSpec) -> None:
    assert {row["min_distance"] for row in story_rows(story, (EGO,))} == {None}
    rows = story_rows(story, (EGO, FAR_CAR))
    assert rows[0]["min_distance"] == pytest.approx(90.0 - 9.0 - 4.4)
    assert rows[0]["actors"] == [EGO, FAR_CAR]
    assert problems(story, *rows) == []


def test_rows_that_a_storyboard_cannot_have_are_found(story: EpisodeSpec) -> None:
    rows = story_rows(story)
    third = {
        **rows[1],
        "parameters": rows[1]["parameters"].replace('"execution":2', '"execution":3'),
    }
    for wrong in (rows[1:], [*rows[:2], third, *rows[2:]], rows[2:] + rows[:2]):
        (found, *_) = problems(story, *wrong)
        assert "planned" in found
    alone = {**rows[0], "actors": [EGO]}
    (found, *_) = problems(story, alone, *rows[1:])
    assert "only the ego" in found
