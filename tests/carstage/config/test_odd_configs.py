"""Over five hundred odd, wrong and hostile configurations, made from tables.

Each is refused with the path of a field at fault and a way out, or it is right: then what it is
printed as reads as the same. Nothing else happens, and nothing takes long.
"""

from __future__ import annotations

import faulthandler
import json
from collections.abc import Callable, Iterator
from decimal import Decimal
from typing import Any

import pytest
import yaml

from carstage.config import Config, check_config, dump_config, load_demo, parse_config
from carstage.config.plain_values import plain_copy
from carstage.errors import ConfigError

_HANGS_S = 60.0
"""Then the watchdog prints where it hangs and ends the process; two seconds are usual at most."""

FIELDS: dict[str, Any] = {
    "name": "odd",
    "seed": 3,
    "episodes": 2,
    "duration_s": 2.0,
    "fps": 10.0,
    "save_every": 1,
    "map.choice": "Stage01",
    "weather.choice": "WetNoon",
    "vehicles.count": 3,
    "vehicles.filter": "vehicle.*",
    "vehicles.radius_m": 50.0,
    "pedestrians.count": 2,
    "pedestrians.running_percent": 10.0,
    "traffic.distance_m": 3.0,
    "ego.blueprint": "vehicle.tesla.model3",
    "ego.spawn": 3,
    "ego.color": [1, 2, 3],
    "scenario.kind": "autopilot",
    "timing.mode": "sync",
    "timing.warmup_ticks": 5,
    "timing.sensor_sync": True,
    "image_size": [64, 36],
    "max_distance_m": 80.0,
    "min_lidar_points": 5,
    "ground_truth.vehicles": True,
    "labels.method": "both",
    "labels.cameras": ["CAM"],
    "rig.preset": None,
    "rig.sensors[0].id": "CAM",
    "rig.sensors[0].kind": "rgb",
    "rig.sensors[0].pose.x": 1.0,
    "rig.sensors[0].attributes.fov_deg": 90.0,
    "server.kind": "embedded",
    "server.port": "auto",
    "server.threads": "auto",
    "server.client_python": "auto",
    "supervision.hang_s": 60.0,
    "conversion.workers": 1,
    "conversion.codecs.CAM": "png",
    "output.keep_raw": False,
}
"""A field of every section, with a value that is right."""

VALUES: dict[str, Any] = {
    "nothing": None,
    "true": True,
    "word": "nonsense",
    "empty": "",
    "long": "x" * 100_000,
    "odd letters": "\u202e\u0000\u2028\U0001f600",
    "path": "../../etc/passwd",
    "minus": -1,
    "huge": 10**30,
    "endless": 10**5000,
    "tiny": 5e-324,
    "infinite": float("inf"),
    "no number": float("nan"),
    "list": [],
    "long list": list(range(3000)),
    "mapping": {},
    "odd mapping": {"": {"": 1}, "kind": ["rgb"]},
}
"""What is put into each of the fields: 17 values for 40 fields."""

TEXTS = {
    "text that aliases repeat": "a: &a " + "x" * 900_000 + "\nb: [" + "*a, " * 5000 + "]",
    "aliases of aliases": "a: &a [1, 1, 1]\nb: &b [*a, *a, *a]\nc: [*b, *b, *b]",
    "twenty thousand mistakes": "rig: {sensors: [" + "1," * 20_000 + "]}",
    "twenty thousand keys": "".join(f"key{number}: 1\n" for number in range(20_000)),
    "merge key": "vehicles: &v {count: 1}\npedestrians: {<<: *v, count: 2}",
    "merge tag": "vehicles: &v {count: 1}\npedestrians: {!!merge <<: *v}",
    "no boolean": "output: {keep_raw: !!bool maybe}",
    "no number": "fps: !!float fast",
    "no whole number": "seed: !!int many",
    "set": "labels: {cameras: !!set {A, B}}",
    "date": "name: 2001-12-14",
    "tagged date": "name: !!timestamp 2001-12-14",
    "words of YAML 1.1": "output: {keep_raw: yes}",
    "sexagesimal": "duration_s: 1:30",
    "octal": "seed: 0o17",
    "old octal": "seed: 017",
    "underscores": "seed: 1_000",
    "comment only": "# nothing\n",
    "byte order mark": "\ufeffname: odd",
    "line separators": "name: odd\u2028fps: 3",
    "folded name": "name: >\n  two\n  lines\n",
    "windows": "name: odd\r\nfps: 20\r\n",
}

OVERRIDES = {
    "below a word": "labels.cameras[0].x=1",
    "below a number": "fps.x=1",
    "into a tuple": "image_size[5]=1",
    "digit that is none": "rig.sensors[²].id=A",
    "index that is large": "rig.sensors[99999999999999999999].id=A",
    "index that is negative": "rig.sensors[-1].id=A",
    "name that is none": "rig.sensors[NONE].id=A",
    "five thousand steps": "a." * 5000 + "a=1",
    "no key": "=1",
    "no value": "fps",
    "index alone": "[0]=1",
    "bracket open": "rig.sensors[0.id=A",
    "value is no YAML": "name=[[[",
    "value is a bomb": "name=[&a [1,1,1,1], &b [*a,*a,*a], [*b,*b,*b,*b]]",
    "half a surrogate": "name=\udcff",
    "half a surrogate as key": "\udcff=1",
    "whole section": "rig=7",
    "empty value": "fps=",
    "equal signs": "name=a=b=c",
}


def placed(path: str, value: object) -> dict[str, Any]:
    """The document of all fields with another value at a path."""
    document: dict[str, Any] = {}
    for name, right in FIELDS.items():
        here: Any = document
        steps = name.replace("[0]", ".0").split(".")
        for step, after in zip(steps, [*steps[1:], None], strict=True):
            chosen = value if name == path else right
            below: Any = chosen if after is None else [] if after == "0" else {}
            if isinstance(here, list):
                if not here:
                    here.append(below)
                here = here[0]
            else:
                here = here.setdefault(step, below)
    return document


@pytest.fixture(autouse=True)
def _watchdog() -> Iterator[None]:
    faulthandler.dump_traceback_later(_HANGS_S, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()


def judge(make: Callable[[], Config]) -> tuple[Config | None, str]:
    """The configuration, or None and why it is refused.

    What a right one is printed as reads as the same.
    """
    error: ConfigError | None = None
    config: Config | None = None
    try:
        config = make()
    except ConfigError as caught:
        error = caught
    if config is None:
        assert error is not None
        assert error.hint, f"no way out is told: {error.message}"
        assert len(str(error).encode()) < 5000
        return None, error.message
    printed = dump_config(config)
    assert check_config(printed) == config
    assert parse_config(yaml.safe_dump(json.loads(json.dumps(printed)))) == config
    return config, ""


def test_the_corpus_is_large_and_its_fields_are_right() -> None:
    assert len(FIELDS) * len(VALUES) + len(TEXTS) + len(OVERRIDES) >= 500
    assert judge(lambda: check_config(placed("", None)))[0] is not None


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES.keys())
@pytest.mark.parametrize("path", FIELDS)
def test_odd_value_is_right_or_refused_where_it_stands(path: str, value: object) -> None:
    config, complaint = judge(lambda: check_config(placed(path, value)))
    if config is None:
        # A wrong kind of a section's fields is told at the field or at the section above it.
        above = path.rpartition(".")[0] or path
        firsts = [line.partition(":")[0] for line in complaint.splitlines()]
        told = [
            first for first in firsts if first.startswith((path, above)) or path.startswith(first)
        ]
        elsewhere = {"rig.sensors[0].id": "labels", "duration_s": "timing", "fps": "timing"}
        assert told or any(first.startswith(elsewhere.get(path, path)) for first in firsts), (
            f"{path} is odd, but: {complaint[:500]}"
        )


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS.keys())
def test_odd_text_is_right_or_refused(text: str) -> None:
    judge(lambda: parse_config(text))


@pytest.mark.parametrize("override", OVERRIDES.values(), ids=OVERRIDES.keys())
def test_odd_override_is_right_or_refused_never_dropped(override: str) -> None:
    base = "labels.cameras=[CAM_FRONT]"
    config, _ = judge(lambda: load_demo([base, override]))
    assert config != load_demo([base])


def test_override_changes_one_place_of_an_alias() -> None:
    text = "rig: {sensors: [{id: A, kind: rgb, pose: &p {x: 1.0}}, {id: B, kind: rgb, pose: *p}]}"
    first, second = parse_config(text, ["rig.sensors[A].pose.x=2"]).sensors
    assert (first.pose.x, second.pose.x) == (2.0, 1.0)


@pytest.mark.parametrize(
    ("document", "path"),
    [
        ({"fps": Decimal(10)}, "fps: "),
        ({"name": b"odd"}, "name: "),
        ({"image_size": {64, 36}}, "image_size: "),
        ({"rig": {"sensors": [{"id": 1j}]}}, "rig.sensors[0].id: "),
        ({1: 2}, "the key 1"),
        ({"map": {None: 1}}, "map: the key None"),
        ([], "The document"),
        (None, "The document"),
    ],
    ids=str,
)
def test_what_is_no_plain_value_is_refused_with_its_path(document: object, path: str) -> None:
    config, complaint = judge(lambda: check_config(document))  # type: ignore[arg-type]
    assert config is None
    assert complaint.startswith(path)


def test_what_holds_itself_is_refused() -> None:
    document: dict[str, Any] = {"fps": 10}
    document["rig"] = {"sensors": [document]}
    config, complaint = judge(lambda: check_config(document))
    assert config is None
    assert "nested" in complaint


def test_plain_copy_shares_nothing() -> None:
    shared = [1, 2]
    copied = plain_copy({"a": shared, "b": (shared, shared)})
    assert copied == {"a": [1, 2], "b": [[1, 2], [1, 2]]}
    assert copied["b"][0] is not copied["b"][1]
