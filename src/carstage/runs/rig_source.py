"""What ``record`` is asked to record: a rig, its labels and output; not who drives where."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from carstage.config import Config, check_config, load_config
from carstage.config.paths import place_value, steps_of
from carstage.config.presets import RIG_PRESETS
from carstage.config.rig import Rig
from carstage.config.yaml_text import parse_yaml
from carstage.errors import BadInputError, ConfigError
from carstage.spec import FOLLOW

RigSource: TypeAlias = "Config | str | Path | Mapping[str, Any]"
"""A preset's name, the path of a YAML file, a configuration, or its content as plain values."""

_OF_THE_PROGRAM = frozenset(
    ("map", "vehicles", "pedestrians", "scenario", "ego", "episodes", "campaign", "weather",
     "duration_s", "fps", "traffic", "agents")
)  # fmt: skip
"""Keys of a configuration that say what drives where, when and how often."""
_OF_THE_SERVER = ("client_python", "create_client_env")
"""What of ``server`` counts; the rest is its address."""


def settings_of(
    source: RigSource, overrides: tuple[str, ...]
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The keys that say what is recorded, and which others were given and do not count.

    ``fps`` stays, though it does not count: the rest was written for it, and is checked with it
    until the program's own is known.

    Args:
        source: where the rig is.
        overrides: as ``labels.method=pixels``.

    Raises:
        BadInputError: there is no such preset or file.
        ConfigError: a key is unknown, a value is wrong, there is no rig, or an override is of a
            key that does not count; with the path.
    """
    given = _given(source)
    left_out = tuple(sorted(_OF_THE_PROGRAM & given.keys()))
    asked = {k: v for k, v in given.items() if k == "fps" or k not in _OF_THE_PROGRAM}
    server = asked.get("server", {})
    asked["server"] = {key: server[key] for key in _OF_THE_SERVER if key in server}
    for override in overrides:
        key, sign, text = override.partition("=")
        steps = steps_of(key.strip())
        if not sign or steps is None:
            raise ConfigError(
                f"--set {override}: this is not key=value.", "As in --set save_every=2."
            )
        if steps[0] in _OF_THE_PROGRAM or (
            steps[0] == "server" and steps[1:2] not in [[key] for key in _OF_THE_SERVER]
        ):
            raise ConfigError(
                f"--set {key.strip()}: beside another program this is not yours to choose.",
                "Leave it out; the program, or --server, says it.",
            )
        place_value(asked, steps, parse_yaml(text, f"--set {key}"), f"--set {override}")
    asked.setdefault("name", "recorded")
    return asked, left_out


def _given(source: RigSource) -> dict[str, Any]:
    """The document of a source, checked."""
    if isinstance(source, Config):
        given: dict[str, Any] = source.model_dump(mode="json", exclude_unset=True)
    elif isinstance(source, Mapping):
        given = dict(source)
        _refuse_bare_rig(given, "")
        check_config(given)
    elif str(source) in RIG_PRESETS:
        return {"rig": {"preset": str(source)}}
    elif Path(source).is_file():
        document = parse_yaml(Path(source).read_text("utf-8"), str(source))
        given = dict(document) if isinstance(document, dict) else {}
        _refuse_bare_rig(given, f"{source}: ")
        load_config(source)  # its complaints name the file
    else:
        raise BadInputError(
            f"--rig: {str(source)!r} is neither a preset nor a file.",
            f"Presets are: {', '.join(sorted(RIG_PRESETS))}. A file is a configuration with `rig`.",
        )
    if "rig" not in given:
        raise ConfigError(
            "rig: the configuration has none.", "Give rig.sensors, or a rig.preset such as demo."
        )
    return given


def _refuse_bare_rig(given: Mapping[str, Any], where: str) -> None:
    """Refuse what stands at the top of a document and belongs below ``rig``."""
    for key in Rig.model_fields:
        if key in given and "rig" not in given:
            raise ConfigError(
                f"{where}{key}: unknown key {key!r} at the top of a configuration.",
                f"Put it below `rig:`, as rig.{key}.",
            )


def config_of(asked: Mapping[str, Any]) -> Config:
    """Checked; what drives where is not ours to ask for.

    Conversion is deferred: what is recorded is set aside, on the disk, before anything else.

    Raises:
        ConfigError: a value is wrong, or cannot be had beside a program that ticks.
    """
    conversion = {**asked.get("conversion", {}), "mode": "deferred"}
    nobody = {"vehicles": {"count": 0}, "pedestrians": {"count": 0}, "episodes": 1}
    config = check_config({**asked, "conversion": conversion, **nobody})
    if not (config.timing.mode == "sync" and config.timing.sensor_sync):
        raise ConfigError(
            "timing: beside another program every sensor measures in each of its steps.",
            "Leave timing.mode and timing.sensor_sync out.",
        )
    if config.patches:
        raise ConfigError(
            "patches: beside another program no pictures are put up.", "Leave them out."
        )
    if config.variants:
        raise ConfigError(
            "variants: beside another program there is one recording.", "Leave them out."
        )
    for index, sensor in enumerate(config.rig.sensors):
        if sensor.attachment == FOLLOW:
            raise ConfigError(
                f"rig.sensors[{index}].attachment: follow moves the sensor before each step, and "
                "here somebody else makes them.",
                "Use rigid.",
            )
    return config
