"""Broken configurations, thousands of kinds: each is refused with the path of what is broken.

400 of them by default; CARSTAGE_FUZZ_EXAMPLES=2000 for a campaign.
"""

from __future__ import annotations

import copy
import os
import subprocess
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from carstage.config import check_config, dump_config
from carstage.config.fields import path_text
from carstage.errors import ConfigError
from carstage.plan import ServerFacts, plan_episodes

EXAMPLES = int(os.environ.get("CARSTAGE_FUZZ_EXAMPLES", "400"))
Path = tuple[str | int, ...]

WHOLE: dict[str, Any] = {
    "name": "fuzz",
    "seed": 3,
    "episodes": 2,
    "duration_s": 3.0,
    "fps": 10.0,
    "save_every": 2,
    "map": {"choice": "Stage01", "layers": ["Buildings", "Props"]},
    "weather": {
        "choice": "WetNoon",
        "parameters": {"cloudiness": 10.0, "fog_density": 3.0},
        "lights": "auto",
        "changes": [
            {"at_s": 1.0, "choice": "ClearSunset", "parameters": {}},
            {"at_s": 2.0, "parameters": {"wetness": 80.0}},
        ],
    },
    "vehicles": {
        "count": 5,
        "filter": "vehicle.*",
        "radius_m": 60.0,
        "generation": "1",
        "groups": [{"count": 2, "filter": "vehicle.*", "base_type": "car", "generation": "all"}],
        "shortfall": "fill",
    },
    "pedestrians": {
        "count": 4,
        "filter": "walker.*",
        "running_percent": 20.0,
        "crossing_percent": 5.0,
        "in_groups_percent": 40.0,
        "wheelchair_percent": 2.0,
        "shortfall": "warn",
    },
    "traffic": {
        "speed_difference_percent": [-10.0, 30.0],
        "distance_m": 3.0,
        "lane_changes": True,
        "ignore_walkers_percent": 1.0,
        "hybrid_physics_radius_m": 50.0,
    },
    "ego": {
        "blueprint": "vehicle.tesla.model3",
        "spawn": {"x": 1.0, "y": 2.0, "z": 0.3, "yaw_deg": 90.0},
        "color": [1, 2, 3],
    },
    "scenario": {"kind": "route", "through": [3, {"x": 4.0, "y": 5.0}]},
    "timing": {
        "mode": "sync",
        "sensor_sync": False,
        "substepping": {"max_substep_delta_time_s": 0.01, "max_substeps": 10},
        "on_incomplete": "wait",
        "warmup_ticks": 5,
    },
    "image_size": [64, 36],
    "max_distance_m": 80.0,
    "min_lidar_points": 5,
    "ground_truth": {"vehicles": True, "pedestrians": True, "ego_motion": True},
    "labels": {
        "method": "both",
        "boxes": ["2d"],
        "cameras": ["CAM"],
        "min_visible_px": 10,
        "stage_vo_strict": False,
    },
    "rig": {
        "preset": "kitti",
        "sensors": [
            {
                "id": "CAM",
                "kind": "rgb",
                "pose": {"x": 1.0, "z": 2.0, "yaw_deg": 10.0},
                "attach_to": "ego",
                "attachment": "follow",
                "attributes": {"fov_deg": 80.0, "iso": 100.0, "exposure_mode": "manual"},
            },
            {"id": "LIDAR", "kind": "lidar", "attributes": {"channels": 16, "range_m": 50.0}},
            {"id": "RADAR", "kind": "radar", "rate_hz": 5.0, "attach_to": "vehicle.*"},
            {"id": "FLOW", "kind": "flow", "attributes": {"image_size": [32, 18]}},
        ],
    },
    "server": {"kind": "embedded", "port": 3000, "threads": 1, "restart_every": 2},
    "supervision": {"hang_s": 30.0, "server_memory": 4000, "collector_memory": "auto"},
    "conversion": {"mode": "streaming", "workers": 1, "codecs": {"CAM": "png"}},
    "output": {"keep_raw": True},
}
FACTS = ServerFacts(maps={"Stage01": 50})
#: Numbers without bounds of their own: CARLA's to judge.
UNBOUNDED = {"through"}
#: Words that are not from a list: any text will do, or the server judges it.
FREE_TEXT = {"name", "id", "filter", "base_type", "blueprint", "codecs", "CAM"}


def nodes(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Every value of a document with its path."""
    yield path, value
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, below in items:
            yield from nodes(below, (*path, key))


NODES = list(nodes(WHOLE))
SCALARS = [(path, value) for path, value in NODES if not isinstance(value, dict | list)]
MAPPINGS = [path for path, value in NODES if isinstance(value, dict) and path[-1:] != ("codecs",)]
NUMBERS = [
    path
    for path, value in SCALARS
    if isinstance(value, int | float) and not isinstance(value, bool)
    if not UNBOUNDED & {step for step in path if isinstance(step, str)}
    if path[-1] != "iso"
]
WORDS = [path for path, value in SCALARS if isinstance(value, str) and path[-1] not in FREE_TEXT]


def at(document: Any, path: Path) -> Any:
    for step in path:
        document = document[step]
    return document


def broken(path: Path, value: Any) -> dict[str, Any]:
    document = copy.deepcopy(WHOLE)
    at(document, path[:-1])[path[-1]] = value
    return document


def wrong_kind(value: Any) -> st.SearchStrategy[Any]:
    """Values of kinds that are never right where ``value`` stands."""
    kinds: dict[type, list[Any]] = {
        bool: ["yes", 1, 0.5, [True]],
        str: [7, 1.5, True, ["a"]],
        int: ["many", True, [[1]], {"nothing": 1}],
        float: ["much", True, [[1.0]], {"nothing": 1}],
    }
    return st.sampled_from(kinds[type(value)])


@st.composite
def mistakes(draw: st.DrawFn) -> tuple[dict[str, Any], Path]:
    """A document with one mistake, and where it is."""
    what = draw(st.sampled_from(["kind of value", "number", "word", "key", "not finite"]))
    if what == "kind of value":
        path, value = draw(st.sampled_from(SCALARS))
        wrong = draw(wrong_kind(value))
        # A list of choices is right anywhere: it is drawn from.
        assume(not (path[-1] == "choice" and isinstance(wrong, list)))
        return broken(path, wrong), path
    if what == "key":
        path = draw(st.sampled_from(MAPPINGS))
        known = st.sampled_from(sorted(at(WHOLE, path)) or ["x"])
        word = draw(st.text("abcdefgxyz_", min_size=1, max_size=8))
        key = draw(known) + "_" + word + "_"
        return broken((*path, key), 1), (*path, key)
    if what == "word":
        path = draw(st.sampled_from(WORDS))
        letters = st.text("abcdefghijklmnopqrstuvwxyz", min_size=1, max_size=6)
        return broken(path, "no-" + draw(letters)), path
    path = draw(st.sampled_from(NUMBERS))
    if what == "number":
        size = draw(st.integers(19, 30))
        return broken(path, draw(st.sampled_from([-1, 1])) * 10**size), path
    return broken(path, draw(st.sampled_from([float("nan"), float("inf")]))), path


def test_the_whole_document_is_right() -> None:
    assert len(plan_episodes(check_config(WHOLE), FACTS)) == 2


@settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
@given(mistake=mistakes())
def test_a_broken_configuration_is_refused_where_it_is_broken(
    mistake: tuple[dict[str, Any], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def start_nothing(*_: object, **__: object) -> None:
        raise AssertionError("a process would have been started")

    monkeypatch.setattr(subprocess, "Popen", start_nothing)
    document, path = mistake
    with pytest.raises(ConfigError) as caught:
        plan_episodes(check_config(document), FACTS)
    field = path_text(path)
    lines = caught.value.message.splitlines()
    assert any(line.startswith((f"{field}:", f"{field}.", f"{field}[")) for line in lines), (
        f"{field} is broken, but: {caught.value}"
    )
    assert str(caught.value).strip() != caught.value.message.strip(), "no way out is told"


PLAIN = st.one_of(
    st.sampled_from(
        [None, True, "all", "auto", "random", [], {}, [1, 2], {"count": 3}, {"kind": "x"}]
    ),
    st.integers(-3, 300),
    st.integers(-(2**80), 2**80),
    st.floats(-1e300, 1e300),
    st.floats(0.5, 100.0),
)


@st.composite
def samples(draw: st.DrawFn) -> dict[str, Any]:
    """What says how a setting is sampled, right or wrong."""
    kind = draw(st.sampled_from(["range", "choice", "normal"]))
    found: dict[str, Any] = {kind: draw(st.lists(PLAIN, max_size=4))}
    if kind == "range" and draw(st.booleans()):
        low = draw(st.integers(0, 50))
        found[kind] = [low, low + draw(st.integers(1, 60))]
    if kind == "normal" and draw(st.booleans()):
        found |= {"normal": [draw(st.integers(1, 30)), 3], "min": 1, "max": 40}
    for key in draw(st.lists(st.sampled_from(["steps", "weights", "min", "max", "x"]), max_size=1)):
        found[key] = draw(st.one_of(PLAIN, st.lists(PLAIN, max_size=3)))
    return found


@settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
@given(
    where=st.lists(st.sampled_from([path for path, _ in NODES if path]), min_size=1, max_size=3),
    data=st.data(),
    method=st.sampled_from(["random", "grid", "latin_hypercube", "stratified"]),
)
def test_whatever_is_sampled_is_planned_or_refused_with_its_path(
    where: list[Path], data: st.DataObject, method: str
) -> None:
    document = copy.deepcopy(WHOLE)
    document["campaign"] = {"method": method}
    if method == "stratified":
        document["campaign"]["strata"] = [path_text(where[0])]
    for path in where:
        try:
            at(document, path[:-1])[path[-1]] = data.draw(samples())
        except (KeyError, IndexError, TypeError):
            continue  # a sample stands above it
    refused: ConfigError | None = None
    try:
        config = check_config(document)
        assert check_config(dump_config(config)) == config
        assert len(plan_episodes(config, FACTS)) == config.episodes
    except ConfigError as error:
        refused = error
    assert refused is None or (": " in refused.message and refused.hint)
