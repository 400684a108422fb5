"""Ids of many episodes: the same bytes as one specification's own canonical JSON."""

from __future__ import annotations

from carstage.config import parse_config
from carstage.plan import ServerFacts, plan_episodes
from carstage.plan.canonical import CanonicalTexts

FACTS = ServerFacts(maps={"Stage01": 100, "Stage02": 50, "My": 9}, opendrive={"My": "blake3:00"})
CONFIGURATIONS = (
    "episodes: 3",
    "{episodes: 3, map: {random_from: [all]}, weather: {random_from: [all]}}",
    "map: towns/My.xodr",
    "scenario: {kind: route, through: [3, {x: 1, y: 2.5}, 9]}",
    "ego: {spawn: {x: 1, y: -2, yaw_deg: 90}, color: [1, 2, 3]}",
    "traffic: {speed_difference_percent: [-10, 30], hybrid_physics_radius_m: 70}",
    "weather: {choice: WetNoon, changes: [{at_s: 1, choice: ClearNight}]}",
    "{map: {choice: Stage02, layers: [Buildings, Walls]}, rig: {preset: nuscenes}}",
)


def test_texts_are_the_canonical_json_whatever_came_before() -> None:
    texts = CanonicalTexts()
    for text in (*CONFIGURATIONS, *CONFIGURATIONS):
        for spec in plan_episodes(parse_config(text), FACTS):
            assert texts.canonical_json(spec) == spec.canonical_json()
