"""Sampled settings: read where they stand, checked by their ends, refused in the user's words."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from carstage.annotation.classes import WALKER_CLASSES
from carstage.config import Config, check_config, dump_config, parse_config
from carstage.config.campaign import OBJECT_GROUPS
from carstage.config.dimensions import crossed, dimensions, maps_of
from carstage.errors import ConfigError
from carstage.spec.vehicle_classes import VEHICLE_CLASSES

WHOLE = """
vehicles: {count: {range: [10, 50]}}
duration_s: {choice: [5, 10], weights: [3, 1]}
weather:
  choice: [ClearNoon, WetNoon]
  parameters: {fog_density: {normal: [20, 9], min: 0, max: 50}}
map: {choice: {choice: [Stage01, Stage02]}}
image_size: {choice: [[64, 36], [128, 72]]}
rig: {sensors: [{id: CAM, kind: rgb, attributes: {fov_deg: {range: [60, 90], steps: 4}}}]}
campaign: {method: stratified, strata: [map.choice, weather.choice], repeats: 2}
"""
DRIVER = "ego: {driver: {kind: class, name: 'a:B', parameters: %s}}"


def test_each_sampled_setting_is_a_dimension_by_its_path() -> None:
    found = {one.name: one for one in dimensions(parse_config(WHOLE))}
    assert sorted(found) == [
        "duration_s",
        "image_size",
        "map.choice",
        "rig.sensors[0].attributes.fov_deg",
        "vehicles.count",
        "weather.choice",
        "weather.parameters.fog_density",
    ]
    assert [one.name for one in found.values() if one.is_integer] == ["vehicles.count"]
    assert found["rig.sensors[0].attributes.fov_deg"].levels == (60, 70, 80, 90)


def test_what_was_written_down_reads_the_same() -> None:
    config = parse_config(WHOLE)
    assert check_config(dump_config(config)) == config


def test_a_configuration_without_samples_is_as_before() -> None:
    assert parse_config("fps: 20").campaign is None
    assert "campaign" not in dump_config(Config())


def test_a_list_of_maps_or_weathers_is_a_choice_of_them() -> None:
    config = parse_config("{map: {choice: [A, B], weights: [1, 2], layers: [Walls]}}")
    (dimension,) = dimensions(config)
    assert (dimension.name, dimension.sampled.choice) == ("map.choice", ("A", "B"))
    assert config.map.layers == ("Walls",)
    assert maps_of(config) == ("A", "B")


def test_strata_and_grids_decide_how_many_episodes_there_are() -> None:
    assert parse_config(WHOLE).episodes == 2 * 2 * 2
    assert parse_config(WHOLE + "episodes: 3").episodes == 3
    grid = "{vehicles: {count: {range: [1, 3], steps: 9}}, fps: {choice: [10, 20]}, campaign: %s}"
    config = parse_config(grid % "{method: grid}")
    assert config.episodes == 3 * 2  # there are three whole numbers from 1 to 3
    assert [one.levels for one in crossed(config)] == [(10, 20), (1, 2, 3)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("vehicles: {count: {range: [10, 5000]}}", "vehicles.count.range[1]: 5000 is too large."),
        ("vehicles: {count: {range: [-1, 50]}}", "vehicles.count.range[0]: -1 is too small."),
        ("vehicles: {count: {range: [1.5, 5]}}", "vehicles.count.range[0]: 1.5 is not a whole"),
        ("vehicles: {count: {range: [5]}}", "vehicles.count.range[1]: this is missing."),
        ("vehicles: {count: {range: [5, 1]}}", "vehicles.count.range: 5 is not below 1."),
        ("vehicles: {count: {range: [1, 5], step: 2}}", "vehicles.count.step: unknown key"),
        ("vehicles: {count: {range: [1, 1e300]}}", "vehicles.count.range[1]: 1e+300 is too large."),
        ("vehicles: {cuont: {range: [1, 5]}}", "vehicles.cuont.range[0]: unknown key 'cuont'."),
        ("fps: {choice: [10, 500]}", "fps.choice[1]: 500 is too large."),
        ("fps: {choice: []}", "fps.choice: [] has too few entries."),
        ("fps: {choice: [10, 20], weights: [1]}", "fps.weights: 1 weights are not one for each"),
        ("fps: {choice: [10, 20], weights: [1, -1]}", "fps.weights[1]: -1 is too small."),
        ("fps: {choice: [10, 20], weights: [0, 0]}", "fps.weights: all of them are 0."),
        ("fps: {choice: [10, 20], range: [1, 2]}", "fps.choice: range and choice is given."),
        ("fps: {choice: [10, 20], steps: 3}", "fps.steps: it goes with range, not choice."),
        ("fps: {normal: [10, 2]}", "fps.min: this is missing."),
        ("fps: {normal: [10, 2], min: 5, max: 500}", "fps.max: 500 is too large."),
        ("fps: {normal: [10, 0], min: 5, max: 50}", "fps.normal[1]: 0 is no deviation."),
        ("fps: {normal: [10, 1], min: 50, max: 60}", "fps.normal: hardly any value of it"),
        ("map: {choice: [Stage01, '..']}", "map.choice[1]: '..' cannot be a map's name."),
        ("weather: {choice: [ClearNoon, Wet]}", "weather.choice[1]: unknown weather preset 'Wet'."),
        ("traffic: {choice: [{distance_m: {range: [1, 2]}}]}", "traffic.choice[0]: a choice holds"),
        ("server: {port: {range: [2000, 3000]}}", "server.port: it is the same in all episodes"),
        ("rig: {preset: {choice: [demo, kitti]}}", "rig.preset: it is the same in all episodes"),
        (
            "rig: {sensors: [{id: A, kind: {choice: [lidar, radar]}}]}",
            "rig.sensors[0].kind: it is the same in all episodes",
        ),
        ("seed: {range: [1, 2]}", "seed: it is the same in all episodes"),
        (
            "scenario: {choice: [{kind: replay, episode: x}]}",
            "scenario.choice[0]: what a file tells",
        ),
        ("scenario: {choice: [{kind: log, file: x}]}", "scenario.choice[0]: what a file tells"),
        ("scenario: {choice: [{kind: scenic, file: x}]}", "scenario.choice[0]: what a file tells"),
        ("campaign: {sample: {'..': {range: [1, 2]}}}", "campaign.sample...: this is no path"),
        (
            "{ego: {spawn: {choice: [1, 2]}}, agents: [{name: a, spawn: 2, rig: {preset: demo}}]}",
            "ego.spawn.choice[1]: spawn point 2 is that of 'ego'.",
        ),
        (
            "{ego: {choice: [{spawn: 3}, {driver: route}]}, timing: {mode: async}}",
            "ego.choice[1].driver: a driver needs a world that waits for each step.",
        ),
        (DRIVER % "{range: [1, 5]}", "ego.driver.parameters.range: [1, 5] is no word"),
        (DRIVER % "{choice: [a, b], q: 1}", "ego.driver.parameters.choice: ['a', 'b'] is no word"),
        (DRIVER % "{choice: [{min: null}]}", "ego.driver.parameters.choice[0].min: None is no"),
        (DRIVER % "{choice: [{choice: null}]}", "ego.driver.parameters.choice[0].choice: None is"),
        (DRIVER % "{choice: [{a: 1}, {a: null}]}", "ego.driver.parameters.choice[1].a: None is"),
        ("campaign: {method: gird}", "campaign.method: unknown value 'gird'."),
        ("campaign: {method: stratified}", "campaign.strata: no strata are named."),
        ("campaign: {strata: [fps]}", "campaign.strata: it goes with method stratified."),
        ("campaign: {repeats: 2}", "campaign.repeats: it goes with grid and stratified."),
        ("{fps: {range: [10, 20]}, campaign: {method: grid}}", "fps: it is no choice and no range"),
        (
            "{fps: {choice: [10, 20], weights: [1, 2]}, campaign: {method: grid}}",
            "fps: weights have no place in a grid.",
        ),
        (
            "{map: {choice: [A, B]}, campaign: {method: stratified, strata: [map]}}",
            "campaign.strata[0]: unknown sampled setting 'map'.",
        ),
        (
            "{fps: {range: [10, 20], steps: 9999}, duration_s: {range: [1, 2], steps: 99}, "
            "campaign: {method: grid}}",
            "campaign.method: 989901 combinations are more than 100000 episodes.",
        ),
        (
            "campaign: {quotas: [{name: a, frames: 1, where: {objects: [car, cart]}}]}",
            "campaign.quotas[0].where.objects[1]: unknown class 'cart'.",
        ),
        (
            "campaign: {quotas: [{name: a, frames: 1}, {name: a, frames: 2}]}",
            "campaign.quotas[1].name: 'a' is the name of another quota.",
        ),
        (
            "campaign: {quotas: [{name: a, frames: 1, where: {min_distance_m: 3}}]}",
            "campaign.quotas[0].where.min_distance_m: of which objects?",
        ),
        (
            "{labels: {boxes: [2d]}, campaign: {quotas: [{name: a, frames: 1, where: "
            "{objects: car, max_distance_m: 3}}]}}",
            "campaign.quotas[0].where: nothing tells without `3d` in labels.boxes.",
        ),
        (
            "{ground_truth: {ego_motion: false}, campaign: {quotas: [{name: a, frames: 1, where: "
            "{sun_altitude_below_deg: 0}}]}}",
            "campaign.quotas[0].where: nothing tells without ground_truth.ego_motion: true.",
        ),
    ],
)
def test_what_cannot_be_sampled_is_refused_where_it_stands(text: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config(text)
    assert caught.value.message.startswith(message)


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("{range: 5, a: {range: [1, 5]}}", "ego.driver.parameters.a"),
        ("{range: {range: [1, 5]}}", "ego.driver.parameters.range"),
        ("{choice: {choice: [1, 5]}}", "ego.driver.parameters.choice"),
        ("{choice: [{range: 1}, {range: 2}]}", "ego.driver.parameters"),
    ],
)
def test_arguments_of_any_name_are_sampled(given: str, name: str) -> None:
    assert [one.name for one in dimensions(parse_config(DRIVER % given))] == [name]


def test_every_choice_at_fault_is_named() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config("{fps: {choice: [500, 10, 600]}, vehicles: {count: {range: [-1, 3]}}}")
    named = {path for path, _, _ in caught.value.problems}
    assert ("vehicles", "count", "range", 0) in named
    assert ("fps", "choice", 0) in named


@given(low=st.integers(-50, 1050), span=st.integers(1, 500))
def test_a_range_is_allowed_when_both_ends_are(low: int, span: int) -> None:
    text = f"vehicles: {{count: {{range: [{low}, {low + span}]}}}}"
    if low >= 0 and low + span <= 1000:
        assert parse_config(text).campaign is not None
    else:
        with pytest.raises(ConfigError, match=r"vehicles\.count\.range\[[01]\]: "):
            parse_config(text)


def test_an_override_may_sample_and_may_fix() -> None:
    assert parse_config("", ["vehicles.count={range: [1, 5]}"]).campaign is not None
    fixed = parse_config("vehicles: {count: {range: [1, 5]}}", ["vehicles.count=3"])
    assert (fixed.campaign, fixed.vehicles.count) == (None, 3)


def test_groups_of_objects_are_the_classes_of_labels() -> None:
    assert OBJECT_GROUPS == {"vehicle": VEHICLE_CLASSES, "pedestrian": WALKER_CLASSES}
