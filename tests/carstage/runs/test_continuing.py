"""A run goes on with what a dataset holds, or asks before it records something else beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from carstage.config import check_config, dump_config
from carstage.runs.continuing import (
    OtherSettingsError,
    differences,
    environment_of,
    refuse_to_mix,
)

EPISODE = "0123456789abcdef"
ENVIRONMENT = environment_of("0.9.16", "0.9.16")


def settings(**changes: Any) -> dict[str, Any]:
    return dump_config(check_config({"name": "here", **changes}))


def earlier_run(
    out: Path, environment: dict[str, str] | None = ENVIRONMENT, name: str = "first", **changes: Any
) -> None:
    plan = {"config": settings(**changes), "episodes": [{"episode_id": EPISODE}]}
    if environment is not None:
        plan["environment"] = environment
    folder = out / "runs" / name
    folder.mkdir(parents=True)
    (folder / "plan.json").write_text(json.dumps(plan))


def go_on(out: Path, environment: dict[str, str] | None = ENVIRONMENT, **changes: Any) -> None:
    refuse_to_mix(out, out, [EPISODE], [EPISODE], settings(**changes), environment)


def test_equal_settings_go_on_without_a_question(tmp_path: Path) -> None:
    earlier_run(tmp_path)
    go_on(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        {"name": "there"},
        {"episodes": 7},
        {"output": {"keep_raw": True}},
        {"conversion": {"mode": "deferred", "workers": 3}},
        {"server": {"threads": 1, "port": 4000, "self_test": "off", "restart_every": 2}},
        {"supervision": {"hang_s": 5}},
        {"campaign": {"quotas": [{"name": "many", "frames": 9}]}},
    ],
    ids=lambda change: next(iter(change)),
)
def test_how_much_and_by_what_means_is_no_other_setting(
    change: dict[str, Any], tmp_path: Path
) -> None:
    earlier_run(tmp_path)
    go_on(tmp_path, **change)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"fps": 20}, "fps is 20.0, was 10.0"),
        ({"seed": 8}, "seed is 8, was 7"),
        ({"labels": {"method": "pixels"}}, 'labels.method is "pixels", was "both"'),
        (
            {"conversion": {"codecs": {"CAM_FRONT": "jpeg"}}},
            'conversion.codecs.CAM_FRONT is "jpeg"',
        ),
        ({"server": {"carla_version": "0.9.15"}}, 'server.carla_version is "0.9.15"'),
        ({"server": {"kind": "remote"}}, 'server.kind is "remote", was "embedded"'),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_other_settings_are_named(change: dict[str, Any], named: str, tmp_path: Path) -> None:
    earlier_run(tmp_path)
    with pytest.raises(OtherSettingsError) as refused:
        go_on(tmp_path, **change)
    assert named in refused.value.message
    assert "--append" in refused.value.hint
    assert refused.value.exit_code == 2


NIGHT = {"weather": {"choice": "ClearNight"}}
NOON = {"weather": {"choice": "ClearNoon"}}


def test_a_variant_more_is_no_other_setting(tmp_path: Path) -> None:
    earlier_run(tmp_path, variants={"noon": NOON, "night": NIGHT})
    go_on(tmp_path, variants={"noon": NOON, "night": NIGHT, "small": {"image_size": [64, 48]}})
    go_on(tmp_path, variants={"night": NIGHT})
    with pytest.raises(OtherSettingsError, match=r"variants\.night\.weather\.choice is"):
        go_on(tmp_path, variants={"noon": NOON, "night": NOON})
    with pytest.raises(OtherSettingsError, match=r"variants"):
        go_on(tmp_path)


def test_the_first_weather_of_a_variant_is_another_setting(tmp_path: Path) -> None:
    plain = {"noon": {}, "small": {"image_size": [64, 48]}}
    earlier_run(tmp_path, variants=plain)
    with pytest.raises(OtherSettingsError, match=r"variants\.night\.weather"):
        go_on(tmp_path, variants={**plain, "night": NIGHT})  # its water would not take grip
    earlier_run(tmp_path, name="dry", variants=plain, server={"wet_grip": "off"})
    go_on(tmp_path, variants={**plain, "night": NIGHT}, server={"wet_grip": "off"})


@pytest.mark.parametrize("what", ["carstage", "client", "server", "python", "numpy"])
def test_another_version_or_environment_is_named(what: str, tmp_path: Path) -> None:
    earlier_run(tmp_path, {**ENVIRONMENT, what: "0.0"})
    with pytest.raises(OtherSettingsError, match=rf'{what} is "[^"]+", was "0\.0"'):
        go_on(tmp_path)
    go_on(tmp_path, None)  # before the server is known, settings alone are compared


def test_run_of_a_version_that_kept_no_environment_is_judged_by_its_settings(
    tmp_path: Path,
) -> None:
    earlier_run(tmp_path, None)
    go_on(tmp_path)
    with pytest.raises(OtherSettingsError, match="fps"):
        go_on(tmp_path, fps=20)


def test_one_run_of_these_settings_is_enough(tmp_path: Path) -> None:
    earlier_run(tmp_path)
    earlier_run(tmp_path, name="second", fps=20)
    go_on(tmp_path)
    go_on(tmp_path, fps=20)
    with pytest.raises(OtherSettingsError, match=r"fps is 30\.0"):
        go_on(tmp_path, fps=30)


def test_the_most_similar_run_is_the_one_compared_with(tmp_path: Path) -> None:
    earlier_run(tmp_path, name="first", fps=20, seed=3, duration_s=9)
    earlier_run(tmp_path, name="second", seed=3)
    with pytest.raises(OtherSettingsError) as refused:
        go_on(tmp_path)
    assert "recorded otherwise: seed is 7, was 3." in refused.value.message


def test_only_runs_whose_episodes_are_there_count(tmp_path: Path) -> None:
    earlier_run(tmp_path, fps=20)
    refuse_to_mix(tmp_path, tmp_path, [], [EPISODE], settings(), ENVIRONMENT)


def test_without_the_folders_of_runs_the_ids_of_episodes_tell(tmp_path: Path) -> None:
    refuse_to_mix(tmp_path, tmp_path, [EPISODE], [EPISODE], settings(), ENVIRONMENT)
    with pytest.raises(OtherSettingsError, match="holds 1 episode of other settings"):
        refuse_to_mix(tmp_path, tmp_path, [EPISODE], ["f" * 16], settings(), ENVIRONMENT)


def test_many_differences_are_counted(tmp_path: Path) -> None:
    earlier_run(tmp_path)
    changes = {"fps": 20, "seed": 1, "duration_s": 1, "save_every": 2, "max_distance_m": 5}
    with pytest.raises(OtherSettingsError, match="and 3 more"):
        go_on(tmp_path, **changes, min_lidar_points=1, image_size=[64, 48], map="Stage02")


def test_damaged_plans_are_no_runs(tmp_path: Path) -> None:
    for name, content in (
        ("a", "{"),
        ("b", "[]"),
        ("c", '{"episodes": 3}'),
        ("d", '{"episodes": [1]}'),
    ):
        (tmp_path / "runs" / name).mkdir(parents=True)
        (tmp_path / "runs" / name / "plan.json").write_text(content)
    go_on(tmp_path)


def test_a_setting_of_another_version_is_a_difference() -> None:
    run = {"config": {"fps": 10.0, "old": []}}
    assert differences(run, {"fps": 10.0, "new": "x"}, None) == [
        'new is "x", was not there',
        "old is not there, was []",
    ]


def test_settings_in_the_words_of_an_earlier_version_are_equal(tmp_path: Path) -> None:
    earlier_run(tmp_path, scenario={"kind": "stationary"})
    path = tmp_path / "runs" / "first" / "plan.json"
    plan = json.loads(path.read_text())
    plan["config"]["scenario"]["kind"] = "hold"  # until 0.1
    del plan["config"]["labels"]["lidars"]  # came later
    path.write_text(json.dumps(plan))
    go_on(tmp_path, scenario={"kind": "stationary"})
    with pytest.raises(OtherSettingsError, match="fps is 20"):
        go_on(tmp_path, scenario={"kind": "stationary"}, fps=20)


def test_settings_that_are_no_longer_allowed_are_compared_as_they_stand(tmp_path: Path) -> None:
    earlier_run(tmp_path)
    path = tmp_path / "runs" / "first" / "plan.json"
    plan = json.loads(path.read_text())
    plan["config"]["dropped"] = 3
    path.write_text(json.dumps(plan))
    with pytest.raises(OtherSettingsError, match="dropped is not there, was 3"):
        go_on(tmp_path)
