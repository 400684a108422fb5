"""Who drives the ego: what is understood, what is refused and how, and which ids follow."""

from __future__ import annotations

import json
from typing import Any

import pytest

from carstage.config import parse_config
from carstage.config.drivers import ClassDriver, RouteDriver
from carstage.errors import ConfigError
from carstage.plan import ServerFacts, plan_episodes
from carstage.spec import ClassDriverSpec, ComfortSpec, DeviceDriverSpec, EpisodeSpec

FACTS = ServerFacts(maps={"Stage01": 100})
NO_CAMERA = "rig: {sensors: [{id: IMU, kind: imu}]}"


def spec_of(driver: str, rest: str = "") -> EpisodeSpec:
    (spec,) = plan_episodes(parse_config(f"ego: {{driver: {driver}}}\n{rest}"), FACTS)
    return spec


def test_the_autopilot_leaves_the_id_as_it_was() -> None:
    (without,) = plan_episodes(parse_config("map: Stage01"), FACTS)
    for driver in ("autopilot", "{kind: autopilot}"):
        spec = spec_of(driver)
        assert spec.ego.driver is None
        assert "driver" not in spec.to_json()["ego"]
        assert spec.episode_id == without.episode_id


def test_short_forms_stand_for_sections() -> None:
    assert parse_config("ego: {driver: route}").ego.driver == RouteDriver(kind="route")
    found = parse_config("ego: {driver: 'pkg.mine:Slalom'}").ego.driver
    assert found == ClassDriver(kind="class", name="pkg.mine:Slalom")
    assert isinstance(found, ClassDriver)
    assert found.folders == (".",)


@pytest.mark.parametrize(
    "driver",
    [
        "route",
        "{kind: route, speed_m_s: 4.5, turns: [left, straight]}",
        "'mine:Slalom'",
        "{kind: class, name: 'mine:Slalom', parameters: {a: 0.5, b: 3, c: true, d: fast}}",
        "keyboard",
        "{kind: wheel, throttle_axis: 7, take: 3}",
        "{kind: gamepad, where: page}",
    ],
)
def test_the_json_form_gives_the_specification_back(driver: str) -> None:
    spec = spec_of(driver)
    again = EpisodeSpec.from_json(json.loads(spec.canonical_json()))
    assert again == spec
    assert again.episode_id == spec.episode_id != spec_of("autopilot").episode_id


def test_a_device_in_a_window_has_the_id_that_it_had() -> None:
    window = spec_of("{kind: gamepad, where: window}")
    assert window == spec_of("gamepad")
    assert "at_page" not in window.to_json()["ego"]["driver"]
    at_page = spec_of("{kind: gamepad, where: page}")
    assert at_page.to_json()["ego"]["driver"]["at_page"] is True
    assert at_page.episode_id != window.episode_id


def test_parameters_and_takes_are_part_of_the_id_and_folders_are_not() -> None:
    def with_class(**keys: Any) -> str:
        return spec_of(json.dumps({"kind": "class", "name": "mine:Slalom", **keys})).episode_id

    plain = with_class()
    assert with_class(folders=["elsewhere"]) == plain
    assert with_class(parameters={"version": 2}) != plain
    assert spec_of("{kind: keyboard, take: 2}").episode_id != spec_of("keyboard").episode_id


def test_a_device_shows_the_first_colour_camera() -> None:
    rig = "rig: {sensors: [{id: D, kind: depth}, {id: A, kind: rgb}, {id: B, kind: rgb}]}"
    assert spec_of("keyboard", rig).ego.driver == DeviceDriverSpec("keyboard", "A")
    chosen = spec_of("{kind: gamepad, camera: B}", rig).ego.driver
    assert isinstance(chosen, DeviceDriverSpec)
    assert chosen.camera == "B"
    assert chosen.inputs["steer_axis"] == 0


@pytest.mark.parametrize(
    ("text", "begin", "hint"),
    [
        ("ego: {driver: slalom}", "ego.driver: 'slalom' is neither", "module:Class"),
        ("ego: {driver: 'my driver:Slalom'}", "ego.driver: 'my driver:Slalom' is", "module:Class"),
        ("ego: {driver: {kind: pilot}}", "ego.driver.kind: unknown kind 'pilot'", "autopilot"),
        ("ego: {driver: {kind: class}}", "ego.driver.name: this is missing", "Add"),
        (
            "ego: {driver: {kind: class, name: 'a:b:c'}}",
            "ego.driver.name: 'a:b:c' is not",
            "Slalom",
        ),
        (
            "ego: {driver: {kind: class, name: 'a:B', parameters: {x: [1]}}}",
            "ego.driver.parameters.x",
            "",
        ),
        (
            "ego: {driver: {kind: class, name: 'a:B', parameters: {a-b: 1}}}",
            "ego.driver.parameters.a-b: this cannot be",
            "letters",
        ),
        ("ego: {driver: {kind: route, speed_m_s: 0}}", "ego.driver.speed_m_s: 0", "more than 0"),
        ("ego: {driver: {kind: route, turns: [up]}}", "ego.driver.turns[0]: unknown", "left"),
        (
            "{ego: {driver: route}, scenario: {kind: stationary}}",
            "ego.driver: in scenario",
            "route",
        ),
        ("{ego: {driver: route}, timing: {mode: async}}", "ego.driver: a driver needs", "sync"),
        (f"{{ego: {{driver: keyboard}}, {NO_CAMERA}}}", "ego.driver: the window shows", "rgb"),
        ("ego: {driver: {kind: wheel, camera: X}}", "ego.driver.camera: unknown rgb camera", ""),
        ("ego: {driver: replay}", "ego.driver.episode: this is missing", "Add"),
    ],
)
def test_a_wrong_driver_is_refused_with_its_path(text: str, begin: str, hint: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config(text)
    assert caught.value.message.startswith(begin), caught.value.message
    assert hint in caught.value.hint


def test_a_specification_of_a_class_needs_a_name_of_that_form() -> None:
    document = spec_of("'mine:Slalom'").to_json()
    assert document["ego"]["driver"] == {
        "kind": "class", "name": "mine:Slalom", "parameters": {},
    }  # fmt: skip
    document["ego"]["driver"]["name"] = "mine"
    with pytest.raises(ValueError, match=r"^spec\.ego\.driver\.name: 'mine' is not module:Class"):
        EpisodeSpec.from_json(document)
    assert ClassDriverSpec("a.b:C").name == "a.b:C"


def test_comfort_is_part_of_the_id_where_it_is_asked_for() -> None:
    usual = spec_of("autopilot")
    assert usual.ego.comfort is None
    assert "comfort" not in json.loads(usual.canonical_json())["ego"]
    gentle = spec_of("{kind: autopilot, comfort: true}")
    slow = spec_of("{kind: autopilot, comfort: true, acceleration_m_s2: 1.0, gap_s: 3}")
    assert gentle.ego.comfort == ComfortSpec()
    assert slow.ego.comfort == ComfortSpec(acceleration_m_s2=1.0, gap_s=3.0)
    assert len({usual.episode_id, gentle.episode_id, slow.episode_id}) == 3
    for spec in (gentle, slow):
        assert EpisodeSpec.from_json(json.loads(spec.canonical_json())) == spec


def test_comfort_of_an_agent_is_its_own() -> None:
    driver, rig = "{kind: autopilot, comfort: true}", "{sensors: [{id: I, kind: imu}]}"
    agents = f"agents: [{{name: a, driver: {driver}, rig: {rig}}}]"
    spec = spec_of("autopilot", agents)
    assert spec.agents[0].ego.comfort == ComfortSpec()
    assert spec.ego.comfort is None
    assert EpisodeSpec.from_json(json.loads(spec.canonical_json())) == spec


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", []),
        ("timing: {mode: async}", ["ego.driver.comfort: only a world that waits"]),
        ("scenario: {kind: stationary}", ["ego.driver.comfort: in scenario stationary nobody"]),
    ],
)
def test_comfort_that_does_nothing_is_told(text: str, said: list[str]) -> None:
    driver = "ego: {driver: {kind: autopilot, comfort: true}}\n"
    found = parse_config(driver + text).warnings()
    assert [sentence[: len(begin)] for sentence, begin in zip(found, said, strict=True)] == said
